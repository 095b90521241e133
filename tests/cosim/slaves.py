"""Slaves made of a function: masters are tested without FMUs."""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from threadpitch.cosim.block import Channel
from threadpitch.cosim.check import Link
from threadpitch.cosim.description import FmuDescription
from threadpitch.cosim.instance import Polynomials, References, Transfer, Values
from threadpitch.cosim.method import Method
from threadpitch.cosim.network import Network
from threadpitch.cosim.recording import Recorder
from threadpitch.cosim.schedule import Schedule
from threadpitch.cosim.state_slot import SerializedSlot, Slot
from threadpitch.cosim.variable import FmuVariable
from threadpitch.units import Unit

State = dict[str, float]  # every variable by name
Step = Callable[[State, float, float], None]


def variable(name: str, causality: str = "output", type_: str = "Real", unit: str | None = None,
             **more: object) -> FmuVariable:
    return FmuVariable(name, zlib.crc32(name.encode()), type_, causality, unit,
                       settable=causality in ("input", "parameter"), **more)  # type: ignore[arg-type]


def description(*variables: FmuVariable, units: Mapping[str, Unit] | None = None,
                once_per_process: bool = False) -> FmuDescription:
    return FmuDescription(Path("Test.fmu"), Path(), "", "", {found.name: found for found in variables}, units or {},
                          once_per_process=once_per_process)


class FunctionInstance:
    """An instance whose step is ``function(state, time, step_size)``; ``calls`` tells what the master did to it."""

    def __init__(self, name: str, function: Step, variables: Sequence[FmuVariable], **start: float) -> None:
        self.name = name
        self.function = function
        self.state: State = {found.name: 0.0 for found in variables} | start
        self.calls: list[str] = []
        self._names = {(found.c_type, found.reference): found.name for found in variables}

    def setter(self, c_type: str, references: References, values: Values) -> Transfer:
        names = [self._names[c_type, int(reference)] for reference in references]

        def transfer() -> None:
            self.state.update(zip(names, values.tolist(), strict=True))

        return transfer

    def getter(self, c_type: str, references: References, values: Values) -> Transfer:
        names = [self._names[c_type, int(reference)] for reference in references]

        def transfer() -> None:
            if "exit" not in self.calls:
                self.function(self.state, 0.0, 0.0)
            values[:] = [self.state[name] for name in names]

        return transfer

    def follower(self, c_type: str, references: References, polynomials: Polynomials) -> Transfer:
        """The function finds value and derivatives at the step's beginning in ``u``, ``u'`` and ``u''``."""
        names = [self._names[c_type, int(reference)] for reference in references]

        def transfer() -> None:
            self.state.update(zip(names, polynomials.values.tolist(), strict=True))
            for order, derivatives in enumerate(polynomials.derivatives.tolist(), 1):
                self.state.update(zip((name + "'" * order for name in names), derivatives, strict=True))

        return transfer

    def set_text(self, reference: int, text: str) -> None:
        self.calls.append(f"text {text}")

    def setup_experiment(self, start_time: float) -> None:
        self.calls.append(f"setup {start_time}")

    def enter_initialization(self) -> None:
        self.calls.append("enter")

    def exit_initialization(self) -> None:
        self.calls.append("exit")

    def do_step(self, time: float, step_size: float) -> None:
        self.function(self.state, time, step_size)

    def save_state(self) -> bytes:
        return json.dumps([self.state, self.calls]).encode()

    def load_state(self, serialized: bytes) -> None:
        self.state, self.calls = json.loads(serialized)

    def slot(self) -> Slot:
        return SerializedSlot(self)

    def terminate(self) -> None:
        self.calls.append("terminate")

    def free(self) -> None:
        self.calls.append("free")

    def warnings(self) -> tuple[str, ...]:
        return ()


def network(instances: Sequence[FunctionInstance], links: Sequence[Link], record: Sequence[tuple[str, FmuVariable]],
            schedule: Schedule, *, method: Method | None = None, every: int = 1) -> Network:
    return Network(instances, links, Recorder([Channel(name, found) for name, found in record], schedule, every),
                   method)
