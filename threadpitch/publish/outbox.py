"""What a receiver has not taken yet, in its order; the store keeps it until the receiver has.

Every message names its store and its sequence. A receiver that drops a sequence that is not above the last one it took
gets every value once, in order, whatever fails on the way.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from threadpitch.store import Event

if TYPE_CHECKING:
    from threadpitch.store import Store

AT_ONCE = 200  # events


class Outbox:
    """The events of a store that go to one receiver. A new receiver begins with the next event."""

    def __init__(self, store: Store, receiver: str, *, from_start: bool = False) -> None:
        self._store, self._receiver = store, receiver
        self.identity = store.identity()
        store.register(receiver, 0 if from_start else None)

    def waiting(self) -> list[Event]:
        """The next events."""
        return self._store.events(self.taken(), AT_ONCE)

    def taken(self) -> int:
        """The last sequence that the receiver has taken."""
        return self._store.taken(self._receiver)

    def behind(self) -> int:
        """How many events wait."""
        return max(0, self._store.last_sequence() - self.taken())

    def acknowledge(self, sequence: int) -> None:
        """The receiver has taken all up to this sequence."""
        self._store.acknowledge(self._receiver, sequence)

    def rewind(self, sequence: int) -> None:
        """The receiver wants all behind this sequence once more, as far as they are kept."""
        self._store.rewind(self._receiver, max(0, min(sequence, self._store.last_sequence())))

    def message(self, event: Event) -> dict[str, Any]:
        """An event as it is sent."""
        return {"schema": 1, "store": self.identity, "sequence": event.sequence, "id": event.uid,
                "time": event.at.isoformat(), "run": event.run, "event": event.kind, **event.document}
