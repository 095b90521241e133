"""The OPC UA server, read by a client of another implementation (node-opcua) in a process of its own.

asyncua's own client shows who is let in by certificates: node-opcua makes its own, asyncua takes the test's.
"""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import socket
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from asyncua import Client, ua
from asyncua.crypto.security_policies import SecurityPolicyAes256Sha256RsaPss

from tests.publish.certificates import Identity, make_identity
from tests.publish.interrupted_receivers import free_port
from tests.publish.test_publish_mqtt import events_of
from threadpitch.publish import PublishError, outlets, wait_until_taken
from threadpitch.store import Store, open_store

SCRIPT = Path(__file__).with_name("independent_client.js")
NODE = shutil.which("node")
PATIENCE = 60.0  # s


def node_opcua() -> bool:
    """Whether node finds the client's package (by NODE_PATH)."""
    return NODE is not None and subprocess.run([NODE, "-e", "require.resolve('node-opcua-client')"], check=False,
                                               stderr=subprocess.DEVNULL).returncode == 0


@pytest.fixture(scope="module")
def identities(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Identity]:
    folder = tmp_path_factory.mktemp("identities")
    return {name: make_identity(folder, name, f"urn:test:{name}") for name in ("server", "friend", "stranger")}


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    """Two results from before the server starts."""
    with open_store(str(tmp_path / "runs.db")) as one:
        for machine in ("Lathe 1", "Lathe 2"):
            add_result(one, machine)
        yield one


def add_result(store: Store, machine: str) -> str:
    events, run = events_of(machine)
    store.append([events.begin(), *(events.revolution(turn) for turn in events.turns(run)),
                  events.result(run, store.add(run))])
    return run.uid


def read_by_node(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    assert NODE is not None
    environment = os.environ | {"HOME": str(folder), "NODE_OPTIONS": "--no-warnings"}  # where it keeps certificates
    return subprocess.run([NODE, SCRIPT, *arguments], capture_output=True, text=True, check=False, timeout=PATIENCE,
                          env=environment)


def document(out: str) -> dict[str, Any]:
    """node-opcua writes remarks before and behind the line that is asked for."""
    (line,) = [one for one in out.splitlines() if one.startswith("{")]
    return dict(json.loads(line))


@pytest.mark.skipif(not node_opcua(), reason="needs node with the package node-opcua-client on NODE_PATH")
def test_another_implementation_reads_values_units_and_results(store: Store, tmp_path: Path) -> None:
    url = f"opc.tcp://127.0.0.1:{free_port()}"
    with outlets([f"{url}?anonymous=yes"], store) as (server,):
        newest = add_result(store, "Lathe 3")
        assert wait_until_taken([server], PATIENCE)
        done = read_by_node(tmp_path, url)
    assert done.returncode == 0, done.stderr
    found = document(done.stdout)
    assert (found["machine"], found["turn"]["value"]) == ("Lathe 3", 3)
    pitch = {"status": "Good", "type": "Double", "unit": "mm", "unitId": 5066068, "analogUnit": True}
    assert found["pitch"] == pitch | {"value": pytest.approx(1.505)}
    assert found["deviation"] == pitch | {"unit": "um", "unitId": 13384, "value": pytest.approx(5.0)}
    assert (found["startAngle"]["unit"], found["startAngle"]["value"]) == ("deg", 180.0)
    assert found["allPitches"]["value"] == pytest.approx([1.503, 1.504, 1.505])
    assert found["mean"]["value"] == pytest.approx(1.504)
    assert found["cause"] == "none"
    assert (found["results"], len(found["ids"]), found["error"], found["unknown"]) == (3, 3, 0, -1)
    assert (found["newest"], found["part"]) == (newest, "S-1")
    assert found["content"][1]["pitch"] == pytest.approx([1.503, 1.504, 1.505]) or \
        list(found["content"][1]["pitch"].values()) == pytest.approx([1.503, 1.504, 1.505])
    assert found["content"][-1]["cause"] == "none"
    assert found["oldest"] == found["ids"][-1]
    assert found["written"] in ("BadUserAccessDenied", "BadNotWritable")


@pytest.mark.skipif(not node_opcua(), reason="needs node with the package node-opcua-client on NODE_PATH")
def test_a_password_lets_another_implementation_in(store: Store, identities: dict[str, Identity],
                                                   tmp_path: Path) -> None:
    one, where = identities["server"], f"127.0.0.1:{free_port()}"
    with outlets([f"opc.tcp://plant:right@{where}?certificate={one.certificate}&key={one.key}"], store) as (server,):
        assert wait_until_taken([server], PATIENCE)
        right = read_by_node(tmp_path, f"opc.tcp://{where}", "plant", "right")
        wrong = read_by_node(tmp_path, f"opc.tcp://{where}", "plant", "wrong")
        nobody = read_by_node(tmp_path, f"opc.tcp://{where}")
    assert right.returncode == 0, right.stderr
    assert document(right.stdout)["machine"] == "Lathe 2"
    assert wrong.returncode == 1
    assert "BadUserAccessDenied" in wrong.stderr
    assert nobody.returncode == 1


async def machine_by_asyncua(url: str, own: Identity | None) -> str:
    client = Client(url)
    if own is not None:
        client.application_uri = f"urn:test:{own.certificate.stem}"
        await client.set_security(SecurityPolicyAes256Sha256RsaPss, own.certificate, own.key)
    async with client:
        index = await client.get_namespace_index("urn:threadpitch:results")
        node = await client.nodes.objects.get_child([f"{index}:ThreadPitch", f"{index}:Machine"])
        return str(await node.read_value())


def test_only_trusted_certificates_are_let_in(store: Store, identities: dict[str, Identity], tmp_path: Path) -> None:
    trusted = tmp_path / "trusted"
    trusted.mkdir()
    (trusted / "friend.pem").write_bytes(identities["friend"].certificate.read_bytes())
    one, url = identities["server"], f"opc.tcp://127.0.0.1:{free_port()}"
    options = f"certificate={one.certificate}&key={one.key}&trusted={trusted}"
    with outlets([f"{url}?{options}"], store) as (server,):
        assert wait_until_taken([server], PATIENCE)
        assert asyncio.run(machine_by_asyncua(url, identities["friend"])) == "Lathe 2"
        with pytest.raises(ua.UaError):
            asyncio.run(machine_by_asyncua(url, identities["stranger"]))
        with pytest.raises((ua.UaError, ConnectionError, OSError)):
            asyncio.run(machine_by_asyncua(url, None))  # not encrypted


def test_a_port_that_is_taken_is_told(store: Store) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        url = f"opc.tcp://127.0.0.1:{taken.getsockname()[1]}?anonymous=yes"
        with pytest.raises(PublishError, match="is the port free"), outlets([url], store):
            pass
