"""The process of an isolated component: ``python -m threadpitch.cosim.worker``, which ``isolation`` starts.

It obeys commands on standard input and answers on standard output; what the FMU prints goes to standard error.
"""

from __future__ import annotations

import json
import os
import pickle
import select
import threading
from collections.abc import Callable
from typing import IO, Any

import numpy as np

from threadpitch.cosim.c_types import C_TYPES
from threadpitch.cosim.errors import StepError
from threadpitch.cosim.instance import FmuInstance, Library, Polynomials, Transfer, Values
from threadpitch.cosim.instance2 import FmuInstance2
from threadpitch.cosim.instance3 import FmuInstance3
from threadpitch.cosim.pipe import DONE, FAILED, read, write
from threadpitch.cosim.state_slot import Slot


class Server:
    """One instance, and the transfers that were bound to it, by their numbers."""

    def __init__(self) -> None:
        self._instance: FmuInstance
        self._transfers: list[tuple[Transfer, tuple[Values, ...]]] = []
        self._slots: list[Slot] = []

    def answer(self, word: str, arguments: tuple[Any, ...]) -> bytes:
        """Do what was asked for."""
        own: dict[str, Callable[..., bytes]] = {
            "load": self._load, "bind": self._bind, "follow": self._follow, "set": self._set, "get": self._get,
            "new_slot": self._new_slot, "use_slot": self._use_slot}
        if word in own:
            return own[word](*arguments)
        result = getattr(self._instance, word)(*arguments)
        return result if isinstance(result, bytes) else json.dumps(result).encode()

    def _load(self, name: str, library: Library, followed: Values) -> bytes:
        if library.description.fmi == 2:
            self._instance = FmuInstance2(name, library)
        else:
            self._instance = FmuInstance3(name, library, followed)
        return b""

    def _new_slot(self) -> bytes:
        self._slots.append(self._instance.slot())
        return json.dumps(len(self._slots) - 1).encode()

    def _use_slot(self, word: str, number: int) -> bytes:
        getattr(self._slots[number], word)()
        return b""

    def _bind(self, way: str, c_type: str, references: Values, size: int) -> bytes:
        values = np.zeros(size, C_TYPES[c_type].dtype)
        return self._keep(getattr(self._instance, way)(c_type, references, values), values)

    def _follow(self, c_type: str, references: Values, order: int, size: int) -> bytes:
        polynomials = Polynomials(np.zeros(size), np.zeros((order, size)), np.zeros(1))
        transfer = self._instance.follower(c_type, references, polynomials)
        return self._keep(transfer, polynomials.values, polynomials.derivatives, polynomials.start)

    def _keep(self, transfer: Transfer, *arrays: Values) -> bytes:
        self._transfers.append((transfer, arrays))
        return json.dumps(len(self._transfers) - 1).encode()

    def _set(self, number: int, *values: bytes) -> bytes:
        transfer, arrays = self._transfers[number]
        for array, given in zip(arrays, values, strict=True):
            array.reshape(-1).view(np.uint8)[:] = np.frombuffer(given, np.uint8)
        transfer()
        return b""

    def _get(self, number: int) -> bytes:
        transfer, (values,) = self._transfers[number]
        transfer()
        return values.tobytes()


def serve(commands: IO[bytes], answers: IO[bytes]) -> None:
    """Obey until the other side is gone."""
    server = Server()
    while True:
        try:
            word, arguments = pickle.loads(read(commands))  # from the process that started this one
        except EOFError:
            return
        try:
            answer = DONE + server.answer(word, arguments)
        except StepError as error:
            answer = FAILED + json.dumps([error.message, error.component, error.time, error.status]).encode()
        try:
            write(answers, answer)
        except BrokenPipeError:
            return


def end_with_master(commands: int) -> None:
    """End this process when the other side of its commands is gone, although the FMU may never return from a call."""
    if not hasattr(select, "poll"):  # not on Windows
        return
    gone = select.poll()
    gone.register(commands, 0)  # hanging up is told in any case

    def wait() -> None:
        gone.poll()
        os._exit(0)

    threading.Thread(target=wait, daemon=True).start()


def main() -> None:
    """Serve on standard input and output, which the FMU does not get to see."""
    commands, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    end_with_master(commands.fileno())
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)
    serve(commands, answers)
    # Without the destructors of loaded libraries, some of which touch memory that is already freed.
    os._exit(0)


if __name__ == "__main__":
    main()
