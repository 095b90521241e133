"""Nested blocks laid flat: every input of a component traced back, through the connectors of systems, to its source."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TypeAlias

from threadpitch.cosim.ssp.block import Block, End, Reference, Wire
from threadpitch.cosim.system import Component, Connection, Connector, Passage, Transformation, nearest

Node: TypeAlias = tuple[str, str]  # the full name of a component, system or reference, and a connector of it
Signal: TypeAlias = tuple[str, str]  # the full name of a signal dictionary, and an entry of it

_GIVING = ("output", "calculatedParameter", "local", "constant")  # of elements; of the system around them these take
_TAKING = ("input", "parameter", "structuralParameter")


@dataclass(frozen=True)
class Feed:
    """A wire whose way is known: who gives, who takes, and what is done with the values in between."""

    giver: Node
    giver_indices: tuple[int, ...]
    taker: Node
    taker_indices: tuple[int, ...]
    transformation: Transformation
    origin: str


@dataclass
class Survey:
    """All that a block and those in it hold, under full names.

    ``passed`` are the connectors of systems and of references, ``listed`` the kinds of components' connectors,
    ``signals`` what the references' connectors carry.
    """

    components: list[Component] = field(default_factory=list)
    connectors: list[Connector] = field(default_factory=list)
    elements: set[str] = field(default_factory=set)
    passed: dict[Node, Connector] = field(default_factory=dict)
    listed: dict[Node, str] = field(default_factory=dict)
    signals: dict[Node, Signal] = field(default_factory=dict)
    feeds: list[Feed] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)

    def enter(self, block: Block, prefix: str, sight: Mapping[str, Mapping[Signal, Connector]]) -> None:
        """Note what a block holds; ``sight`` are the signal dictionaries of the blocks around it, by name."""
        own = prefix.rstrip(".")
        for connector in block.connectors:
            self.passed[own, connector.name] = connector
            self.connectors.append(replace(connector, name=prefix + connector.name))
        sight = {**sight, **{name: {(prefix + name, entry.name): entry for entry in entries.values()}
                             for name, entries in block.dictionaries.items()}}
        for element in block.elements:
            if isinstance(element, Component):
                self.elements.add(element.name)
                self.components.append(element)
                self.listed |= {(element.name, connector.name): connector.kind for connector in element.connectors}
            elif isinstance(element, Block):
                self.elements.add(prefix + element.name)
                self.enter(element, f"{prefix}{element.name}.", sight)
            else:
                self.elements.add(prefix + element.name)
                self._refer(element, prefix, sight)
        for wire in block.wires:
            self._orient(wire, prefix)

    def _refer(self, reference: Reference, prefix: str, sight: Mapping[str, Mapping[Signal, Connector]]) -> None:
        """Join the connectors of a reference to the signals of the nearest dictionary of that name."""
        if reference.dictionary not in sight:
            self.problems.append(f"{reference.origin}: no signal dictionary {reference.dictionary!r}"
                                 f"{nearest(reference.dictionary, sight)}")
            return
        entries = {signal[1]: (signal, entry) for signal, entry in sight[reference.dictionary].items()}
        for connector in reference.connectors:
            if connector.name not in entries:
                self.problems.append(f"{reference.origin}: signal dictionary {reference.dictionary!r} has no signal "
                                     f"{connector.name!r}{nearest(connector.name, entries)}")
                continue
            signal, entry = entries[connector.name]
            node = prefix + reference.name, connector.name
            self.signals[node] = signal
            self.passed[node] = connector if connector.unit or not entry.unit else replace(
                connector, unit=entry.unit, definition=entry.definition)

    def _orient(self, wire: Wire, prefix: str) -> None:
        """Find out which way the data of a wire go: the connectors' kinds tell, not start and end."""
        giver, taker = wire.start, wire.end
        for end in (giver, taker):
            node = _node(end, prefix)
            if node not in self.passed and (not end.element or self._is_system(node[0])):
                names = [name for owner, name in self.passed if owner == node[0]]
                owner = f"system {node[0]!r}" if node[0] else "the system"
                self.problems.append(f"{wire.origin}: {owner} lists no connector {end.connector!r}"
                                     f"{nearest(end.connector, names)}")
                return
        ways = self._gives(giver, prefix), self._gives(taker, prefix)
        variables = all(_node(end, prefix) not in self.passed for end in (giver, taker))  # which ``check`` looks at
        if ways[0] is not None and ways[0] == ways[1] and not variables:
            self.problems.append(f"{wire.origin}: {_text(giver)} and {_text(taker)} both "
                                 f"{'give' if ways[0] else 'take'} data; connect one that gives with one that takes")
            return
        if ways[0] != ways[1] and (ways[0] is False or ways[1] is True):
            giver, taker = taker, giver
        self.feeds.append(Feed(_node(giver, prefix), giver.indices, _node(taker, prefix), taker.indices,
                               wire.transformation, wire.origin))

    def _is_system(self, name: str) -> bool:
        return name in self.elements and not any(component.name == name for component in self.components)

    def _gives(self, end: End, prefix: str) -> bool | None:
        """Whether data come out of a connector, seen from inside of its system; None where nothing tells."""
        node = _node(end, prefix)
        kind = self.passed[node].kind if node in self.passed else self.listed.get(node, "")
        if kind not in (*_GIVING, *_TAKING):
            return None
        return (kind in _GIVING) == bool(end.element)


