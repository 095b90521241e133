"""Coordinates for drawing a cycle: how the tool is fed in, pass by pass, and the path it takes. No plotting here."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from threadpitch.cycles.moves import TURN, Feed, Move, Pass, Rapid, Thread, ThreadPath, Wait
from threadpitch.cycles.multiple import G76Cycle, pass_depths

FloatArray = NDArray[np.float64]
_SAME_TURN = 1e-6  # of a turn: a block that ends there begins the next without a further turn
_LOCUS_POINTS = 33  # of one block


@dataclass(frozen=True, eq=False)
class InfeedScheme:
    """Cross section of the groove: the tool's outline in every pass, seen along the thread.

    ``offset`` counts along Z from B towards the end of the thread, ``depth`` from the top of the thread; m. The
    outline is flank, tip, flank: it opens by depth tan(a / 2) to both sides of its tip at depth 0.
    """

    offset: FloatArray  # (passes, 3)
    depth: FloatArray  # (passes, 3)
    kinds: tuple[str, ...]


def infeed_scheme(cycle: G76Cycle) -> InfeedScheme:
    """tip offset = depth tan(a / 2): the flank behind the tool stays where it is, the other one is cut."""
    cuts = pass_depths(cycle.infeed, cycle.height)
    depth = np.array([deep for _, deep in cuts])  # (passes,)
    half_width = depth * math.tan(cycle.tool_angle / 2.0)  # (passes,)
    offset = half_width[:, None] + half_width[:, None] * np.array([-1.0, 0.0, 1.0])
    return InfeedScheme(offset, depth[:, None] * np.array([0.0, 1.0, 0.0]), tuple(kind for kind, _ in cuts))


def groove_locus(one: Pass) -> tuple[FloatArray, FloatArray]:
    """Spindle angle from the one-turn signal (rad, counted on) and z (m) of a pass, (points,) each: Fig. 3 of the seed.

    way = lead n + lead_change n^2 / 2,  n turns since the block's line began. A block that waits begins at its start
    angle, counted on by whole turns; the tool stands until then.
    """
    angles: list[float] = []
    positions: list[float] = []
    reached = one.paths[0].start_angle
    for path in one.paths:
        if path.wait is not Wait.NONE:
            reached = path.start_angle + TURN * math.ceil((reached - path.start_angle) / TURN - _SAME_TURN)
        turned = np.linspace(0.0, path.turns, _LOCUS_POINTS)  # (_LOCUS_POINTS,)
        way = path.lead * turned + 0.5 * path.lead_change * turned**2
        share = way / path.length if path.length > 0.0 else way
        angles += (reached + TURN * turned).tolist()
        positions += (path.start.z + share * (path.leaves_at.z - path.start.z)).tolist()
        reached += TURN * path.turns
    return np.array(angles), np.array(positions)


@dataclass(frozen=True, eq=False)
class ToolPath:
    """The way of the tool tip as straight pieces between points; x as radius, m."""

    x: FloatArray  # (points,)
    z: FloatArray  # (points,)
    threading: NDArray[np.bool_]  # (points - 1,) whether the piece to the next point is cut in step with the spindle
    move: NDArray[np.int64]  # (points - 1,) index of the move that makes the piece


def tool_path(moves: Sequence[Move]) -> ToolPath:
    """The pieces of all moves, from the first place that is known in both axes; a run-out is a piece of its own."""
    points: list[tuple[float, float]] = []
    threading: list[bool] = []
    index: list[int] = []
    for number, move in enumerate(moves):
        for point in _corners(move):
            points.append(point)
            threading.append(isinstance(move, Thread))
            index.append(number)
        if isinstance(move, Thread) and len(points) == len(_corners(move)):
            points.insert(0, (move.path.start.x, move.path.start.z))
            threading.insert(0, False)
            index.insert(0, number)
    coordinates = np.array(points).reshape(-1, 2)
    return ToolPath(coordinates[:, 0], coordinates[:, 1], np.array(threading[1:], dtype=bool),
                    np.array(index[1:], dtype=np.int64))


def _corners(move: Move) -> list[tuple[float, float]]:
    """The points that a move leads to."""
    if isinstance(move, Rapid):
        return [] if move.x is None or move.z is None else [(move.x, move.z)]
    if isinstance(move, Feed):
        return [(move.end.x, move.end.z)]
    if isinstance(move, Thread):
        return _thread_corners(move.path)
    return []


def _thread_corners(path: ThreadPath) -> list[tuple[float, float]]:
    corners = [] if path.run_out is None else [(path.leaves_line_at.x, path.leaves_line_at.z)]
    return [*corners, (path.leaves_at.x, path.leaves_at.z)]
