"""The command line: ``threadpitch run | analyze | ...``. Degrees, mm and rpm at this edge, SI inside."""

from threadpitch.cli.app import app, invoke, main

__all__ = ["app", "invoke", "main"]
