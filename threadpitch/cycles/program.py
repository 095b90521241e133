"""Text of an NC program -> blocks of words, each with its line and column.

The grammar (``grammar.lark``) is read by Lark, chosen because its LALR(1) parser takes linear time on any text, gives
every token its line and column, says what it expected, needs nothing else, is typed and maintained, and comes with
FMPy already. pyparsing and parsimonious backtrack and know only the furthest place that failed, textX builds object
models that words do not need, parsy leaves places to its user.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from decimal import Decimal
from importlib import resources
from pathlib import Path

from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedCharacters, UnexpectedInput, UnexpectedToken

from threadpitch.cycles.errors import Alarm, CycleError, Place, ProgramError

DIGITS = 8  # of one number, leading zeros and zeros behind the point not counted (Fanuc 16/18)
LARGEST_FILE = 2 * 2**20  # bytes, 5 km of tape; read in a few seconds


@dataclass(frozen=True)
class Word:
    """An address and its number as written: ``X`` and ``60.64``."""

    address: str
    text: str
    place: Place

    @property
    def value(self) -> Decimal:
        """The number as written, exact."""
        return Decimal(self.text)

    @property
    def has_point(self) -> bool:
        """Whether a decimal point is written."""
        return "." in self.text

    def __str__(self) -> str:
        return f"{self.address}{self.text}"


@dataclass(frozen=True)
class Block:
    """One block: its words in order; ``ends_tape`` for the sign % that ends, or begins, a tape."""

    words: tuple[Word, ...]
    place: Place
    skippable: bool = False
    ends_tape: bool = False


@dataclass(frozen=True)
class Program:
    """The blocks of a program that carry anything."""

    blocks: tuple[Block, ...]
    name: str = ""


def read_program(text: str, name: str = "") -> Program:
    """The blocks of a program's text; ``name`` leads the places in messages.

    Raises:
        ProgramError: what is no word, with line, column and alarm.
    """
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    tree = _tree(text)
    if isinstance(tree, UnexpectedInput):  # raised here, without it as context: Lark's errors cannot cross processes
        raise _refusal(tree, text, name)
    blocks = (_block(child, name) for child in tree.children if isinstance(child, Tree) and child.children)
    return Program(tuple(block for block in blocks if block.words or block.ends_tape), name)


def read_program_file(path: Path) -> Program:
    """The program in a file of any encoding that keeps ASCII (other characters may stand in comments only).

    Raises:
        CycleError: the file cannot be read, or is larger than 2 MiB.
        ProgramError: what is no word, with line, column and alarm.
    """
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except OSError as error:
        raise CycleError(f"{path}: cannot be read ({error.strerror}); name an NC program") from None
    if len(content) > LARGEST_FILE:
        raise CycleError(f"{path}: is larger than {LARGEST_FILE >> 20} MiB; that is no NC program")
    return read_program(decoded(content), str(path))


def decoded(content: bytes) -> str:
    """UTF-8, or one character per byte where it is not: comments come in many encodings, words only in ASCII."""
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("latin-1")


@functools.cache
def _parser() -> Lark:
    grammar = resources.files("threadpitch.cycles").joinpath("grammar.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr", lexer="basic", propagate_positions=True)


def _block(tree: Tree[Token], name: str) -> Block:
    words = []
    skippable = ends_tape = False
    for child in tree.children:
        if isinstance(child, Tree):
            words.append(_word(child, name))
        elif child.type == "SKIP":
            skippable = True
        elif child.type == "TAPE_END":
            ends_tape = True
    place = Place(tree.meta.line, tree.meta.column, name)
    return Block(tuple(words), words[0].place if words else place, skippable, ends_tape)


def _word(tree: Tree[Token], name: str) -> Word:
    address, number = tree.children
    assert isinstance(address, Token)
    assert isinstance(number, Token)
    word = Word(address.upper(), str(number), _place(address, name))
    whole, _, fraction = word.text.lstrip("+-").partition(".")
    if len(whole.lstrip("0")) + len(fraction.rstrip("0")) > DIGITS or len(word.text) > 3 * DIGITS:
        raise ProgramError(word.place, Alarm.DIGITS,
                           f"the number of {word.address} has more than {DIGITS} digits; write fewer")
    return word


def _place(token: Token, name: str) -> Place:
    return Place(token.line or 1, token.column or 1, name)


def _tree(text: str) -> Tree[Token] | UnexpectedInput:
    """What the grammar makes of a text, or where it does not fit."""
    try:
        return _parser().parse(text)
    except UnexpectedInput as error:
        return error


def _refusal(error: UnexpectedInput, text: str, name: str) -> ProgramError:
    """The alarm for text that the grammar does not take."""
    place = Place(max(error.line, 1), max(error.column, 1), name)
    if isinstance(error, UnexpectedCharacters):
        return _bad_character(place, text[error.pos_in_stream or 0])
    if isinstance(error, UnexpectedToken):
        token = error.token
        if "NUMBER" in error.expected and "ADDRESS" not in error.expected:
            return _no_number(token, text, name)
        if token.type == "NUMBER" and token.startswith(".") and text[(token.start_pos or 1) - 1].isdigit():
            return ProgramError(place, Alarm.POINT, "the number has two decimal points; write one")
        if token.type == "NUMBER":
            return ProgramError(place, Alarm.NO_ADDRESS, f"the number {_brief(token)} has no address before it; "
                                "write one, as in X10.5")
        if token.type == "SKIP":
            return ProgramError(place, Alarm.ILLEGAL, "a slash stands inside a block; the skip sign leads its block")
        if token.type == "TAPE_END":
            return ProgramError(place, Alarm.ILLEGAL, "% stands inside a block; it has a line of its own")
    return ProgramError(place, Alarm.ILLEGAL, "no NC word; write an address and a number, as in X10.5")


def _bad_character(place: Place, character: str) -> ProgramError:
    if character == "(":
        return ProgramError(place, Alarm.COMMENT, "the comment does not end on its line, or holds another (; "
                            "close it with )")
    if character in "#[]=*":
        return ProgramError(place, Alarm.ILLEGAL, f"{character} belongs to macros; write numbers")
    if character in "+-.":
        return ProgramError(place, Alarm.NO_NUMBER, f"digits have to follow {character}; write a number, as in X-0.5")
    return ProgramError(place, Alarm.ILLEGAL, f"the character {character!a} is none of the NC code; remove it")


def _no_number(token: Token, text: str, name: str) -> ProgramError:
    """An address without a number: the place is the address, not what follows it."""
    end = len(text) if token.type == "$END" else token.start_pos or 0
    before = text[:end].rstrip(" \t\f")
    line = before.count("\n") + 1
    column = len(before) - (before.rfind("\n") + 1)
    address = before[-1:].upper()
    return ProgramError(Place(line, max(column, 1), name), Alarm.NO_NUMBER,
                        f"the address {address} has no number; write one or remove it")


def _brief(text: str) -> str:
    return text if len(text) <= 16 else text[:16] + "..."
