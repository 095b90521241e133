"""A plant's receiver: ``python -m tests.publish.mqtt_receiver PORT FILE``; it writes what it takes into a file.

It does what docs/publish.md asks of a receiver, and nothing else: it drops a sequence that is not above the last one,
asks for what is missing, and acknowledges what is on its disk. Uses paho-mqtt, and nothing of this package.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

PREFIX = "plant"


class Receiver:
    """Takes every value once, in order."""

    def __init__(self, port: int, path: Path) -> None:
        lines = path.read_text(encoding="ascii").splitlines() if path.exists() else []
        self.last = int(lines[-1].split()[0]) if lines else 0
        self._file = path.open("a", encoding="ascii")
        self._asked = (0, 0.0)  # behind which sequence, when
        self.client = Client(CallbackAPIVersion.VERSION2, client_id="plant", clean_session=False, manual_ack=True)
        self.client.on_connect = self._on_connect
        self.client.on_message = self._on_message
        self.client.reconnect_delay_set(1, 1)
        self._port = port

    def run(self) -> None:
        """Listen until killed."""
        while True:
            try:
                self.client.connect("127.0.0.1", self._port, keepalive=5)
                break
            except OSError:
                time.sleep(0.1)
        self.client.loop_forever(retry_first_connection=True)

    def _on_connect(self, *_: object) -> None:
        self.client.subscribe(f"{PREFIX}/#", qos=1)

    def _on_message(self, client: Client, _: object, message: MQTTMessage) -> None:
        if not message.topic.endswith("/resend"):
            self._take(json.loads(message.payload), "/status/" in message.topic, message.topic)
        client.ack(message.mid, message.qos)

    def _take(self, document: dict[str, Any], status: bool, topic: str) -> None:
        sequence = document.get("sequence", 0)
        if sequence > self.last + (0 if status else 1):
            self._ask(topic.rpartition("/")[2] if status else document["store"])
        elif sequence == self.last + 1 and not status:
            print(sequence, document["pitch_mm"], file=self._file, flush=True)
            os.fsync(self._file.fileno())
            self.last = sequence

    def _ask(self, store: str) -> None:
        """For all behind the last one; once a second is enough."""
        behind, when = self._asked
        if behind != self.last or time.monotonic() > when + 1.0:
            self._asked = (self.last, time.monotonic())
            self.client.publish(f"{PREFIX}/resend", json.dumps({"store": store, "after": self.last}), qos=1)


if __name__ == "__main__":
    Receiver(int(sys.argv[1]), Path(sys.argv[2])).run()
