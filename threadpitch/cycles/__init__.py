"""Threading words and cycles: NC text -> canonical moves -> passes.

``read_program`` reads blocks, ``interpret`` executes them, ``expand_cycle`` takes the blocks of a cycle alone;
``G76Cycle`` with ``passes`` is the cycle as numbers. SI inside and x as radius; words, tables and JSON have mm, degrees
and X as diameter.
"""

from threadpitch.cycles.dialect import DIALECTS, FANUC, GSK980TDI, GSK988TA, TOMATECH, Dialect, dialect_named
from threadpitch.cycles.document import cycle_document, cycle_table, moves_text
from threadpitch.cycles.errors import Alarm, CycleError, Notice, Place, ProgramError, ThreadError
from threadpitch.cycles.expand import expand_cycle, start_point
from threadpitch.cycles.interpreter import Interpretation, interpret
from threadpitch.cycles.modal import Indexing, Setup, UnknownStart
from threadpitch.cycles.moves import Move, Pass, Point, RunOut, Thread, ThreadPath, Wait
from threadpitch.cycles.multiple import G76Cycle, Helix, Infeed, passes
from threadpitch.cycles.parameters import ControlParameters, ParameterFile
from threadpitch.cycles.pass_kinds import final_flank, hands, largest_feed, spindle_of_passes, turning_speed
from threadpitch.cycles.program import Program, read_program, read_program_file
from threadpitch.cycles.scheme import InfeedScheme, ToolPath, groove_locus, infeed_scheme, tool_path
from threadpitch.cycles.single import G92Cycle
from threadpitch.cycles.words import IncrementSystem

__all__ = [
    "DIALECTS", "FANUC", "GSK980TDI", "GSK988TA", "TOMATECH", "Alarm", "ControlParameters", "CycleError", "Dialect",
    "G76Cycle", "G92Cycle", "Helix", "IncrementSystem", "Indexing", "Infeed", "InfeedScheme", "Interpretation", "Move",
    "Notice", "ParameterFile", "Pass", "Place", "Point", "Program", "ProgramError", "RunOut", "Setup", "Thread",
    "ThreadError", "ThreadPath", "ToolPath", "UnknownStart", "Wait", "cycle_document", "cycle_table", "dialect_named",
    "expand_cycle", "final_flank", "groove_locus", "hands", "infeed_scheme", "interpret", "largest_feed", "moves_text",
    "passes", "read_program", "read_program_file", "spindle_of_passes", "start_point", "tool_path", "turning_speed",
]
