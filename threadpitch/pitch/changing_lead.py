"""Threads whose lead changes, as after G34 with its F and K (or R): what the movement of each turn should be.

From where the lead is ``lead`` on, x turns, and o turns to where n = 1 of a start angle begins:

    xi(x) = lead x + change x^2 / 2
    P(n)  = lead + change (n - 1/2 + o)
"""

from __future__ import annotations

import numpy as np

from threadpitch.pitch.table import PitchError, PitchTable
from threadpitch.trace import TURN, FloatArray
from threadpitch.units import from_si


def first_lead(table: PitchTable, lead: float, change: float, begins: float) -> float:
    """The lead, m, where n = 1 of the first start angle begins; it is ``lead`` at the angle ``begins``, rad."""
    return lead + change * (float(table.start_angles[0]) + TURN * table.turns_before - begins) / TURN


def leads_of_turns(table: PitchTable, first: float, change: float) -> FloatArray:
    """(start_angles, revolutions) m, from the lead ``first`` on where n = 1 of the first start angle begins.

    Raises:
        PitchError: the lead falls to nothing within the turns.
    """
    behind = (table.start_angles - table.start_angles[0]) / TURN  # (start_angles,) turns
    leads = first + change * (behind[:, np.newaxis] + np.arange(table.pitch.shape[1]) + 0.5)
    if change and not (leads > 0.0).all():
        raise PitchError(f"with {from_si(change, 'mm'):g} mm a turn the lead falls to nothing within "
                         f"{table.pitch.shape[1]} turns; give a smaller --lead-change")
    return np.asarray(leads)
