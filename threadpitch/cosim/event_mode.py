"""FMUs of FMI 3.0 with their event mode: clocks, time events, early return (FMI 3.0.2, 4.2.1)."""

from __future__ import annotations

import ctypes
import math
import struct

from threadpitch.cosim.instance3 import FmuInstance3

_MOST_UPDATES = 100  # of discrete states at one instant: more is a circle
_NEXT_EVENT = struct.Struct("<d")


class EventInstance3(FmuInstance3):
    """An FMU that tells when its discrete states change. ``next_event`` [s] is when it knows that they will."""

    event_mode = True
    next_event = math.inf

    @property
    def returned_early(self) -> float | None:
        """Where the last step ended, if that was before its end."""
        return float(self._reached.value) if self._early.value else None

    def has_event(self, time: float) -> bool:
        """Whether the last step, which ended at this time, ended in an event."""
        return bool(self._event.value) or self.next_event <= time

    def exit_initialization(self) -> None:
        """End initialisation, which leads into the event mode, and leave that."""
        super().exit_initialization()
        self._update()

    def save_state(self) -> bytes:
        """The FMU's state, behind the time of its next event, which it told and does not tell again."""
        return _NEXT_EVENT.pack(self.next_event) + super().save_state()

    def load_state(self, serialized: bytes) -> None:
        """Make the initialised component what it was when these bytes were saved."""
        super().load_state(serialized[_NEXT_EVENT.size:])
        self.next_event, = _NEXT_EVENT.unpack_from(serialized)

    def handle_event(self) -> tuple[str, ...]:
        """Go through the event mode: the names of the clocks that ticked."""
        self.check(self.dll.fmi3EnterEventMode(self.component), "fmi3EnterEventMode failed")
        ticked = tuple(self._ticked())
        self._update()
        return ticked

    def _ticked(self) -> list[str]:
        clocks = [found for found in self.library.description.variables.values()
                  if found.type == "Clock" and found.causality == "output"]
        if not clocks:
            return []
        references = (ctypes.c_uint32 * len(clocks))(*(found.reference for found in clocks))
        values = (ctypes.c_bool * len(clocks))()
        status = self.dll.fmi3GetClock(self.component, references, len(clocks), values)
        self.check(status, "fmi3GetClock failed")
        return [found.name for found, value in zip(clocks, values, strict=True) if value]

    def _update(self) -> None:
        """Update the discrete states until they rest, and go on with steps."""
        again, end, unused, known = (ctypes.c_bool() for _ in range(4))
        time = ctypes.c_double(0.0)
        for _ in range(_MOST_UPDATES):
            status = self.dll.fmi3UpdateDiscreteStates(
                self.component, ctypes.byref(again), ctypes.byref(end), ctypes.byref(unused), ctypes.byref(unused),
                ctypes.byref(known), ctypes.byref(time))
            self.check(status, "fmi3UpdateDiscreteStates failed")
            if not again.value:
                break
        else:
            self.fail(3, f"the discrete states do not rest after {_MOST_UPDATES} updates")
        self.next_event = float(time.value) if known.value else math.inf
        self._event.value = False
        if end.value:
            self._ended.value = True
            self.fail_step(0)
        self.check(self.dll.fmi3EnterStepMode(self.component), "fmi3EnterStepMode failed")
