"""Cross-sections of V grooves: a groove reaches from ``low`` to ``high`` along Z at the workpiece's surface.

All flanks have the same angle to the radius, ``flank`` is its tangent. Two such grooves intersect in a third one, from
the larger ``low`` to the smaller ``high``; ``high`` at or below ``low`` is no groove.
"""


def groove_area(low: float, high: float, flank: float) -> float:
    """A = w^2 / (4 tan), w = high - low."""
    width = max(0.0, high - low)
    return 0.25 * width * width / flank


def groove_moment(low: float, high: float, flank: float) -> float:
    """Area times the depth of its centroid: w^3 / (24 tan^2), the centroid lies at a third of the depth w / (2 tan)."""
    width = max(0.0, high - low)
    return width * width * width / (24.0 * flank * flank)


def area_above(low: float, high: float, flank: float, end: float) -> float:
    """Area of the groove at Z above ``end``."""
    if end >= high or high <= low:
        return 0.0
    if end <= low:
        return groove_area(low, high, flank)
    if end >= 0.5 * (low + high):
        return 0.5 * (high - end) * (high - end) / flank
    return groove_area(low, high, flank) - 0.5 * (end - low) * (end - low) / flank


def area_between(low: float, high: float, flank: float, first: float, last: float) -> float:
    """Area of the groove at Z from ``first`` to ``last``: what of it lies in the material."""
    return area_above(low, high, flank, first) - area_above(low, high, flank, last)
