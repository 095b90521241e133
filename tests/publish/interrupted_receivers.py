"""Receivers that are killed: ``python -m tests.publish.interrupted_receivers --kills 5`` prints what arrived.

A writer appends events to a store, a sender brings them to a real mosquitto with persistence, and a receiver in a
process of its own takes them from there. Meanwhile, at random moments, the receiver (kill -9), the broker (SIGTERM, or
kill -9, after which it has forgotten what it did not write) or the sender is ended and started again. At the end every
value must have arrived once, in order.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tests.publish.mqtt_receiver import PREFIX
from threadpitch.publish.address import read_receiver
from threadpitch.publish.mqtt import MqttSender
from threadpitch.publish.outbox import Outbox
from threadpitch.store import NewEvent, Store, open_store

PERIOD = 0.01  # s between two events
LONGEST_LIFE, LONGEST_OUTAGE = 1.0, 0.5  # s
PATIENCE = 60.0  # s until all has arrived
MOSQUITTO = shutil.which("mosquitto", path=os.environ.get("PATH", "") + ":/usr/sbin")


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


class Broker:
    """mosquitto with persistence, as a plant runs it."""

    def __init__(self, folder: Path, lines: str = "allow_anonymous true\n", port: int | None = None) -> None:
        self.port = free_port() if port is None else port
        self._folder = folder
        self._process: subprocess.Popen[bytes] | None = None
        user = f"user {'root' if os.getuid() == 0 else os.environ.get('USER', 'nobody')}\n"
        (folder / "mosquitto.conf").write_text(
            f"listener {self.port} 127.0.0.1\npersistence true\npersistence_location {folder}/\n"
            f"autosave_interval 1\nautosave_on_changes true\nmax_queued_messages 0\n{user}{lines}", encoding="utf-8")

    def start(self) -> None:
        """Start it, and wait until it listens."""
        assert MOSQUITTO is not None
        self._process = subprocess.Popen([MOSQUITTO, "-c", self._folder / "mosquitto.conf"],
                                         stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            assert self._process.poll() is None, "mosquitto does not start"
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port), 1.0):
                return
            time.sleep(0.02)

    def end(self, how: signal.Signals) -> None:
        """End it."""
        assert self._process is not None
        self._process.send_signal(how)
        self._process.wait(PATIENCE)


@dataclass
class Plant:
    """A store, a broker, a receiver, and the sender between them."""

    folder: Path
    store: Store
    broker: Broker
    written: list[float] = field(default_factory=list)
    sender: MqttSender | None = None
    receiver: subprocess.Popen[bytes] | None = None

    @property
    def received(self) -> Path:
        """The receiver's file."""
        return self.folder / "received"

    def start_sender(self) -> None:
        """Start the sender, or once more."""
        asked = read_receiver(f"mqtt://127.0.0.1:{self.broker.port}/{PREFIX}?anonymous=yes")
        self.sender = MqttSender(asked, Outbox(self.store, asked.name, from_start=True))

    def start_receiver(self) -> None:
        """Start the receiver, or once more."""
        self.receiver = subprocess.Popen([sys.executable, "-m", "tests.publish.mqtt_receiver", str(self.broker.port),
                                          str(self.received)])

    def kill_receiver(self) -> None:
        """kill -9."""
        assert self.receiver is not None
        self.receiver.kill()
        self.receiver.wait(PATIENCE)

    def write(self, until: threading.Event) -> None:
        """Append events until told to end."""
        while not until.wait(PERIOD):
            value = random.random()
            self.store.append([NewEvent("revolution", {"pitch_mm": value, "machine": "L #1/+", "calculator": "log",
                                                       "start_angle_deg": 0.0})])
            self.written.append(value)

    def interrupt(self) -> str:
        """End one of them at random, and start it again after a while."""
        outage = random.uniform(0.0, LONGEST_OUTAGE)
        chosen = random.choice(("receiver", "receiver", "broker", "broker killed", "sender"))
        if chosen == "receiver":
            self.kill_receiver()
            time.sleep(outage)
            self.start_receiver()
        elif chosen == "sender":
            assert self.sender is not None
            self.sender.close()
            time.sleep(outage)
            self.start_sender()
        else:
            self.broker.end(signal.SIGTERM if chosen == "broker" else signal.SIGKILL)
            time.sleep(outage)
            self.broker.start()
        return chosen

    def arrived(self) -> list[tuple[int, float]]:
        """(sequence, value) in the order of their arrival."""
        lines = self.received.read_text(encoding="ascii").splitlines() if self.received.exists() else []
        return [(int(sequence), float(value)) for sequence, value in map(str.split, lines)]


@contextlib.contextmanager
def plant() -> Iterator[Plant]:
    """A plant that runs."""
    with tempfile.TemporaryDirectory() as name, open_store(str(Path(name) / "runs.db")) as store:
        one = Plant(Path(name), store, Broker(Path(name)))
        one.broker.start()
        one.start_receiver()
        one.start_sender()
        try:
            yield one
        finally:
            assert one.sender is not None
            one.sender.close()
            one.kill_receiver()
            one.broker.end(signal.SIGTERM)


def interrupted(kills: int, seed: int) -> dict[str, object]:
    """What arrived, as figures."""
    random.seed(seed)
    began = time.monotonic()
    with plant() as one:
        ends = threading.Event()
        writer = threading.Thread(target=one.write, args=(ends,))
        writer.start()
        ended = []
        for _ in range(kills):
            time.sleep(random.uniform(0.0, LONGEST_LIFE))
            ended.append(one.interrupt())
        ends.set()
        writer.join()
        deadline = time.monotonic() + PATIENCE
        while len(one.arrived()) < len(one.written) and time.monotonic() < deadline:
            time.sleep(0.1)
        time.sleep(0.5)  # whether something comes twice
        arrived = one.arrived()
        return {"kills": {name: ended.count(name) for name in sorted(set(ended))}, "written": len(one.written),
                "arrived": len(arrived), "once_in_order": arrived == list(enumerate(one.written, start=1)),
                "seconds": round(time.monotonic() - began, 1)}


def main() -> int:
    """Print the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=5)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    found = interrupted(asked.kills, asked.seed)
    print(json.dumps(found))
    return 0 if found["once_in_order"] else 1


if __name__ == "__main__":
    sys.exit(main())
