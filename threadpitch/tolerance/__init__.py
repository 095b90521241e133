"""Thread designations, their limits after ISO 965-1 and ASME B1.1, and what of them a pitch deviation takes."""

from threadpitch.tolerance.conformity import CONFORM, NOT_CONFORM, NOT_DECIDABLE, PitchConformity, pitch_conformity
from threadpitch.tolerance.designation import Thread, ToleranceError, parse_thread
from threadpitch.tolerance.limits import Limits, external_limits, internal_limits

__all__ = ["CONFORM", "NOT_CONFORM", "NOT_DECIDABLE", "Limits", "PitchConformity", "Thread", "ToleranceError",
           "external_limits", "internal_limits", "parse_thread", "pitch_conformity"]
