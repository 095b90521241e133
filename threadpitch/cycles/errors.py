"""What a program or a parameter file can have wrong: the alarm, the place, and how to mend it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Alarm(Enum):
    """An alarm of the control: its number in the Fanuc lists (empty where they have none) and its text.

    The sheets of the GSK and TOMATECH controls name the conditions without numbers; the numbers are Fanuc's.
    """

    DIGITS = ("003", "too many digits")
    NO_ADDRESS = ("004", "address not found")
    NO_NUMBER = ("005", "no number after the address")
    MINUS = ("006", "illegal use of the minus sign")
    POINT = ("007", "illegal use of the decimal point")
    ILLEGAL = ("009", "illegal address or character")
    G_CODE = ("010", "improper G code")
    NO_FEED = ("011", "no feed or lead commanded")
    VARIABLE_LEAD = ("014", "illegal lead command")
    CYCLE = ("062", "illegal command in the threading cycle")
    COMMENT = ("", "comment not closed")
    REPEATED = ("", "address repeated")
    M_CODE = ("", "improper M code")
    END_POINT = ("", "end point of the thread")
    POSITION = ("", "position not known")
    RANGE = ("", "value out of range")
    RUN_OUT = ("", "run-out longer than the thread")
    SPINDLE = ("", "no spindle speed commanded")
    LENGTH = ("", "thread without length")
    PASSES = ("", "too many passes")
    MOVES = ("", "program too long")

    def __str__(self) -> str:
        number, text = self.value
        return f"alarm {number} ({text})" if number else f"alarm ({text})"


@dataclass(frozen=True)
class Place:
    """Where in a program: line and column from 1, and the program's name where it has one."""

    line: int
    column: int
    source: str = ""

    def __str__(self) -> str:
        here = f"line {self.line}, column {self.column}"
        return f"{self.source}: {here}" if self.source else here


class CycleError(ValueError):
    """A program, a cycle or a parameter that the control refuses: what, where and how to mend it, in one line."""


class ThreadError(CycleError):
    """Numbers that make no threading cycle; ``address`` is the word that carries them in a program.

    The interpreter turns it into a ``ProgramError`` at the place of that word.
    """

    def __init__(self, alarm: Alarm, address: str, what: str) -> None:
        super().__init__(f"{alarm}: {what}")
        self.alarm = alarm
        self.address = address
        self.what = what


class ProgramError(CycleError):
    """A program stops with an alarm at a place.

    Example: ``line 2, column 14: alarm 062 (illegal command in the threading cycle): the thread height P(k) is 0; ...``
    """

    def __init__(self, place: Place, alarm: Alarm, what: str) -> None:
        super().__init__(f"{place}: {alarm}: {what}")
        self.place = place
        self.alarm = alarm
        self.what = what

    def __reduce__(self) -> tuple[type[ProgramError], tuple[Place, Alarm, str]]:
        """Crosses processes whole: the message alone would not rebuild it."""
        return type(self), (self.place, self.alarm, self.what)


@dataclass(frozen=True)
class Notice:
    """What a machinist should know about a program that runs: no alarm, a note."""

    place: Place
    text: str

    def __str__(self) -> str:
        return f"{self.place}: {self.text}"
