"""Run-outs amid a chain of threading blocks as blocks of their own, which the controller knows at the end only."""

from __future__ import annotations

import math
from dataclasses import replace

from threadpitch.cycles.moves import TURN, Pass, ThreadPath, Wait


def without_inner_run_outs(one: Pass) -> Pass:
    """The same pass; a path that runs out and is not the last becomes the line up to there and a slanted one."""
    if one.depth is not None:
        return one
    paths: list[ThreadPath] = []
    for path in one.paths[:-1]:
        paths += [path] if path.run_out is None else _parted(path)
    return replace(one, paths=(*paths, one.paths[-1]))


def _parted(path: ThreadPath) -> list[ThreadPath]:
    """lead = sqrt(lead^2 + 2 lead_change length) where the second begins; along X, where that is longer, it has
    |dx / dz| of the lead. Where blocks wait for their angles the second one's is where the first one ends.
    """
    leaves = path.leaves_line_at
    line = replace(path, end=leaves, run_out=None)
    ended = math.fmod(path.start_angle + TURN * line.turns, TURN)
    out = ThreadPath(leaves, path.leaves_at, line.end_lead, ended, wait=Wait.NONE)
    share = 1.0 if out.long_axis == path.long_axis else out.length / _along(out, path.long_axis)
    out = replace(out, lead=out.lead * share, lead_change=path.lead_change * share)
    return [line, out] if line.length > 0.0 else [replace(out, wait=path.wait, start_angle=path.start_angle)]


def _along(path: ThreadPath, axis: str) -> float:
    """Travel along an axis, m."""
    begin, end = (point.z if axis == "z" else point.x for point in (path.start, path.end))
    return abs(end - begin)
