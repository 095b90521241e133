"""Reading ahead: the next items are read by a second thread while the present one is analysed."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, TypeVar

_Item = TypeVar("_Item")

AHEAD = 2  # items that are read or waiting; more would only cost memory


class ReadAhead(Generic[_Item]):
    """The items of an iterator, which is closed by ``close`` at the end.

    with ReadAhead(log.pieces(), log.close) as pieces:
        for piece in pieces:
            ...
    """

    def __init__(self, source: Iterator[_Item], close: Callable[[], None]) -> None:
        self._source, self._close = source, close
        self._reader = ThreadPoolExecutor(max_workers=1)

    def __enter__(self) -> Iterator[_Item]:
        return self._items()

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        interrupted = kind is not None and issubclass(kind, KeyboardInterrupt)
        self._reader.shutdown(wait=not interrupted, cancel_futures=True)
        if not interrupted:  # else the thread may hang on a pipe into which nobody writes
            self._close()

    def _items(self) -> Iterator[_Item]:
        done: list[_Item] = []  # an object that is no item

        def following() -> _Item | list[_Item]:
            return next(self._source, done)

        coming: deque[Future[_Item | list[_Item]]] = deque()
        while True:
            while len(coming) < AHEAD:
                coming.append(self._reader.submit(following))
            item = coming.popleft().result()
            if item is done:
                return
            yield item  # type: ignore[misc] # is not done
