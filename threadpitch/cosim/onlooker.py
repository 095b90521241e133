"""Who looks on while a run computes: the rows in which watched variables change, several times a second."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from threadpitch.cosim.block import Block, Column
from threadpitch.cosim.recording import Recorder, Taking

Look = Callable[[Mapping[str, Column]], None]  # columns by ``component.variable``, (rows,)


class Onlooker:
    """Shows what has been recorded since the last look; rows that left the block between two looks are not shown.

    Of a run that is gone on with it begins with all that the former process kept.
    """

    def __init__(self, recorder: Recorder, watched: Taking, look: Look) -> None:
        self._recorder, self._look = recorder, look
        self._taking = Taking(watched.channels, self, on=[channel.name for channel in watched.on])
        self._taking.last = watched.last
        self._seen = recorder.drained  # rows
        if watched.taken:
            kept = watched.sink.close()
            look({channel.name: kept.column(channel) for channel in watched.channels.all})

    def __call__(self) -> None:
        """Look."""
        recorder = self._recorder
        first, last = max(self._seen, recorder.drained), recorder.drained + recorder.filled
        if last > first:
            self._taking.take(recorder.block(first - recorder.drained), first)
        self._seen = last

    def take(self, block: Block) -> bool:
        """Rows in which something has changed."""
        self._look({channel.name: block.column(channel) for channel in block.channels.all})
        return False

    def position(self) -> dict[str, int]:
        """Nothing is kept."""
        return {}

    def close(self) -> Block:
        """Nothing is kept: who looks on is never asked for rows.

        Raises:
            TypeError: always.
        """
        raise TypeError("an onlooker keeps nothing")
