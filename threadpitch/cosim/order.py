"""The order in which components are stepped: along the data, and in the SSD's order where the data run in a circle."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Edge = tuple[str, str]  # (component that gives a value, component that takes it)


def data_order(names: Sequence[str], edges: Iterable[Edge]) -> tuple[str, ...]:
    """Every component after those that feed it; deterministic.

    Components that feed each other in a circle (a strongly connected part of the graph) stand together, among
    themselves in the order of ``names``: connections that run backwards in it are the feedback. Where the data leave
    a choice, the order of ``names`` decides.
    """
    edges = tuple(edges)
    part = _parts(names, edges)
    rank = {name: number for number, name in enumerate(names)}
    members: dict[int, list[str]] = {}
    for name in names:
        members.setdefault(part[name], []).append(name)
    following: dict[int, set[int]] = {number: set() for number in members}
    for giver, taker in edges:
        if part[giver] != part[taker]:
            following[part[giver]].add(part[taker])
    waiting = dict.fromkeys(members, 0)
    for takers in following.values():
        for number in takers:
            waiting[number] += 1
    ready = [(rank[members[number][0]], number) for number, count in waiting.items() if count == 0]
    heapq.heapify(ready)
    order: list[str] = []
    while ready:
        _, number = heapq.heappop(ready)
        order += members[number]
        for taker_part in following[number]:
            waiting[taker_part] -= 1
            if waiting[taker_part] == 0:
                heapq.heappush(ready, (rank[members[taker_part][0]], taker_part))
    return tuple(order)


def find_loops(names: Sequence[str], edges: Iterable[Edge]) -> tuple[tuple[str, ...], ...]:
    """The groups of components that feed each other in a circle (or themselves), each in the order of ``names``."""
    edges = tuple(edges)
    part = _parts(names, edges)
    fed_by_itself = {giver for giver, taker in edges if giver == taker}
    groups: dict[int, list[str]] = {}
    for name in names:
        groups.setdefault(part[name], []).append(name)
    return tuple(tuple(group) for group in groups.values() if len(group) > 1 or group[0] in fed_by_itself)


def _parts(names: Sequence[str], edges: Sequence[Edge]) -> dict[str, int]:
    """The strongly connected part that each component belongs to."""
    rank = {name: number for number, name in enumerate(names)}
    rows = np.array([rank[giver] for giver, _ in edges], dtype=np.intp)
    columns = np.array([rank[taker] for _, taker in edges], dtype=np.intp)
    graph = coo_array((np.ones(len(edges)), (rows, columns)), shape=(len(names), len(names)))
    _, labels = connected_components(graph, directed=True, connection="strong")
    return {name: int(label) for name, label in zip(names, labels, strict=True)}
