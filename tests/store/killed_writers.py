"""Writers of a store that are killed: ``python -m tests.store.killed_writers URL --kills 40`` prints what was left.

Four processes add runs with traces, append events and delete runs again, as fast as they can, and tell each thing
that was acknowledged; one of them after the other is ended by kill -9 at a random moment and started anew. Then all
that was acknowledged must be there, bit for bit, and ``verify`` must find nothing wrong.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from threadpitch.pitch import PitchTable
from threadpitch.store import NewEvent, NewRun, RunFilter, Store, StoredPass, open_store

WRITERS = 4
CONTENTS = 6  # of traces, so that many runs share one
LONGEST_LIFE = 0.25  # s until a writer is killed
HOSTILE = "'; DROP TABLE runs; -- ../../etc/passwd \x1b[31m <script>"


def pitches(uid: str) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """What the run of this name must hold: (start_angles, revolutions) m."""
    drawn = np.random.default_rng(int(uid[:12], 16))
    return 1.5e-3 + 1e-6 * drawn.normal(size=(2, 40))


def content(uid: str) -> bytes:
    """The trace of the run of this name."""
    return hashlib.sha256(uid[:1].encode()).digest() * 2000 if int(uid[0], 16) < CONTENTS else uid.encode() * 1000


@dataclass
class Told:
    """What writers have told of."""

    added: dict[str, int] = field(default_factory=dict)  # uid -> number
    deleting: set[int] = field(default_factory=set)  # may be there, or not
    events: set[str] = field(default_factory=set)

    def read(self, lines: str) -> None:
        """Take what one writer has written."""
        for line in lines.splitlines():
            word, uid, number = line.split()
            if word == "added":
                self.added[uid] = int(number)
            elif word == "deleting":
                self.deleting.add(int(number))
            else:
                self.events.add(uid)


def write(address: str, tell: int, seed: int) -> None:
    """Write until killed."""
    random.seed(seed)
    mine: list[int] = []
    with tempfile.NamedTemporaryFile() as file, open_store(address) as store:
        while True:
            done = random.random()
            if done < 0.2:
                event = NewEvent("revolution", {"pitch_mm": random.random()})
                store.append([event])
                os.write(tell, f"event {event.uid} 0\n".encode())
            elif done < 0.3 and mine:
                number = mine.pop()
                os.write(tell, f"deleting - {number}\n".encode())
                store.delete([number])
            else:
                mine.append(_add(store, Path(file.name), tell))


def _add(store: Store, trace: Path, tell: int) -> int:
    uid = random.randbytes(16).hex()
    trace.write_bytes(content(uid))
    table = PitchTable.of_pitches(pitches(uid), [0.0, 1.0])
    number = store.add(NewRun(kind="log", source=HOSTILE, passes=(StoredPass("log", "1", table, 1.5e-3),),
                              trace=trace, uid=uid))
    os.write(tell, f"added {uid} {number}\n".encode())
    return number


class Writer:
    """A process that writes, and what it tells."""

    def __init__(self, address: str, seed: int) -> None:
        self._reading, writing = os.pipe()
        os.set_blocking(self._reading, False)
        self.process = os.fork()
        if self.process == 0:
            try:
                write(address, writing, seed)
            except BaseException:
                traceback.print_exc()
            os._exit(1)
        os.close(writing)
        self._lines = b""

    def listen(self) -> None:
        """Read what has been told so far, that the pipe does not fill."""
        while True:
            try:
                piece = os.read(self._reading, 65536)
            except BlockingIOError:
                return
            if not piece:
                return
            self._lines += piece

    def kill(self) -> str:
        """kill -9; all that it told."""
        os.kill(self.process, signal.SIGKILL)
        _, status = os.waitpid(self.process, 0)
        assert os.WIFSIGNALED(status), f"a writer ended by itself: {status}"
        self.listen()
        os.close(self._reading)
        return self._lines.decode().rpartition("\n")[0]


def kill_writers(address: str, kills: int, seed: int) -> Told:
    """Kill writers at random moments; what they have told of until then."""
    random.seed(seed)
    told = Told()
    _warm_up(address)
    seeds = iter(range(seed, seed + kills + WRITERS))
    writers = [Writer(address, next(seeds)) for _ in range(WRITERS)]
    for _ in range(kills):
        until = time.monotonic() + random.uniform(0.0, LONGEST_LIFE)
        while time.monotonic() < until:
            time.sleep(0.005)
            for writer in writers:
                writer.listen()
        chosen = random.randrange(WRITERS)
        told.read(writers[chosen].kill())
        writers[chosen] = Writer(address, next(seeds))
    for writer in writers:
        told.read(writer.kill())
    return told


def _warm_up(address: str) -> None:
    """What is loaded and compiled at first use is inherited by the writers: they are to write, not to begin."""
    with tempfile.NamedTemporaryFile() as file, open_store(address) as store, open(os.devnull, "wb") as nobody:
        store.delete([_add(store, Path(file.name), nobody.fileno())])


def faults(store: Store, told: Told) -> Iterator[str]:
    """What is not as it was told."""
    there = {one.number: one for one in store.runs(RunFilter(limit=10**9))}
    for uid, number in told.added.items():
        if number in there:
            run = store.run(number)
            if run.summary.uid != uid or run.summary.source != HOSTILE:
                yield f"run {number} is another"
            if not np.array_equal(run.passes[0].table.pitch, pitches(uid)):
                yield f"run {number} has other pitches"
            if run.trace is None or run.trace.read_bytes() != content(uid):
                yield f"run {number} has another trace"
        elif number not in told.deleting:
            yield f"run {number} was acknowledged and is not there"
    events = store.events(limit=10**9)
    if missing := told.events - {one.uid for one in events}:
        yield f"{len(missing)} events were acknowledged and are not there"
    if [one.sequence for one in events] != list(range(1, len(events) + 1)):
        yield "sequences of events have gaps"
    yield from (f"{one.kind}: {one.what}" for one in store.verify() if not one.harmless)


def main() -> int:
    """Kill, look, and print the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("address")
    parser.add_argument("--kills", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    began = time.monotonic()
    told = kill_writers(asked.address, asked.kills, asked.seed)
    with open_store(asked.address) as store:
        found = list(faults(store, told))
        left = store.remove_leftovers()
        found += [one.what for one in store.verify()]
        print(json.dumps({"kills": asked.kills + WRITERS, "writers": WRITERS, "acknowledged_runs": len(told.added),
                          "acknowledged_events": len(told.events), "deletions": len(told.deleting),
                          "runs": store.count(), "leftovers_removed": left, "faults": found,
                          "seconds": round(time.monotonic() - began, 1)}))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