class Flat:
    """The flat system: ``components``, ``connectors`` and ``connections()``; ``problems`` tells what cannot be."""

    def __init__(self, block: Block) -> None:
        self._survey = Survey()
        self._survey.enter(block, "", {})
        self.components = tuple(self._survey.components)
        self.connectors = tuple(self._survey.connectors)
        self.problems = self._survey.problems
        self._into: dict[Node | Signal, list[Feed]] = {}
        for feed in self._survey.feeds:
            self._into.setdefault(self._survey.signals.get(feed.taker, feed.taker), []).append(feed)

    def connections(self) -> Iterator[Connection]:
        """From variable to variable; and from every connector of a system on the way, for values that are set there."""
        for feed in self._survey.feeds:
            if feed.taker not in self._survey.passed or not feed.taker[0]:
                yield from self._traced(feed)

    def _traced(self, last: Feed) -> Iterator[Connection]:
        """What reaches the end of a wire, from the nearest connector back to where the values come from."""
        feed, through, seen = last, list[Passage](), {last.taker}
        indices = feed.giver_indices
        while True:
            connector = self._survey.passed.get(feed.giver)
            start = feed.giver if connector is None else ("", ".".join(filter(None, feed.giver)))
            if feed.giver not in self._survey.signals:
                way = feed.transformation
                yield Connection(*start, *last.taker, way.factor, way.offset, way.convert_units, way.table,
                                 tuple(through), indices, last.taker_indices)
            if connector is None:
                return
            if feed.giver in seen:
                self.problems.append(f"{last.origin}: the data of {'.'.join(last.taker)} run in a circle through "
                                     f"{'.'.join(filter(None, feed.giver))}, which no component feeds")
                return
            seen.add(feed.giver)
            before = self._before(feed, indices)
            if before is None:
                return
            through.insert(0, Passage(connector, feed.transformation))
            indices = before.giver_indices or (() if before.taker_indices else indices)
            feed = before

    def _before(self, feed: Feed, indices: tuple[int, ...]) -> Feed | None:
        """What feeds the connector that a wire begins at, or the element of it that is asked for."""
        found = self._into.get(self._survey.signals.get(feed.giver, feed.giver), [])
        name = ".".join(filter(None, feed.giver))
        single = [one for one in found if one.taker_indices]
        if single and not indices:
            self.problems.append(f"{feed.origin}: the elements of {name} come from several connections; connect them "
                                 "one by one behind it too")
            return None
        if single:
            found = [one for one in found if one.taker_indices == indices]
        if len(found) > 1:
            self.problems.append(f"{found[1].origin}: connector {name} is fed already by "
                                 f"{'.'.join(filter(None, found[0].giver))}; a connector takes one connection")
            return None
        return found[0] if found else None


def _node(end: End, prefix: str) -> Node:
    return (prefix + end.element if end.element else prefix.rstrip("."), end.connector)


def _text(end: End) -> str:
    return f"{end.element}.{end.connector}".lstrip(".")
