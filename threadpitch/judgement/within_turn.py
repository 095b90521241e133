"""The error within the turn, which P(n) cannot show: what repeats with every turn cancels in it.

    w(n, k) = xi(theta_Sk + 360 n) - xi(theta_S1 + 360 n) - lead (theta_Sk - theta_S1) / 360

Its mean over the turns is the drunken thread: ripple of whole order, eccentricity of the encoder. Of a measured thread
it is told where grooves were probed at several start angles, with their positions along the axis.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from threadpitch.judgement.alignment import MeasuredThread
from threadpitch.pitch import PitchTable
from threadpitch.trace import TURN, FloatArray


def within_turn(table: PitchTable, lead: float) -> FloatArray:
    """w (start_angles, crossings) m of a table with several start angles, positive in the direction of the cut."""
    moved = table.crossings - table.crossings[0]
    steps = np.diff(table.crossings, axis=1)
    sense = np.sign(np.nanmean(steps)) if np.isfinite(steps).any() else 1.0
    return np.asarray(sense * moved - lead * (table.start_angles - table.start_angles[0])[:, np.newaxis] / TURN)


def drunkenness(table: PitchTable, lead: float, turns: tuple[int, int] | None = None) -> float | None:
    """Largest less least mean of w over the turns, m; None where the table has one start angle, or no crossings.

    Over all turns, or from the first to the last of ``turns``: what the start does before the metal is not in the
    thread.
    """
    if table.start_angles.size < 2:
        return None
    error = within_turn(table, lead)
    if turns is not None:
        error = error[:, turns[0] - 1:turns[1] + 1]
    known = ~np.isnan(error)
    if not known.any(axis=1).all():
        return None
    mean = np.sum(error, axis=1, where=known) / known.sum(axis=1)
    return float(mean.max() - mean.min())


def measured_drunkenness(threads: Sequence[MeasuredThread], lead: float) -> tuple[float, float] | None:
    """(largest less least mean of w, m; its standard uncertainty, m, as far as that of the pitches tells it).

    Over the threads of the flank that comes first, at their start angles, with the first of them as theta_S1. None
    where there are less than two angles, or grooves without positions.
    """
    known = [one for one in threads if one.position is not None and one.start_angle is not None
             and one.flank == threads[0].flank and np.isfinite(one.pitch).any()]
    if len({one.start_angle for one in known}) < 2:
        return None
    first = _grooves(known[0])
    sense = -1.0 if first[-1] < first[0] else 1.0
    turns = np.round((first - first[0]) * sense / lead)
    means, fewest = [0.0], first.size
    for one in known[1:]:
        grooves = sense * _grooves(one)
        beside = grooves[(grooves >= (sense * first).min()) & (grooves <= (sense * first).max())]
        if beside.size == 0:
            return None
        order = np.argsort(sense * first)
        apart = ((one.start_angle or 0.0) - (known[0].start_angle or 0.0)) / TURN
        late = np.interp(beside, (sense * first)[order], turns[order]) - apart  # turns; whole but for the error
        means.append(lead * float(np.mean(late - np.round(late))))
        fewest = min(fewest, beside.size)
    uncertainty = 0.0 if known[0].uncertainty is None else float(np.sqrt(np.mean(known[0].uncertainty**2)))
    return max(means) - min(means), uncertainty * float(np.sqrt(2.0 / fewest))


def _grooves(one: MeasuredThread) -> FloatArray:
    """(grooves,) m, where the grooves lie on both sides of every measured pitch, along the axis."""
    known = np.isfinite(one.pitch)
    assert one.position is not None  # of those that are asked for
    middle, half = one.position[known], 0.5 * one.pitch[known]
    sense = -1.0 if middle[-1] < middle[0] else 1.0
    grooves = np.concatenate([middle - sense * half, middle + sense * half])
    return np.asarray(np.unique(np.round(grooves, 9))[::int(sense)])  # to the nanometre: neighbours share a groove
