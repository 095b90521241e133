"""Events reach a real mosquitto: encrypted, by password or certificate, in order, once, whatever is interrupted.

The long variant, with figures: ``python -m tests.benchmarks.bench_receivers``.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote

import jsonschema
import numpy as np
import pytest
from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

from tests.conftest import Command
from tests.publish.certificates import make_identity
from tests.publish.interrupted_receivers import MOSQUITTO, Broker
from threadpitch.pitch import PitchTable
from threadpitch.publish import outlets, wait_until_taken
from threadpitch.runs import Labels, RunEvents
from threadpitch.store import NewRun, StoredPass, open_store

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.skipif(MOSQUITTO is None, reason="needs mosquitto, a package of Debian")
SCHEMA = json.loads((ROOT / "docs" / "messages.schema.json").read_text(encoding="utf-8"))
PATIENCE = 20.0  # s


@contextmanager
def running(broker: Broker) -> Iterator[Broker]:
    broker.start()
    try:
        yield broker
    finally:
        broker.end(signal.SIGTERM)


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    """One that lets everybody in."""
    with running(Broker(tmp_path)) as one:
        yield one


def events_of(machine: str) -> tuple[RunEvents, NewRun]:
    table = PitchTable.of_pitches(1.5e-3 + 1e-6 * np.arange(6.0).reshape(2, 3), [0.0, np.pi])
    events = RunEvents("log", "log.csv", Labels(machine=machine, serial_number="S-1"))
    verdict = {"cause": "none", "sentence": "Nothing is wrong.", "advice": [], "evidence": {}}
    passes = (StoredPass("log", "1", table, 1.5e-3),)
    return events, NewRun(kind="log", source="log.csv", passes=passes, uid=events.uid, serial_number="S-1",
                          verdict=verdict)


def publish_run(store_file: Path, url: str, machine: str = "Lathe 3") -> int:
    """Publish a run; the number of events."""
    with open_store(str(store_file)) as store, outlets([url], store) as ways_out:
        events, run = events_of(machine)
        store.append([events.begin(), *(events.revolution(turn) for turn in events.turns(run)),
                      events.result(run, store.add(run))])
        ways_out[0].notify()
        assert wait_until_taken(ways_out, PATIENCE), ways_out[0].trouble
        return store.last_sequence()


def listen(port: int, found: dict[str, dict[str, Any]], enough: Callable[[], bool]) -> None:
    """Take what is retained, by topic."""
    client = Client(CallbackAPIVersion.VERSION2)

    def on_message(_: Client, __: object, message: MQTTMessage) -> None:
        found.setdefault(message.topic, json.loads(message.payload))

    client.on_message = on_message
    client.connect("127.0.0.1", port)
    client.subscribe("#", qos=1)
    client.loop_start()
    deadline = time.monotonic() + PATIENCE
    while not enough() and time.monotonic() < deadline:
        time.sleep(0.02)
    client.disconnect()
    client.loop_stop()


def test_the_last_values_are_there_for_who_comes_late(broker: Broker, tmp_path: Path) -> None:
    sent = publish_run(tmp_path / "runs.db", f"mqtt://127.0.0.1:{broker.port}/plant?anonymous=yes", "L/1 #+")
    found: dict[str, dict[str, Any]] = {}
    listen(broker.port, found, lambda: len(found) == 5)
    status, machine = (next(topic for topic in found if part in topic) for part in ("/status/", "/begin"))
    assert found.pop(status) == {"state": "offline"}
    assert machine == "plant/L%2F1 %23%2B/begin"  # names make no levels and no wildcards
    prefix = machine.removesuffix("begin")
    assert set(found) == {f"{prefix}{name}" for name in ("begin", "result", "revolution/log/0", "revolution/log/180")}
    assert found[f"{prefix}revolution/log/180"]["turn"] == 3
    assert found[f"{prefix}revolution/log/180"]["pitch_mm"] == pytest.approx(1.505)
    assert found[f"{prefix}result"]["verdict"]["cause"] == "none"
    assert found[f"{prefix}result"]["sequence"] == sent
    for message in found.values():
        jsonschema.validate(message, SCHEMA)


def test_the_schema_refuses_other_messages() -> None:
    for wrong in ({}, {"schema": 1, "event": "revolution", "sequence": 1}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(wrong, SCHEMA)


def test_the_last_will_tells_of_a_sender_that_died(broker: Broker, tmp_path: Path) -> None:
    code = ("import sys, time\nfrom threadpitch.publish import outlets\nfrom threadpitch.store import open_store\n"
            "with open_store(sys.argv[1]) as store, outlets([sys.argv[2]], store):\n    time.sleep(60)")
    sender = subprocess.Popen([sys.executable, "-c", code, tmp_path / "runs.db",
                               f"mqtt://127.0.0.1:{broker.port}/plant?anonymous=yes"], cwd=ROOT)
    seen: list[str] = []
    client = Client(CallbackAPIVersion.VERSION2)
    client.on_message = lambda _, __, message: seen.append(json.loads(message.payload)["state"])
    client.connect("127.0.0.1", broker.port)
    client.subscribe("plant/status/#", qos=1)
    client.loop_start()
    for state in ("online", "offline"):
        deadline = time.monotonic() + PATIENCE
        while state not in seen and time.monotonic() < deadline:
            time.sleep(0.05)
        sender.kill()
    sender.wait()
    client.disconnect()
    client.loop_stop()
    assert seen == ["online", "offline"]


# paho leaves the socket of a handshake that failed to Python, which closes it with a warning
@pytest.mark.filterwarnings("ignore:Exception ignored in. <ssl.SSLSocket:pytest.PytestUnraisableExceptionWarning")
def test_encrypted_with_password_or_certificate(tmp_path: Path) -> None:
    authority = make_identity(tmp_path, "authority", "urn:test:authority")
    server, sender = (make_identity(tmp_path, name, f"urn:test:{name}", authority) for name in ("server", "sender"))
    passwords = tmp_path / "passwords"
    tool = shutil.which("mosquitto_passwd")
    assert tool is not None
    subprocess.run([tool, "-b", "-c", passwords, "plant", "right"], check=True, stderr=subprocess.DEVNULL)
    tls = f"cafile {authority.certificate}\ncertfile {server.certificate}\nkeyfile {server.key}\n"
    ca, own = quote(str(authority.certificate)), f"certificate={quote(str(sender.certificate))}&key={sender.key}"
    with running(Broker(tmp_path, f"{tls}password_file {passwords}\n")) as broker:
        where = f"127.0.0.1:{broker.port}/x?ca={ca}"
        assert publish_run(tmp_path / "a.db", f"mqtts://plant:right@{where}") == 8
        with open_store(str(tmp_path / "a.db")) as store, outlets([f"mqtts://plant:wrong@{where}"], store) as ways_out:
            deadline = time.monotonic() + PATIENCE
            while not ways_out[0].trouble and time.monotonic() < deadline:
                time.sleep(0.02)
            assert "the broker refuses: Not authorized" in ways_out[0].trouble
        with open_store(str(tmp_path / "a.db")) as store, \
                outlets([f"mqtts://plant:right@127.0.0.1:{broker.port}/x"], store) as ways_out:
            while not ways_out[0].trouble and time.monotonic() < deadline:
                time.sleep(0.02)
            assert "CERTIFICATE_VERIFY_FAILED" in ways_out[0].trouble  # an authority that nobody named
    lines = f"{tls}require_certificate true\nuse_identity_as_username true\n"
    with running(Broker(tmp_path, lines)) as broker:
        assert publish_run(tmp_path / "b.db", f"mqtts://127.0.0.1:{broker.port}/x?ca={ca}&{own}") == 8


def test_every_value_arrives_once_in_order_whatever_is_killed() -> None:
    done = subprocess.run([sys.executable, "-m", "tests.publish.interrupted_receivers", "--kills", "5", "--seed", "3"],
                          capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(done.stdout)["written"] > 20


def test_the_commands_publish_while_they_compute(broker: Broker, workplace: Path, threadpitch: Command) -> None:
    log = ROOT / "models" / "logs" / "linuxcnc" / "J_twostart_400.csv.gz"
    url = f"mqtt://127.0.0.1:{broker.port}?anonymous=yes"
    found: dict[str, dict[str, Any]] = {}
    told = threading.Thread(target=listen, args=(broker.port, found, lambda: any("/result" in one for one in found)))
    told.start()
    done = threadpitch("analyze", log, "--store", "runs.db", "--machine", "Lathe 3", "--publish", url, "--json")
    told.join()
    assert (done.status, done.err) == (0, "")
    assert json.loads(done.out)["stored"] == {"run": 1, "store": (workplace / "runs.db").as_posix()}
    result = found["threadpitch/Lathe 3/result"]
    assert (result["run_number"], len(result["statistics"])) == (1, 2)
    assert threadpitch("publish", url, "--store", "runs.db", "--until-empty").status == 0


def test_what_nobody_takes_waits(workplace: Path, threadpitch: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("threadpitch.cli.kept.PATIENCE", 0.3)
    broker = Broker(workplace)
    url = f"mqtt://127.0.0.1:{broker.port}?anonymous=yes"
    log = ROOT / "models" / "logs" / "linuxcnc" / "J_twostart_400.csv.gz"
    done = threadpitch("analyze", log, "--store", "runs.db", "--publish", url)
    assert done.status == 0
    assert "events wait for mqtt://127.0.0.1" in done.err
    waiting = threadpitch("publish", url, "--store", "runs.db", "--until-empty", "--patience", "0.3")
    assert waiting.status == 2
    assert "they stay in the store, is the receiver there?" in waiting.err
    with running(broker):
        assert threadpitch("publish", url, "--store", "runs.db", "--until-empty").status == 0
    assert os.path.exists("mosquitto.db")
