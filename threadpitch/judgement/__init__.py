"""Nominal and measured pitches of a thread -> where its fluctuation comes from."""

from threadpitch.judgement.alignment import MeasuredThread
from threadpitch.judgement.control import ControlTrace, ExpectedLag, Turns, control_parts, control_parts_of
from threadpitch.judgement.control_found import ControlParts, control_document, control_documents, control_lines
from threadpitch.judgement.judging import judge, together
from threadpitch.judgement.verdict import Evidence, JudgementError, Part, Verdict, read_verdict, verdict_document
from threadpitch.judgement.within_turn import drunkenness, within_turn
from threadpitch.judgement.wording import within_turn_line

__all__ = ["ControlParts", "ControlTrace", "Evidence", "ExpectedLag", "JudgementError", "MeasuredThread", "Part",
           "Turns", "Verdict", "control_document", "control_documents", "control_lines", "control_parts",
           "control_parts_of", "drunkenness", "judge", "read_verdict", "together", "verdict_document", "within_turn",
           "within_turn_line"]
