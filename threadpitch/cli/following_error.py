"""The recording of a log that tells where in the control a fluctuation comes from, with its following error."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from threadpitch.cli.printing import remark
from threadpitch.judgement import ControlTrace, JudgementError
from threadpitch.tables import printable
from threadpitch.trace import ColumnChoice, FloatArray, Signals, Trace, chosen_columns, read_groups
from threadpitch.trace.choice import unit_of
from threadpitch.trace.text_rows import STANDARD_INPUT

NONE = "none"


def recorded_control(log: Path, choice: ColumnChoice, signals: Signals, column: str | None) -> ControlTrace:
    """The last group of the log once more, whole, with its following error: of ``column``, else found by its name.

    E = command - position. Where no column is called like it, it is calculated from the commanded position.

    Raises:
        JudgementError: the log can be read only once; a following error of passes that its motion would have to part.
        TraceError: the column is not there.
    """
    if str(log) == STANDARD_INPUT:
        raise JudgementError("a log on standard input can be read only once; give a file")
    trace = read_groups(log, choice, signals)[-1]
    by_motion = signals.synchronous or choice.index_enable is not None
    if column is not None and column != NONE:
        if by_motion:
            raise JudgementError("the following error is read of passes by a group only; leave out --following-error, "
                                 "or name the group")
        return ControlTrace(trace, following_error=_last(log, replace(choice, position=column), signals))
    if column == NONE or by_motion or signals.screw_lead is not None or signals.position_wrap:
        return ControlTrace(trace)
    chosen = chosen_columns(log, choice)
    named = replace(choice, angle=str(chosen.angle + 1), group=None if chosen.group is None else str(chosen.group + 1))
    if chosen.following_error is not None:
        remark(f"note: following error by its name: {printable(repr(chosen.following_error))}")
        unit = None if unit_of(chosen.following_error) else choice.position_unit
        return _checked(trace, _last(log, replace(named, position=chosen.following_error, position_unit=unit), signals))
    if chosen.command is not None:
        remark(f"note: following error from the command by its name: {printable(repr(chosen.command))}")
        command = _last(log, replace(named, position=chosen.command), signals)
        return _checked(trace, command - trace.position if command.shape == trace.position.shape else command)
    return ControlTrace(trace)


def _last(log: Path, choice: ColumnChoice, signals: Signals) -> FloatArray:
    return read_groups(log, choice, signals)[-1].position


def _checked(trace: Trace, error: FloatArray) -> ControlTrace:
    """With what was found by its name, where it has a value for every sample."""
    if error.shape != trace.position.shape:
        remark("note: the following error is not taken: it has another number of samples")
        return ControlTrace(trace)
    return ControlTrace(trace, following_error=error)
