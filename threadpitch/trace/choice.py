"""Which columns of a log are which: as they are named, or as their names and units tell."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from threadpitch import units
from threadpitch.trace.column_names import beside, score, without_unit, words_of
from threadpitch.trace.recording import TraceError
from threadpitch.trace.soundness import TURN

_TIME_NAME = re.compile(r"(?:time|t|timestamps?|zeit|zeitstempel|temps|tempo|tiempo|時間|时间)[\s_]*"
                        r"(?:[\[(/,]|\bin\b)?\s*(s|ms|us|µs|μs|min|)\s*[\])]?", re.IGNORECASE)
_BRACKETS = re.compile(r"(?P<name>.*\S)\s*[\[(]\s*(?P<unit>[^\])]*?)\s*[\])]\s*")
_AFTER_A_COMMA = re.compile(r"(?P<name>.*\S)(?:\s*,\s*|\s+in\s+)(?P<unit>[^\s,]+)\s*")  # Z, mm; Winkel in Grad
_LAST_WORD = re.compile(r"(?P<name>.*?)\s*(?:_|\s/\s*|/)(?P<unit>[^_/\s]+)\s*")
_UNIT_WORDS = {"revs", "rev", "turns", "revolutions", "counts", "umdrehungen"}
_LISTED = 12  # columns that a message lists
_SHOWN = 40  # characters of a text from a file that a message shows
_FEW_TURNS = 3.0  # too few to tell a speed, where the time is that of a computer
FASTEST = units.to_si(30_000.0, "rpm")  # that a spindle turns
_MOST_ASSUMED = 0.5  # turns per sample, of an angle whose unit nothing tells: more is aliasing
_TIMES = {"s", "ms", "us", "min"}
_ANGLES = {"rev", "deg", "rad", "count"}
_LENGTHS = {"mm", "m", "um", "inch", "nm"}
_SPELLINGS = {"°": "deg", "grad": "deg", "gradi": "deg", "grados": "deg", "degrés": "deg", "degree": "deg",
              "degrees": "deg", "revs": "rev", "revolutions": "rev", "turn": "rev", "turns": "rev", "u": "rev",
              "umdr": "rev", "umdrehung": "rev", "umdrehungen": "rev", "tr": "rev", "tours": "rev", "giri": "rev",
              "vueltas": "rev", "counts": "count", "inc": "count", "incr": "count", "increments": "count",
              "ticks": "count", "inkr": "count", "inkremente": "count", "impulse": "count", "imp": "count",
              "pulses": "count", "cts": "count", "µm": "um", "μm": "um", "in": "inch", "inches": "inch", "µs": "us",
              "μs": "us", "sec": "s"}

@dataclass(frozen=True)
class ColumnChoice:
    """Which columns of a log are which, and their units; names as in the header, or numbers from 1.

    Without ``angle`` or ``position`` they are found by their names and units, and then ``group`` too. Units that are
    not given are those of the header (``Z [mm]``, ``z_mm``), else mm, and of the angle that which its samples tell
    (``angle_unit``), else rev, or count with ``counts_per_turn``. ``angle_unit``: rev, deg, rad, or count, which needs
    ``counts_per_turn``, which tells of other units how finely they are resolved. Without ``group`` all rows are one
    group, called 1. Without ``time`` a column that is called time or t, with or without its unit, is taken.

    With ``angle_b`` the columns angle and angle_b are the levels A and B of an incremental encoder, which are counted;
    ``index`` is its one-turn pulse. With ``index_enable`` (and no group) a pass begins where that column falls, as it
    does when the awaited index comes, and ends before it rises again.

    Raises:
        TraceError: a unit is not known or does not fit; ``counts_per_turn`` is missing or not positive; columns that
            do not go together.
    """

    angle: str | None = None
    position: str | None = None
    angle_unit: str | None = None
    position_unit: str | None = None
    group: str | None = None
    time: str | None = None
    counts_per_turn: float | None = None
    angle_b: str | None = None
    index: str | None = None
    index_enable: str | None = None

    def __post_init__(self) -> None:
        if self.counts_per_turn is not None and not 0.0 < self.counts_per_turn < float("inf"):
            raise TraceError(f"counts per turn is {self.counts_per_turn}; give a positive number")
        if self.angle_b is not None and (self.angle is None or self.counts_per_turn is None):
            raise TraceError("the levels A and B of an encoder need both columns and the counts per turn (lines times "
                             "4)")
        if self.angle_b is None and self.index is not None:
            raise TraceError("the one-turn pulse goes with the levels A and B; name the column of B too")
        if self.index_enable is not None and self.group is not None:
            raise TraceError("passes begin by the index enable or by a group, not by both; name one of them")
        if self.angle_b is not None and self.angle_unit not in (None, "count"):
            raise TraceError(f"the levels A and B give counts, not {brief(self.angle_unit or '')}; leave the unit out")
        if self.angle_unit is not None:
            angle_factor(self.angle_unit, self.counts_per_turn)
        if self.position_unit is not None and self.position_unit not in _ANGLES:  # those are of a motor, with a lead
            position_factor(self.position_unit)


@dataclass(frozen=True)
class Chosen:
    """The columns of a log by index, with their units, and how they were found."""

    angle: int
    position: int
    group: int | None
    time: int | None
    angle_unit: str
    position_unit: str
    time_unit: str
    counts_per_turn: float | None
    notes: tuple[str, ...] = ()
    time_is_guessed: bool = False
    angle_b: int | None = None
    index: int | None = None
    index_enable: int | None = None
    following_error: str | None = None  # name of its column; read only where it is asked for
    command: str | None = None  # name of the column of the commanded position, likewise
    angle_name: str = ""  # of its column
    angle_unit_is_assumed: bool = False  # nothing tells it

    @property
    def numbers(self) -> dict[str, int]:
        """The columns of numbers, by the names that a ``Piece`` gives them."""
        found = {"angle": self.angle, "position": self.position, "time": self.time, "angle_b": self.angle_b,
                 "index": self.index}
        return {name: column for name, column in found.items() if column is not None}

    @property
    def columns(self) -> list[int]:
        """All columns that are read, each once; that of the angle first."""
        found = [*self.numbers.values(), self.group, self.index_enable]
        return list(dict.fromkeys(column for column in found if column is not None))

    @property
    def angle_factor(self) -> float:
        """``rad = factor * value``."""
        return angle_factor(self.angle_unit, self.counts_per_turn)

    @property
    def position_factor(self) -> float:
        """``m = factor * value``."""
        return position_factor(self.position_unit)

    def assumed_unit_note(self) -> str:
        """That nothing tells the unit of the angle, and which is taken; empty where it is told."""
        if not self.angle_unit_is_assumed:
            return ""
        return (f"angle: column {brief(self.angle_name)} has no unit: taken as {self.angle_unit}; --angle-unit "
                "overrules it")

    def angle_unit_doubt(self, turns: float, size: int, seconds: float = 0.0) -> str:
        """What to say where so many turns cannot be in so many samples, or s, where they are known; else empty.

        An assumed unit is doubted sooner.
        """
        assumed = self.angle_unit_is_assumed
        if assumed and turns > _FEW_TURNS and seconds > 0.0 and TURN * turns / seconds > FASTEST:
            said = f"{turns:.0f} turns in {seconds:.4g} s"
        elif turns > (_MOST_ASSUMED if assumed else 1.0) * size:
            said = f"{turns:.0f} turns in {size} samples"
        else:
            return ""
        other = "deg or count" if self.angle_unit == "rev" else "rev, deg, rad or count"
        return f"{said}; is the unit of the angle really {self.angle_unit}? Give it: --angle-unit {other}"

    @property
    def time_factor(self) -> float:
        """``s = factor * value``."""
        return units.to_si(1.0, self.time_unit)


def angle_factor(unit: str, counts_per_turn: float | None) -> float:
    """``rad = factor * value``.

    Raises:
        TraceError: the unit is none of an angle, or is count without the counts per turn.
    """
    if unit != "count":
        return _factor(unit, "rad", "angle; known are rev, deg, rad and count")
    if counts_per_turn is None:
        raise TraceError("the angle unit count needs the counts per turn (lines of the encoder times 4)")
    return TURN / counts_per_turn


def position_factor(unit: str) -> float:
    """``m = factor * value``.

    Raises:
        TraceError: the unit is none of a length.
    """
    return _factor(unit, "m", "position; known are mm, m, um and inch")


def brief(text: str) -> str:
    """Text of a file as a message shows it: quoted, control characters escaped, not longer than a line."""
    return repr(text if len(text) <= _SHOWN else text[:_SHOWN] + "...")


def choose(place: str, header: Sequence[str], choice: ColumnChoice, stated: Sequence[str] = (),
           usual_angle: str = "") -> Chosen:
    """The columns of a log with this header; ``stated``: units that the file gives beside the names, "" for none.

    ``usual_angle`` is the unit of an angle that has none, where the format tells it; else rev is assumed.

    Raises:
        TraceError: a column is not there, or more than once, or cannot be told from the others.
    """
    names = [name.strip() for name in header]
    found = [unit_of(name) for name in names]
    told = [_known(own) or unit for own, unit in zip(stated or [""] * len(names), found, strict=True)]
    angle = _named_or_guessed(place, names, told, choice.angle, "angle")
    position = _named_or_guessed(place, names, told, choice.position, "position")
    named = {name: None if column is None else _index(place, names, column) for name, column in {
        "group": choice.group, "angle_b": choice.angle_b, "index": choice.index,
        "index_enable": choice.index_enable}.items()}
    guess = choice.angle is None or choice.position is None
    if guess and choice.group is None and choice.index_enable is None:
        named["group"] = _guess_group(names)
    if named["group"] in (angle, position):
        raise TraceError(f"{place}: the group is column {brief(names[named['group']])}, which is the angle or the "
                         "position; name another one")
    known = choice.angle_unit or (told[angle] if told[angle] in _ANGLES else usual_angle)
    known = known or ("count" if choice.counts_per_turn is not None else "")
    angle_unit = "count" if choice.angle_b is not None else known or "rev"
    assumed = not known and choice.angle_b is None
    if angle_unit == "count" and choice.counts_per_turn is None:
        raise TraceError(f"{place}: the angle in column {brief(names[angle])} is counts; give the counts per turn "
                         "(lines of the encoder times 4)")
    position_unit = choice.position_unit or (told[position] if told[position] in _LENGTHS | _ANGLES else "mm")
    time = _time_column(names, angle) if choice.time is None else _index(place, names, choice.time)
    notes = []
    if guess:
        group = named["group"]
        notes.append(f"columns by their names: angle {brief(names[angle])}{'' if assumed else f' in {angle_unit}'}, "
                     f"position {brief(names[position])} in {position_unit}"
                     + (f", passes by {brief(names[group])}" if group is not None else ""))
    time_unit = told[time] if time is not None and told[time] in _TIMES else "s"
    return Chosen(angle, position, named["group"], time, angle_unit, position_unit, time_unit, choice.counts_per_turn,
                  tuple(notes), choice.time is None, named["angle_b"], named["index"], named["index_enable"],
                  _single(names, beside(names, position, "following error")),
                  _single(names, beside(names, position, "command")), names[angle], assumed)


def _single(names: list[str], column: int | None) -> str | None:
    """The name of a column, where no other has it."""
    return None if column is None or names.count(names[column]) > 1 else names[column]


def is_time(name: str) -> bool:
    """Whether a column is called time or t, with or without its unit."""
    return _TIME_NAME.fullmatch(name) is not None


def time_factor(name: str, unit: str) -> float:
    """``s = factor * value`` of a time with this name and unit; s where none is told."""
    told = _known(unit) or unit_of(name.rpartition("/")[2])
    return units.to_si(1.0, told if told in _TIMES else "s")


def _time_column(names: Sequence[str], angle: int) -> int | None:
    """The column called time: that beside the angle, where names are paths (``run/spindle/time``)."""
    beside = names[angle].rpartition("/")[0]
    found = [i for i, name in enumerate(names) if is_time(name)]
    return next((i for i, name in enumerate(names) if beside and name.startswith(f"{beside}/")
                 and is_time(name[len(beside) + 1 :])), found[0] if found else None)


def unit_of(name: str) -> str:
    """The unit that the name of a column ends with: ``Z [mm]``, ``z (mm)``, ``z/mm``, ``z, mm``, ``z in mm``,
    ``z_mm``; "" for none.
    """
    match = _TIME_NAME.fullmatch(name)
    if match is not None:
        return _known(match[1])
    for pattern in (_BRACKETS, _AFTER_A_COMMA, _LAST_WORD):
        match = pattern.fullmatch(name)
        if match is not None and _known(match["unit"]):
            return _known(match["unit"])
    return next((_known(word) for word in words_of(name) if word in _UNIT_WORDS), "")


def _known(unit: str) -> str:
    unit = unit.strip()
    for spelling in (unit, unit.casefold()):
        spelling = _SPELLINGS.get(spelling, spelling)
        if spelling in _ANGLES | _LENGTHS | _TIMES:
            return spelling
    return ""


def _factor(name: str, target: str, wanted: str) -> float:
    try:
        return units.conversion(name, target)[0]
    except units.UnitError:
        raise TraceError(f"{brief(name)} is not a unit of the {wanted}") from None


def _named_or_guessed(place: str, names: list[str], told: list[str], name: str | None, quantity: str) -> int:
    if name is not None:
        return _index(place, names, name)
    of_quantity = _ANGLES if quantity == "angle" else _LENGTHS
    scores = [score(other, quantity) + _unit_score(unit, of_quantity) for other, unit in zip(names, told, strict=True)]
    best = max(scores, default=0)
    equal = [i for i, score in enumerate(scores) if score == best]
    option = f"--{quantity} COLUMN"
    if best < 3 and quantity == "angle":  # S1 [deg]: one column alone has a unit of an angle
        equal = [i for i, unit in enumerate(told) if unit in of_quantity and score(names[i], "position") < 3]
    if best < 3 and not (quantity == "angle" and len(equal) == 1):
        raise TraceError(f"{place}: no column is called like the {quantity}; choose one with {option}, by name or "
                         f"number, out of {_numbered(names, range(min(len(names), _LISTED)), ', ')}")
    if len(equal) > 1:
        raise TraceError(f"{place}: the {quantity} may be column {_numbered(names, equal[:4], ' or ')}; choose with "
                         f"{option}, by name or number")
    return equal[0]


def _numbered(names: list[str], columns: Iterable[int], between: str) -> str:
    return between.join(f"{i + 1} {brief(names[i])}" for i in columns)


def _unit_score(unit: str, of_quantity: set[str]) -> int:
    if unit in of_quantity:
        return 2
    return -5 if unit else 0


def _guess_group(names: list[str]) -> int | None:
    scores = [score(name, "pass") for name in names]
    best = max(scores, default=0)
    return scores.index(best) if best >= 3 and scores.count(best) == 1 else None


def _index(place: str, names: list[str], name: str) -> int:
    found = [i for i, other in enumerate(names) if other == name.strip()]
    if len(found) == 1:
        return found[0]
    if found:
        raise TraceError(f"{place}: column {brief(name)} is there {len(found)} times; give every column a name of its "
                         "own")
    if name.isascii() and name.isdigit() and 1 <= int(name) <= len(names):
        return int(name) - 1
    parts = [i for i, other in enumerate(names)
             if other.endswith(f"/{name.strip()}") or other.startswith(f"{name.strip()}: ")
             or without_unit(other) == name.strip()]
    if len(parts) == 1:
        return parts[0]  # the last part of a path, a description before an address, a name before a unit
    near = difflib.get_close_matches(name, names, n=3, cutoff=0.4) or names[:_LISTED]
    raise TraceError(f"{place}: there is no column {brief(name)}; nearest are {', '.join(map(brief, near))}")
