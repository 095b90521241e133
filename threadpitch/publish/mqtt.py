"""Events to an MQTT broker: JSON, QoS 1, retained, with a last will.

    prefix/status/STORE                     {"state": "online", "sequence"}, {"state": "offline"} by the last will
    prefix/MACHINE/begin
    prefix/MACHINE/revolution/CALCULATOR/START_ANGLE
    prefix/MACHINE/result
    prefix/resend                           {"store", "after"}: sent by a receiver that misses something

A message counts as taken when the broker has acknowledged it; until then it stays in the store. After an interruption
everything behind the last acknowledged one is sent again, in order. Names in topics are percent-encoded, so that no
name of a machine makes levels or wildcards.
"""

from __future__ import annotations

import contextlib
import json
import logging
import ssl
import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from threadpitch.publish.address import Receiver
from threadpitch.publish.errors import PublishError
from threadpitch.publish.outbox import Outbox
from threadpitch.store import Event, StoreError
from threadpitch.store.records import new_uid

if TYPE_CHECKING:
    from paho.mqtt.client import Client

GOODBYE = 3.0  # s to leave in
LOOK = 0.2  # s between two looks for new events
PATIENCE = 10.0  # s for a connection, and for the acknowledgement of a batch
PAUSES = (0.2, 0.5, 1.0, 2.0, 5.0)  # s between two tries to connect
KEEP_ALIVE = 20  # s
_log = logging.getLogger(__name__)


class MqttSender:
    """A thread that brings the events of an outbox to a broker, until it is closed.

    Raises (the class itself):
        PublishError: paho-mqtt is missing, or a certificate cannot be read.
    """

    def __init__(self, receiver: Receiver, outbox: Outbox) -> None:
        self.receiver, self.outbox = receiver, outbox
        self.trouble = ""  # why nothing gets through at the moment
        self._refused = ""
        self._paho = _paho()
        self._tls = _tls(receiver)
        self._wish: int | None = None  # a sequence behind which all is wanted again
        self._ends = threading.Event()
        self._news = threading.Event()
        self._thread = threading.Thread(target=self._work, name="mqtt", daemon=True)
        self._thread.start()

    def notify(self) -> None:
        """There are new events."""
        self._news.set()

    def behind(self) -> int:
        """How many events wait."""
        return self.outbox.behind()

    def close(self) -> None:
        """Leave the broker in order; what it has not taken stays in the store."""
        self._ends.set()
        self._news.set()
        self._thread.join(GOODBYE)

    def _work(self) -> None:
        tries = 0
        while not self._ends.is_set():
            client = self._client()
            try:
                self._connect(client)
                tries = 0
                self._send(client)
            except (OSError, ValueError, RuntimeError, StoreError) as error:
                self.trouble = self._refused or " ".join(str(error).split())
                _log.info("%s: %s", self.receiver.name, self.trouble)
            finally:
                with contextlib.suppress(OSError, ValueError, RuntimeError):
                    client.disconnect()
                client.loop_stop()
                if (connection := client.socket()) is not None:  # paho leaves that of a refused connection open
                    connection.close()
            self._ends.wait(PAUSES[min(tries, len(PAUSES) - 1)])
            tries += 1

    def _client(self) -> Client:
        """A new client for every connection: what a former one has not got through is sent anew, from the store."""
        mqtt = self._paho
        client: Client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, client_id=f"threadpitch-{new_uid()[:12]}",
                                     reconnect_on_failure=False)
        client.connect_timeout = PATIENCE
        if self.receiver.user is not None:
            client.username_pw_set(self.receiver.user, self.receiver.password)
        if self._tls is not None:
            client.tls_set_context(self._tls)
        client.will_set(self._status_topic, _json({"state": "offline"}), qos=1, retain=True)
        return client

    def _connect(self, client: Client) -> None:
        answered = threading.Event()

        def on_connect(_: Client, __: object, ___: object, reason: Any, ____: object) -> None:
            self._refused = f"the broker refuses: {reason}" if reason.is_failure else ""
            answered.set()

        client.on_connect = on_connect
        client.on_message = lambda _, __, message: self._hear(message.payload, message.retain)
        client.connect(self.receiver.host, self.receiver.port, keepalive=KEEP_ALIVE)
        client.loop_start()
        if not answered.wait(PATIENCE) or self._refused or not client.is_connected():
            raise OSError("the broker does not answer")
        client.subscribe(f"{self.receiver.prefix}/resend", qos=1)
        # With the sequence: a broker that was killed may have lost what it had acknowledged, and who listens sees it.
        self._deliver(client, self._status_topic, {"state": "online", "sequence": self.outbox.taken()})
        self.trouble = ""

    def _send(self, client: Client) -> None:
        while not self._ends.is_set():
            if not client.is_connected():
                raise OSError("the broker has left")
            wish, self._wish = self._wish, None
            if wish is not None:
                self.outbox.rewind(wish)
            events = self.outbox.waiting()
            sent = [client.publish(self._topic(event), _json(self.outbox.message(event)), qos=1, retain=True)
                    for event in events]
            for event, one in zip(events, sent, strict=True):
                one.wait_for_publish(PATIENCE)
                if not one.is_published():
                    raise OSError(f"the broker does not acknowledge event {event.sequence}")
            if events:
                self.outbox.acknowledge(events[-1].sequence)
            else:
                self._news.wait(LOOK)
                self._news.clear()
        self._deliver(client, self._status_topic, {"state": "offline"})

    def _deliver(self, client: Client, topic: str, document: Mapping[str, Any]) -> None:
        sent = client.publish(topic, _json(document), qos=1, retain=True)
        sent.wait_for_publish(PATIENCE)

    def _hear(self, payload: bytes | bytearray, retained: bool) -> None:
        """Somebody wants events again; whatever else this is, it is nobody."""
        with contextlib.suppress(ValueError, TypeError, RecursionError):
            asked = json.loads(payload)
            after = asked["after"] if isinstance(asked, dict) and asked.get("store") == self.outbox.identity else None
            if type(after) is int and after >= 0 and not retained:
                self._wish = after if self._wish is None else min(after, self._wish)
                self._news.set()

    @property
    def _status_topic(self) -> str:
        return f"{self.receiver.prefix}/status/{self.outbox.identity}"

    def _topic(self, event: Event) -> str:
        parts = [self.receiver.prefix, _level(event.document.get("machine")), _level(event.kind)]
        if event.kind == "revolution":
            parts += [_level(event.document.get("calculator")), _level(f"{event.document.get('start_angle_deg'):g}")]
        return "/".join(parts)


def _level(name: object) -> str:
    """A level of a topic; "-" where there is no name."""
    return quote(str(name or "-"), safe=" ")


def _json(document: Mapping[str, Any]) -> str:
    return json.dumps(document, allow_nan=False)


def _paho() -> Any:
    try:
        import paho.mqtt.client
    except ImportError:
        raise PublishError("MQTT needs paho-mqtt, which is not installed; pip install 'threadpitch[mqtt]'") from None
    return paho.mqtt.client


def _tls(receiver: Receiver) -> ssl.SSLContext | None:
    if receiver.scheme != "mqtts":
        return None
    ca, certificate, key = (receiver.file(word) for word in ("ca", "certificate", "key"))
    try:
        context = ssl.create_default_context(cafile=None if ca is None else str(ca))
        if certificate is not None:
            context.load_cert_chain(certificate, key)
    except (OSError, ssl.SSLError) as error:
        raise PublishError(f"{receiver.name}: a certificate or key cannot be read ({error}); give PEM files") from None
    return context
