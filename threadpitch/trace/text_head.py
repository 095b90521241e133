"""What stands above the rows of a text log: names, units, separator, decimal sign."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from threadpitch.trace.choice import unit_of
from threadpitch.trace.recording import TraceError

_SEPARATORS = ";\t,"  # a semicolon or a tab is never a decimal sign, a comma may be
_COMMENT = re.compile(r"\s*(#|%|//)")
_DECIMAL_COMMA = re.compile(r"\s*[-+]?\d+,\d+([eE][-+]?\d+)?\s*")
_WIDE_GAP = re.compile(r"\s{2,}|\t")
_WITH_UNIT = re.compile(r"[^\s\[(][^\[(]*?\s*[\[(][^\])]*[\])]")  # spindle angle [deg]
_LOOKED_AT = 200  # rows, for the decimal sign and a header of several lines
_SCOPE_PROPERTIES = {"SymbolName", "Data-Type", "SampleTime[ms]"}
_SCOPE = "Name"  # the first word of a TwinCAT Scope export


@dataclass(frozen=True)
class Head:
    """How the rows of a text log are to be read."""

    names: list[str]
    units: list[str]
    lines: int  # of the block, down to the first row of numbers
    line: int  # of the names in the file, from 1
    separator: str
    words: bool = False  # separated by any number of blanks
    decimal_comma: bool = False
    notes: tuple[str, ...] = ()
    numbered: bool = False  # there is no header
    sample_times: tuple[str, ...] = ()  # of the channels, where they are told and differ

    def plain(self, text: list[str]) -> list[str]:
        """The lines with one separator between the fields, points as decimal signs, and nothing of comments."""
        if any(mark in row for row in text for mark in ("#", "%", "//")):
            text = ["" if _COMMENT.match(row) else row for row in text]
        if self.decimal_comma:
            text = [row.replace(",", ".") for row in text]
        return [" ".join(row.split()) for row in text] if self.words else text


def find_head(text: list[str], source: str, above: int) -> Head:
    """The head of a file, from its first block; ``above`` lines of the file stand above it.

    Raises:
        TraceError: there is no row.
    """
    rows = [i for i, row in enumerate(text[:_LOOKED_AT]) if row.strip() and not _COMMENT.match(row)]
    if not rows:
        raise TraceError(f"{source}: there are only comments; give a log with a header and rows")
    first = rows[0]
    separator = " " if _numbers_below(text, rows) else _separator(text[first])
    scope = _scope_head(text, rows, separator, above)
    head = scope or _plain_head(text, rows, separator, above)
    body = text[head.lines : head.lines + _LOOKED_AT]
    comma = head.separator != "," and any(
        _DECIMAL_COMMA.fullmatch(field) for row in body for field in _fields(row, head.separator, head.words))
    if comma:
        head = replace(head, decimal_comma=True, notes=(*head.notes, "numbers are read with a decimal comma"))
    return head


def _plain_head(text: list[str], rows: list[int], separator: str, above: int) -> Head:
    first = rows[0]
    words = separator == " "
    width = _numbers_below(text, rows) if words else 0
    names = _blank_parted(text[first], width) if width else _fields(text[first], separator, words)
    place = above + first + 1
    if all(_is_number(name) or (words and _is_decimal(name)) for name in names):
        commented = _COMMENT.sub("", text[first - 1]) if first > 0 and _COMMENT.match(text[first - 1]) else ""
        named = _fields(commented, separator, False) if separator in commented and not words else (
            _blank_parted(commented, len(names)))
        if len(named) == len(names) and commented.strip():
            return Head(named, [""] * len(names), first, place - 1, separator, words)
        numbered = [f"column {i + 1}" for i in range(len(names))]
        return Head(numbered, [""] * len(names), first, place, separator, words, numbered=True)
    units = [""] * len(names)
    lines = first + 1
    if len(rows) > 1:
        second = [field.strip("[]() ") for field in _fields(text[rows[1]], separator, words)]
        if len(second) == len(names) and any(second) and all(not unit or unit_of(f"[{unit}] [{unit}]") or unit == "-"
                                                             for unit in second):
            units, lines = second, rows[1] + 1
    return Head(names, units, lines, place, separator, words)


def _scope_head(text: list[str], rows: list[int], separator: str, above: int) -> Head | None:
    """TwinCAT Scope: rows of properties (Name, SymbolName, Unit, ...), channels side by side, each with its time."""
    fields = {i: _fields(text[i], separator, False) for i in rows}
    properties = {row[0].strip(): (i, row) for i, row in fields.items() if row and not _is_decimal(row[0])}
    if fields[rows[0]][0].strip() != _SCOPE or not _SCOPE_PROPERTIES & properties.keys():
        return None
    line, names_row = max((i, row) for i, row in fields.items() if row[0].strip() == _SCOPE)
    body = next((i for i in rows if i > line and all(_is_decimal(field) for field in fields[i] if field.strip())), None)
    if body is None:
        return None
    width = len(fields[body])
    names = [name.strip() for name in names_row[1::2]]
    columns = [name for i, channel in enumerate(names)
               for name in (f"clock {i + 1} [ms]" if i else "time [ms]", channel)]
    unit_row = properties.get("Unit", (0, []))[1][1::2]
    units = [unit for i in range(len(names)) for unit in ("", unit_row[i].strip() if i < len(unit_row) else "")]
    columns += [f"column {i + 1}" for i in range(len(columns), width)]
    units += [""] * (width - len(units))
    times = tuple(time.strip() for time in properties.get("SampleTime[ms]", (0, []))[1][1::2])
    differ = len(set(times)) > 1 and len(times) == len(names) and width == 2 * len(names)
    return Head(columns[:width], units[:width], body, above + line + 1, separator,
                notes=("read as an export of TwinCAT Scope",), sample_times=times if differ else ())


def _separator(row: str) -> str:
    counts = {separator: row.count(separator) for separator in _SEPARATORS}
    if not any(counts.values()):
        return " " if len(row.split()) > 1 else ","
    if counts["\t"] == counts[";"] == 0 and _words_with_commas(row):
        return " "
    return max(counts, key=lambda separator: counts[separator])


def _numbers_below(text: list[str], rows: list[int]) -> int:
    """How many numbers parted by blanks the first row of numbers below the header holds; 0 for one that is not."""
    for row in rows[1:3]:  # a row of units may be between
        words = text[row].split()
        if len(words) > 1 and "\t" not in text[row].strip() and all(_is_number(word) or _DECIMAL_COMMA.fullmatch(word)
                                                                    for word in words):
            return len(words)
    return 0


def _blank_parted(header: str, width: int) -> list[str]:
    """The names of a header parted by blanks over rows of so many numbers, where names hold blanks too.

    They are parted by single blanks, or by two or more, or each ends with its unit in brackets; as it fits.
    """
    ways = (header.split(), _WIDE_GAP.split(header.strip()), _WITH_UNIT.findall(header))
    return next((names for names in ways if len(names) == width), ways[0])


def _words_with_commas(row: str) -> bool:
    """Numbers with decimal commas, parted by blanks."""
    words: Sequence[str] = row.split()
    return len(words) > 1 and all(_is_decimal(word) for word in words)


def _fields(row: str, separator: str, words: bool) -> list[str]:
    return row.split() if words else next(csv.reader([row], delimiter=separator), [])


def _is_number(name: str) -> bool:
    try:
        float(name)
    except ValueError:
        return False
    return True


def _is_decimal(field: str) -> bool:
    return _is_number(field.strip().replace(",", "."))
