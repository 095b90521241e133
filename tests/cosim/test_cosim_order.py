from __future__ import annotations

from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from threadpitch.cosim.order import data_order, find_loops

NAMES = "abcdefg"
GRAPHS = st.lists(st.tuples(st.sampled_from(NAMES), st.sampled_from(NAMES)), max_size=20)


def reaches(edges: list[tuple[str, str]], start: str) -> set[str]:
    found: set[str] = set()
    waiting = [start]
    while waiting:
        here = waiting.pop()
        for giver, taker in edges:
            if giver == here and taker not in found:
                found.add(taker)
                waiting.append(taker)
    return found


def test_data_run_forward_whatever_the_order_of_the_file() -> None:
    edges = [("spindle", "controller"), ("controller", "drive"), ("drive", "cutting"), ("cutting", "pitch")]
    names = ["pitch", "cutting", "drive", "controller", "spindle"]
    assert data_order(names, edges) == ("spindle", "controller", "drive", "cutting", "pitch")
    assert find_loops(names, edges) == ()


def test_a_circle_stands_in_the_order_of_the_file() -> None:
    edges = [("a", "b"), ("b", "c"), ("c", "a"), ("c", "sink"), ("source", "b")]
    assert data_order(["sink", "b", "c", "a", "source"], edges) == ("source", "b", "c", "a", "sink")
    assert find_loops(["sink", "b", "c", "a", "source"], edges) == (("b", "c", "a"),)


def test_a_component_that_feeds_itself_is_a_loop() -> None:
    assert find_loops(["a", "b"], [("a", "a"), ("a", "b")]) == (("a",),)


def test_without_connections_the_order_of_the_file_holds() -> None:
    assert data_order(["b", "a", "c"], []) == ("b", "a", "c")


def test_long_chains_do_not_exhaust_the_stack() -> None:
    names = [f"c{number}" for number in range(5000)]
    assert data_order(names[::-1], list(pairwise(names))) == tuple(names)


@settings(deadline=None)
@given(GRAPHS, st.permutations(NAMES))
def test_only_feedback_runs_backwards(edges: list[tuple[str, str]], names: list[str]) -> None:
    order = data_order(names, edges)
    assert sorted(order) == sorted(names)
    for giver, taker in edges:
        circular = giver in reaches(edges, taker) or giver == taker
        if not circular:
            assert order.index(giver) < order.index(taker)
        elif order.index(giver) > order.index(taker):
            assert names.index(giver) > names.index(taker)


@settings(deadline=None)
@given(GRAPHS)
def test_loops_are_what_reaches_itself(edges: list[tuple[str, str]]) -> None:
    inside = {name for loop in find_loops(NAMES, edges) for name in loop}
    assert inside == {name for name in NAMES if name in reaches(edges, name)}
