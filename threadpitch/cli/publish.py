"""``threadpitch publish``: bring what the store keeps to those who listen, now and from now on."""

from __future__ import annotations

import contextlib
import time
from typing import Annotated

import typer

from threadpitch.cli.printing import fail, remark
from threadpitch.cli.store_options import StoreAddress
from threadpitch.publish import Outlet, outlets
from threadpitch.store import open_store

LOOK = 0.2  # s


def publish(
    urls: Annotated[list[str], typer.Argument(
        metavar="URL ...", help="mqtts://user@host:8883/prefix, mqtt://127.0.0.1/prefix, opc.tcp://127.0.0.1:4840. "
                                "?anonymous=yes, ?plain=yes let in what is off otherwise; files: ca=, certificate=, "
                                "key=, trusted=.")],
    address: StoreAddress = None,
    from_start: Annotated[bool, typer.Option(
        "--from-start", metavar="", help="A receiver that is new gets all that the store has, not only what comes "
                                         "from now on.")] = False,
    until_empty: Annotated[bool, typer.Option(
        "--until-empty", metavar="", help="End when all is taken, instead of waiting for more.")] = False,
    patience: Annotated[float, typer.Option(
        metavar="S", min=0.0, help="How long --until-empty waits; then exit status 2.")] = 60.0,
) -> None:
    """Bring the values of a store to MQTT brokers, and be the OPC UA server that shows them, until Ctrl-C.

    What a receiver has not taken waits in the store, and is sent in order when it is there again.
    """
    with open_store(address) as store, outlets(urls, store, from_start=from_start) as ways_out:
        remark(f"note: publishing what is in {store.address} to {', '.join(one.receiver.name for one in ways_out)}")
        with contextlib.suppress(KeyboardInterrupt):  # that is how one stops publishing
            _publish(ways_out, time.monotonic() + patience if until_empty else None)


def _publish(ways_out: list[Outlet], deadline: float | None) -> None:
    told = {one.receiver.name: "" for one in ways_out}
    while deadline is None or any(one.behind() for one in ways_out):
        for one in ways_out:
            if one.trouble != told[one.receiver.name]:
                told[one.receiver.name] = one.trouble
                remark(f"note: {one.receiver.name}: {one.trouble or 'connected'}")
        if deadline is not None and time.monotonic() > deadline:
            waiting = [f"{one.behind()} for {one.receiver.name}{f' ({one.trouble})' if one.trouble else ''}"
                       for one in ways_out if one.behind()]
            fail(f"events still wait: {', '.join(waiting)}; they stay in the store, is the receiver there?")
        time.sleep(LOOK)
