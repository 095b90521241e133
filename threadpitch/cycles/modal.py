"""The state of the control while a program runs: what is modal, where the tool is, what has come out so far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum

from threadpitch.cycles.dialect import TOMATECH, Dialect
from threadpitch.cycles.errors import Alarm, Notice, Place, ProgramError
from threadpitch.cycles.moves import Direction, Feed, Move, Pass, Point, Rapid, Thread, ThreadPath
from threadpitch.cycles.parameters import ControlParameters, Number
from threadpitch.cycles.program import Block, Word
from threadpitch.cycles.words import IncrementSystem, Scale, finer_than_increment, length

MOST_MOVES = 200_000  # of one program; a guard against programs that only fill the memory
REPEATABLE = {"G", "M"}
_FEW_MOVES = 8  # spindle, dwell and tool moves that may stand between two threading blocks


class Indexing(Enum):
    """What the blocks of a chain of threading blocks wait for."""

    ONCE = "once"  # the first for the one-turn signal and its start angle, the rest goes on without waiting
    EVERY_BLOCK = "every_block"  # special grooves: every block for its own start angle, without a new index reset


class UnknownStart(Enum):
    """What a cycle does when no block has said where the tool is."""

    REFUSE = "refuse"
    ASSUME = "assume"  # a start point clear of the thread is assumed, with a note


@dataclass(frozen=True)
class Setup:
    """The machine as the program finds it: control, parameters, tool position (x radius, m; z, m), spindle (rad/s).

    ``starts`` are those of a thread by G76, which has no word for them; ``tool_angles`` (rad, by tool number) are the
    tools' own angles, against which G76's P(a) is compared.
    """

    dialect: Dialect = TOMATECH
    increments: IncrementSystem = IncrementSystem.IS_B
    parameters: ControlParameters = field(default_factory=ControlParameters)
    position: Point | None = None
    spindle_speed: float | None = None  # already turning forward at this speed
    starts: int = 1
    tool_angles: Mapping[int, float] = field(default_factory=dict)
    indexing: Indexing = Indexing.ONCE
    unknown_start: UnknownStart = UnknownStart.REFUSE


class BlockWords:
    """The words of one block by address; a word that nothing takes is an alarm in the end."""

    def __init__(self, block: Block) -> None:
        self.place = block.place
        self.line = block.place.line
        self._words: dict[str, Word] = {}
        self._places = {word.address: word.place for word in block.words}
        self._repeatable: dict[str, list[Word]] = {address: [] for address in REPEATABLE}
        for word in block.words:
            if word.address in REPEATABLE:
                self._repeatable[word.address].append(word)
            elif word.address in self._words:
                raise ProgramError(word.place, Alarm.REPEATED, f"{word} comes after {self._words[word.address]} in one "
                                   "block; write one of them")
            else:
                self._words[word.address] = word

    def all(self, address: str) -> list[Word]:
        """All G or M words, in order."""
        return self._repeatable[address]

    def take(self, address: str) -> Word | None:
        """The word of this address, which counts as used from now on; None where there is none."""
        return self._words.pop(address, None)

    def has(self, *addresses: str) -> bool:
        """Whether a word of one of these addresses is not used yet."""
        return any(address in self._words for address in addresses)

    def place_of(self, address: str) -> Place:
        """Of the word with this address, used or not; of the block where there is none."""
        return self._places.get(address, self.place)

    def refuse_unused(self) -> None:
        """Raises ProgramError for the first word that nothing took."""
        for word in self._words.values():
            raise ProgramError(word.place, Alarm.ILLEGAL, f"{word} means nothing in this block; remove it")


@dataclass
class Modal:
    """Everything that outlives a block. Places in workpiece coordinates, SI, x as radius.

    ``shift`` is what G50 adds: workpiece coordinate = programmed coordinate + shift.
    """

    setup: Setup
    scale: Scale
    parameters: ControlParameters
    cycle_parameters: ControlParameters  # of the next G76: with the words of its first block
    x: float | None = None
    z: float | None = None
    infeed_from: float | None = None  # x before the last rapid that moved X: the side on which the tool is clear
    infeed_from_z: float | None = None  # z before the last rapid, where that moved Z alone
    shift_x: float = 0.0
    shift_z: float = 0.0
    motion: str = "G0"
    feed_per_turn: bool = True
    feed: float | None = None  # m per turn, or m per minute after G98
    lead: float | None = None  # m per turn
    lead_change: float = 0.0  # of G34
    taper: float = 0.0  # of G92 and G90, as what follows
    cycle_x: float | None = None  # end point
    cycle_z: float | None = None
    starts: int = 1  # of G92
    speed: float | None = None  # rad/s
    surface: bool = False  # G96 holds
    surface_speed: float | None = None  # m/s
    direction: Direction | None = None
    tool: int | None = None
    moves: list[Move] = field(default_factory=list)
    passes: list[Pass] = field(default_factory=list)
    paths: list[list[ThreadPath]] = field(default_factory=list)  # of each pass; chains grow
    notices: list[Notice] = field(default_factory=list)
    noted: set[str] = field(default_factory=set)  # texts of the notices
    rewritten: dict[str, Number] = field(default_factory=dict)
    ended: bool = False

    @classmethod
    def of(cls, setup: Setup) -> Modal:
        """The state after power-on."""
        position = setup.position
        made = cls(setup, Scale(setup.increments, setup.dialect.bare_number), setup.parameters, setup.parameters,
                   position.x if position else None, position.z if position else None)
        if setup.spindle_speed is not None:
            made.speed, made.direction = setup.spindle_speed, "forward"
        return made

    def emit(self, move: Move, place: Place) -> None:
        """Add a move."""
        if len(self.moves) >= MOST_MOVES:
            raise ProgramError(place, Alarm.MOVES, f"the program makes more than {MOST_MOVES} moves; split it")
        self.moves.append(move)

    def rapid(self, x: float | None, z: float | None, place: Place) -> None:
        """Rapid traverse to there; axes that stay are named with their place."""
        self.emit(Rapid(place.line, x, z), place)
        if x != self.x:
            self.infeed_from = self.x
        self.infeed_from_z = self.z if x == self.x else None
        self.x, self.z = x, z

    def note(self, place: Place, text: str) -> None:
        """Add a note; the same text once."""
        if text not in self.noted:
            self.noted.add(text)
            self.notices.append(Notice(place, text))

    def taken_length(self, word: Word) -> float:
        """The word's length, m, with a note where it is finer than the control reads."""
        if finer_than_increment(word, self.scale):
            self.note(word.place, f"{word} is finer than the least input increment; a control drops the last places")
        return length(word, self.scale)

    def target(self, words: BlockWords) -> tuple[float | None, float | None]:
        """Where X, U, Z, W lead to, workpiece coordinates; an axis without a word stays.

        Raises:
            ProgramError: X with U, Z with W, a difference from an unknown place.
        """
        x = self._axis(words, ("X", "U"), self.x, self.shift_x)
        return x, self._axis(words, ("Z", "W"), self.z, self.shift_z)

    def cycle_target(self, words: BlockWords) -> tuple[float | None, float | None]:
        """The same for G90 and G92, whose end point is modal: an axis without a word is that of the block before."""
        tells_x, tells_z = words.has("X", "U"), words.has("Z", "W")
        x, z = self.target(words)
        self.cycle_x = x if tells_x or self.cycle_x is None else self.cycle_x
        self.cycle_z = z if tells_z or self.cycle_z is None else self.cycle_z
        return self.cycle_x, self.cycle_z

    def enter(self, motion: str) -> None:
        """Another motion code: what G90 and G92 remember is gone."""
        if motion != self.motion:
            self.motion = motion
            self.taper, self.cycle_x, self.cycle_z, self.starts = 0.0, None, None, 1

    def _axis(self, words: BlockWords, addresses: tuple[str, str], here: float | None, shift: float) -> float | None:
        absolute, difference = (words.take(address) for address in addresses)
        if absolute and difference:
            raise ProgramError(difference.place, Alarm.END_POINT, f"{absolute} and {difference} name one axis twice; "
                               "write one of them")
        word = absolute or difference
        if word is None:
            return here
        half = 0.5 if addresses[0] == "X" else 1.0  # X and U are diameters
        value = half * self.taken_length(word)
        if absolute:
            return value + shift
        if here is None:
            raise ProgramError(word.place, Alarm.POSITION, f"{word} is a difference from a place not told yet; "
                               f"write {addresses[0]} before")
        return here + value

    def known_place(self, words: BlockWords) -> Point:
        """Where the tool is.

        Raises:
            ProgramError: no block has told it.
        """
        if self.x is None or self.z is None:
            axis = "X" if self.x is None else "Z"
            raise ProgramError(words.place, Alarm.POSITION, f"no block has told the tool's {axis}; write G0 X Z before")
        return Point(self.x, self.z)

    def require_spindle(self, words: BlockWords) -> None:
        """Raises ProgramError when threading would wait for a spindle that does not turn."""
        if not (self.surface_speed if self.surface else self.speed):
            raise ProgramError(words.place, Alarm.SPINDLE, "threading needs a turning spindle; write S and M3 before")
        if self.direction is None:
            raise ProgramError(words.place, Alarm.SPINDLE, "the spindle stands still; write M3 or M4 before")
        if self.surface:
            self.note(words.place, "threading under constant surface speed (G96): the speed changes with X; write G97")

    @property
    def turning(self) -> tuple[object, ...]:
        """What the spindle is told: its speed, of which kind, and the direction."""
        return (self.surface_speed if self.surface else self.speed, self.surface, self.direction)

    def add_pass(self, made: Pass) -> Pass:
        """Take a pass into the program's list, numbered on."""
        numbered = replace(made, number=len(self.passes) + 1)
        self.passes.append(numbered)
        self.paths.append(list(made.paths))
        return numbered

    def finished_passes(self) -> list[Pass]:
        """The passes with all the paths that chains have added."""
        return [replace(made, paths=tuple(paths)) for made, paths in zip(self.passes, self.paths, strict=True)]

    @property
    def chain_is_broken(self) -> bool:
        """Whether the tool stands where a threading block ended, but what came since ends its chain."""
        moving = [move for move in self.moves[-_FEW_MOVES:] if isinstance(move, Rapid | Feed | Thread)]
        return bool(moving) and isinstance(moving[-1], Thread) and not self.chained

    @property
    def chained(self) -> bool:
        """Whether the last move was a threading block of G32, G33 or G34: the next goes on without waiting."""
        return bool(self.moves) and isinstance(self.moves[-1], Thread)
