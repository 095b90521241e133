"""A dry check: what a system is made of, in which order it runs, and everything that is wrong with it, all at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from threadpitch.cosim.check import check
from threadpitch.cosim.description import FmuDescription
from threadpitch.cosim.errors import CosimError
from threadpitch.cosim.fmus import opened
from threadpitch.cosim.plan import Link, Plan
from threadpitch.cosim.ssp import Locate, read_with_problems
from threadpitch.cosim.system import System, SystemStructureError
from threadpitch.cosim.values import Given


@dataclass(frozen=True)
class Survey:
    """What ``survey`` found. ``plan`` is None where there are ``problems``; ``system`` where it could not be read.

    ``fmus`` tells by component what its FMU says of itself. ``feedthrough`` are the loops of direct dependence: each
    the variables of an algebraic loop, in the order of the data. ``cut`` are the links that run backwards in the order
    and so bring values of the step before, in a run component by component.
    """

    system: System | None = None
    fmus: Mapping[str, FmuDescription] | None = None
    plan: Plan | None = None
    problems: tuple[str, ...] = ()
    feedthrough: tuple[tuple[str, ...], ...] = ()
    cut: tuple[Link, ...] = ()


def survey(path: str | Path, parameters: Mapping[str, Given] | None = None, *, locate: Locate | None = None,
           replace: Mapping[str, str | Path] | None = None) -> Survey:
    """Read a system, open its FMUs and check all, without running anything; what is wrong is in ``problems``."""
    try:
        system, problems = read_with_problems(path, locate=locate, replace=replace)
    except CosimError as error:
        return Survey(problems=_all(error))
    with system, opened(system) as fmus:
        try:
            plan = check(system, fmus.descriptions, parameters, (*problems, *fmus.problems))
        except SystemStructureError as error:
            return Survey(system, fmus.descriptions, problems=error.problems)
        return Survey(system, fmus.descriptions, plan, (), feedthrough_loops(plan), cut_links(plan))


def cut_links(plan: Plan) -> tuple[Link, ...]:
    """The links whose source steps after their target, or with it."""
    rank = {name: number for number, name in enumerate(plan.order)}
    return tuple(link for link in plan.links if rank[link.source_component] >= rank[link.target_component])


def feedthrough_loops(plan: Plan) -> tuple[tuple[str, ...], ...]:
    """The loops in which every output depends directly on an input, as the FMUs' ModelStructure says.

    An output without dependencies there may depend on all inputs. Each loop is given as its variables
    ``component.variable``, beginning with the one that comes first in the system.
    """
    nodes: dict[tuple[str, str], int] = {}

    def number(component: str, variable: str) -> int:
        return nodes.setdefault((component, variable), len(nodes))

    edges = [(number(link.source_component, link.source.name), number(link.target_component, link.target.name))
             for link in plan.links]
    by_component: dict[str, list[tuple[str, int]]] = {}
    for (component, variable), place in nodes.items():
        by_component.setdefault(component, []).append((variable, place))
    for component, joined in by_component.items():
        fmu = plan.descriptions[component]
        inputs = [(name, place) for name, place in joined if fmu.variables[name].causality == "input"]
        for output, giver in joined:
            if fmu.variables[output].causality == "output":
                edges += [(place, giver) for name, place in inputs if name in fmu.dependencies.get(output, (name,))]
    return _loops(list(nodes), edges)


def _loops(nodes: list[tuple[str, str]], edges: list[tuple[int, int]]) -> tuple[tuple[str, ...], ...]:
    rows, columns = (np.array([edge[end] for edge in edges], np.intp) for end in (0, 1))
    graph = coo_array((np.ones(len(edges)), (rows, columns)), shape=(len(nodes), len(nodes)))
    count, labels = connected_components(graph, directed=True, connection="strong")
    found = []
    for label in range(count):
        members = [number for number in range(len(nodes)) if labels[number] == label]
        if len(members) > 1:
            found.append(tuple(".".join(nodes[member]) for member in _along(members, edges)))
    return tuple(found)


def _along(members: list[int], edges: list[tuple[int, int]]) -> list[int]:
    """The members in the order of the data, as far as one walk goes; what branches off follows."""
    inside = set(members)
    following: dict[int, list[int]] = {}
    for giver, taker in edges:
        if giver in inside and taker in inside:
            following.setdefault(giver, []).append(taker)
    walk, waiting = list[int](), [members[0]]
    while waiting:
        member = waiting.pop()
        if member not in walk:
            walk.append(member)
            waiting += reversed(following.get(member, []))
    return walk


def _all(error: CosimError) -> tuple[str, ...]:
    return error.problems if isinstance(error, SystemStructureError) else (str(error),)
