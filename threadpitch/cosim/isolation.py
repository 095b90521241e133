"""Components in processes of their own: an FMU that crashes ends its process, and the run with a named error."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import threadpitch
from threadpitch.cosim.check import Plan
from threadpitch.cosim.errors import StepError
from threadpitch.cosim.instance import Library, Polynomials, References, Transfer, Values
from threadpitch.cosim.pipe import DONE, read, write
from threadpitch.cosim.system import SystemStructureError, nearest

_PATIENCE = 10.0  # s that a process is given to end by itself


def isolated_components(plan: Plan, wanted: bool | Iterable[str]) -> tuple[str, ...]:
    """The components that run in processes of their own: all, none, or those that are named.

    Raises:
        SystemStructureError: a name is none of the system's.
    """
    if isinstance(wanted, bool):
        return plan.order if wanted else ()
    names = [wanted] if isinstance(wanted, str) else list(wanted)
    problems = [f"isolate: no component {name!r}{nearest(name, plan.order)}" for name in names
                if name not in plan.order]
    if problems:
        raise SystemStructureError(*problems)
    return tuple(name for name in plan.order if name in names)


@dataclass(frozen=True)
class IsolatedSlot:
    """A place for the state of an isolated instance."""

    instance: IsolatedInstance
    number: int

    def save(self) -> None:
        """Keep the instance's state, in place of that which was kept before."""
        self.instance.use_slot("save", self.number)

    def restore(self) -> None:
        """Make the instance what it was when its state was kept."""
        self.instance.use_slot("restore", self.number)


class IsolatedInstance:
    """An FMU's instance in a process of its own; every call waits for its answer.

    Raises (the class itself):
        StepError: the FMU cannot be loaded or does not instantiate, or its process ends in the attempt.
    """

    def __init__(self, name: str, library: Library, followed: References) -> None:
        self.name = name
        self._time = 0.0
        self._warnings: tuple[str, ...] = ()
        self._unanswered = False  # a signal interrupted the wait for an answer: none will be waited for any more
        home = str(Path(threadpitch.__file__).parent.parent)
        paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "threadpitch.cosim.worker"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
            start_new_session=True)  # Ctrl-C is meant for the master
        try:
            self._ask("load", name, Library(replace(library.description, temporary=None)), followed)
        except StepError:
            self.free()
            raise

    # Values

    def setter(self, c_type: str, references: References, values: Values) -> Transfer:
        """A call that copies ``values`` (n,) into the variables ``references`` (r,)."""
        number = self._number("bind", "setter", c_type, references, values.size)
        return lambda: self._tell("set", number, values.tobytes())

    def getter(self, c_type: str, references: References, values: Values) -> Transfer:
        """A call that copies the variables ``references`` (r,) into ``values`` (n,)."""
        number = self._number("bind", "getter", c_type, references, values.size)
        raw = values.view("u1")

        def transfer() -> None:
            raw[:] = memoryview(self._ask("get", number))

        return transfer

    def follower(self, c_type: str, references: References, polynomials: Polynomials) -> Transfer:
        """A call that makes the inputs ``references`` (r,) follow polynomials in the next step."""
        number = self._number("follow", c_type, references, *polynomials.derivatives.shape)
        arrays = polynomials.values, polynomials.derivatives, polynomials.start
        return lambda: self._tell("set", number, *(array.tobytes() for array in arrays))

    def set_text(self, reference: int, text: str) -> None:
        """Set a String variable."""
        self._tell("set_text", reference, text)

    # Life

    def setup_experiment(self, start_time: float) -> None:
        """Tell when the run starts, in seconds."""
        self._time = start_time
        self._tell("setup_experiment", start_time)

    def enter_initialization(self) -> None:
        """Begin initialisation."""
        self._tell("enter_initialization")

    def exit_initialization(self) -> None:
        """End initialisation."""
        self._tell("exit_initialization")

    def do_step(self, time: float, step_size: float) -> None:
        """Compute from ``time`` to ``time + step_size``."""
        self._time = time
        self._tell("do_step", time, step_size)

    def save_state(self) -> bytes:
        """All that the component holds between two steps."""
        return self._ask("save_state")

    def load_state(self, serialized: bytes) -> None:
        """Make the initialised component what it was when these bytes were saved."""
        self._tell("load_state", serialized)

    def slot(self) -> IsolatedSlot:
        """A place for the component's state, in its process."""
        return IsolatedSlot(self, int(json.loads(self._ask("new_slot"))))

    def use_slot(self, word: str, number: int) -> None:
        """Save the state into a slot, or restore it."""
        self._tell("use_slot", word, number)

    def terminate(self) -> None:
        """End the run, where the process is still there."""
        if self._answers():
            with contextlib.suppress(StepError):  # one that crashes at the end: the results are there
                self._tell("terminate")

    def free(self) -> None:
        """Free the instance and end its process; what the FMU does then harms nobody."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        if self._unanswered:
            self._process.kill()
        elif self._answers():
            with contextlib.suppress(StepError):
                self._tell("free")
        try:
            self._process.stdin.close()
            self._process.wait(_PATIENCE)
        except (OSError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()
        self._process.stdout.close()

    def warnings(self) -> tuple[str, ...]:
        """What the FMU logged as warnings, as far as is known."""
        if self._answers():
            with contextlib.suppress(StepError):
                self._warnings = tuple(json.loads(self._ask("warnings")))
        return self._warnings

    # Messages

    def _answers(self) -> bool:
        return self._process.poll() is None and not self._unanswered

    def _number(self, *message: Any) -> int:
        return int(json.loads(self._ask(*message)))

    def _tell(self, *message: Any) -> None:
        self._ask(*message)

    def _ask(self, word: str, *arguments: Any) -> bytes:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._unanswered = True
        try:
            write(self._process.stdin, pickle.dumps((word, arguments)))
            answer = read(self._process.stdout)
        except (EOFError, OSError):
            self._crashed()
        self._unanswered = False
        if answer[:1] == DONE:
            return answer[1:]
        message, component, time, status = json.loads(answer[1:])
        raise StepError(message, component=component, time=time, status=status)

    def _crashed(self) -> NoReturn:
        try:
            code = self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        how = f"exit status {code}"
        if code < 0:
            how = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        raise StepError(f"{self.name}: the FMU crashed at t = {self._time:.9g} s ({how}): its process ended",
                        component=self.name, time=self._time, status="crash") from None
