"""``threadpitch serve``: stored runs in a browser on this computer."""

from __future__ import annotations

import contextlib
from typing import Annotated

import typer

from threadpitch.cli.printing import fail, printing
from threadpitch.cli.store_options import StoreAddress
from threadpitch.store import open_store

DEFAULT_PORT = 8765
_EXTRA = {"starlette", "uvicorn", "bokeh", "jinja2", "anyio"}


def serve(
    address: StoreAddress = None,
    port: Annotated[int, typer.Option(metavar="N", min=0, max=65535, help="Port on 127.0.0.1; 0 = any that is free.")]
    = DEFAULT_PORT,
) -> None:
    """Look at stored runs in a browser: list, reports, comparison, control chart, live page; Ctrl-C ends it."""
    try:
        from threadpitch.serve.server import serve as serve_store
    except ImportError as error:
        if (error.name or "").partition(".")[0] not in _EXTRA:
            raise
        fail(f"serve needs {error.name}, which is not installed; pip install 'threadpitch[serve]'")

    def told(where: str) -> None:
        with printing():
            print(f"{store.address}\nopen {where}", flush=True)

    with open_store(address) as store, contextlib.suppress(KeyboardInterrupt):  # that is how one ends it
        serve_store(store, port, told)
