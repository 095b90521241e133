"""Nominal and measured pitches of a thread -> where its fluctuation comes from."""

from threadpitch.judgement.alignment import MeasuredThread
from threadpitch.judgement.judging import judge
from threadpitch.judgement.verdict import Evidence, JudgementError, Part, Verdict, verdict_document
from threadpitch.judgement.within_turn import drunkenness, within_turn

__all__ = ["Evidence", "JudgementError", "MeasuredThread", "Part", "Verdict", "drunkenness", "judge",
           "verdict_document", "within_turn"]
