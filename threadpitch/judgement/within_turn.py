"""The error within the turn, which P(n) cannot show: what repeats with every turn cancels in it.

    w(n, k) = xi(theta_Sk + 360 n) - xi(theta_S1 + 360 n) - lead (theta_Sk - theta_S1) / 360

Its mean over the turns is the drunken thread: ripple of whole order, eccentricity of the encoder.
"""

from __future__ import annotations

import numpy as np

from threadpitch.pitch import PitchTable
from threadpitch.trace import TURN, FloatArray


def within_turn(table: PitchTable, lead: float) -> FloatArray:
    """w (start_angles, crossings) m of a table with several start angles, positive in the direction of the cut."""
    moved = table.crossings - table.crossings[0]
    steps = np.diff(table.crossings, axis=1)
    sense = np.sign(np.nanmean(steps)) if np.isfinite(steps).any() else 1.0
    return np.asarray(sense * moved - lead * (table.start_angles - table.start_angles[0])[:, np.newaxis] / TURN)


def drunkenness(table: PitchTable, lead: float) -> float | None:
    """Largest less least mean of w over the turns, m; None where the table has one start angle, or no crossings."""
    if table.start_angles.size < 2:
        return None
    error = within_turn(table, lead)
    known = ~np.isnan(error)
    if not known.any(axis=1).all():
        return None
    mean = np.sum(error, axis=1, where=known) / known.sum(axis=1)
    return float(mean.max() - mean.min())
