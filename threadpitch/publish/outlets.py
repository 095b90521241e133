"""Ways out of the house, by their URL."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Protocol

from threadpitch.publish.address import Receiver, read_receiver
from threadpitch.publish.mqtt import MqttSender
from threadpitch.publish.opcua import OpcUaServer
from threadpitch.publish.outbox import Outbox

if TYPE_CHECKING:
    from threadpitch.store import Store


class Outlet(Protocol):
    """Something that brings events of a store out, in a thread of its own."""

    receiver: Receiver
    trouble: str  # why nothing gets through at the moment; empty = nothing is wrong

    def notify(self) -> None:
        """There are new events."""

    def behind(self) -> int:
        """How many events wait."""

    def close(self) -> None:
        """End; what waits stays in the store."""


@contextmanager
def outlets(urls: Sequence[str], store: Store, *, from_start: bool = False) -> Iterator[list[Outlet]]:
    """Outlets to all URLs. ``from_start``: a receiver that is new gets all events that the store has, else new ones.

    Raises:
        PublishError: a URL cannot be read or lets in what was not asked for; a package or a file is missing.
    """
    receivers = [read_receiver(url) for url in urls]  # all, before anything listens
    with ExitStack() as stack:
        found: list[Outlet] = []
        for receiver in receivers:
            one: Outlet = OpcUaServer(receiver, store) if receiver.scheme == "opc.tcp" else \
                MqttSender(receiver, Outbox(store, receiver.name, from_start=from_start))
            stack.callback(one.close)
            found.append(one)
        yield found


def wait_until_taken(found: Sequence[Outlet], patience: float) -> bool:
    """Whether all events are taken; waits for it so many seconds at most."""
    deadline = time.monotonic() + patience
    while any(one.behind() for one in found):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.05)
    return True
