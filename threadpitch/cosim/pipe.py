"""Messages between two processes over a pipe: their length, then their bytes."""

from __future__ import annotations

import struct
from typing import IO

LENGTH = struct.Struct("<Q")
DONE, FAILED = b"d", b"f"  # the first byte of an answer


def write(stream: IO[bytes], message: bytes) -> None:
    """Send one message."""
    stream.write(LENGTH.pack(len(message)) + message)
    stream.flush()


def read(stream: IO[bytes]) -> bytes:
    """Receive one message.

    Raises:
        EOFError: the other side is gone.
    """
    prefix = stream.read(LENGTH.size)
    if len(prefix) < LENGTH.size:
        raise EOFError
    message = stream.read(LENGTH.unpack(prefix)[0])
    if len(message) < LENGTH.unpack(prefix)[0]:
        raise EOFError
    return message
