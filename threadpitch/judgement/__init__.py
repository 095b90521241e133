"""Nominal and measured pitches of a thread -> where its fluctuation comes from."""

from threadpitch.judgement.alignment import MeasuredThread
from threadpitch.judgement.control import ControlParts, ControlTrace, ExpectedLag, control_document, control_parts
from threadpitch.judgement.judging import judge, together
from threadpitch.judgement.verdict import Evidence, JudgementError, Part, Verdict, read_verdict, verdict_document
from threadpitch.judgement.within_turn import drunkenness, within_turn

__all__ = ["ControlParts", "ControlTrace", "Evidence", "ExpectedLag", "JudgementError", "MeasuredThread", "Part",
           "Verdict", "control_document", "control_parts", "drunkenness", "judge", "read_verdict", "together",
           "verdict_document", "within_turn"]
