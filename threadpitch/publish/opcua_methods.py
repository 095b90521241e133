"""The methods of ResultManagementType: clients ask for the results that the store keeps, however old."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from asyncua import Node, ua, uamethod

from threadpitch.publish.opcua_model import Types
from threadpitch.store import RunFilter, RunSummary, Store, StoredRun

MOST_IDS = 1000
NO_HANDLE = 0  # nothing is held for a client
FINE, UNKNOWN, NOT_SUPPORTED = 0, -1, -2  # errors of one's own are negative


@dataclass(frozen=True)
class Methods:
    """What the methods answer; ``timeout`` is a hint that nothing here needs."""

    types: Types
    store: Store
    result_of: Callable[[StoredRun], Any]  # ResultDataType

    async def get_latest_result(self, _: object, __: int) -> tuple[Any, ...]:
        """(resultHandle, result, error) of the newest run."""
        newest = await self._runs(1)
        return await self._found(newest[0] if newest else None)

    async def get_result_by_id(self, _: object, result_id: str | None, __: int) -> tuple[Any, ...]:
        """(resultHandle, result, error) of the run of this uid."""
        return await self._found(await asyncio.to_thread(self.store.find, result_id or ""))

    async def get_result_ids(self, _: object, wanted: Any, order: Any, most: int, __: int) -> tuple[Any, ...]:
        """(resultHandle, resultIdList, error), newest first; filters and orders are not supported."""
        if getattr(wanted, "Elements", None) or order:  # no filter comes as nothing, or as a structure of no type
            return _whole(NO_HANDLE), _texts([]), _error(NOT_SUPPORTED)
        return _whole(NO_HANDLE), _texts([run.uid for run in await self._runs(min(most or MOST_IDS, MOST_IDS))]), \
            _error(FINE)

    async def release_result_handle(self, _: object, __: int) -> Any:
        """There is nothing to release."""
        return _error(FINE)

    async def _runs(self, count: int) -> list[RunSummary]:
        return await asyncio.to_thread(self.store.runs, RunFilter(limit=count))

    async def _found(self, run: RunSummary | None) -> tuple[Any, ...]:
        if run is None:
            return _whole(NO_HANDLE), ua.Variant(self.types.make("ResultDataType")), _error(UNKNOWN)
        kept = await asyncio.to_thread(self.store.run, run.number)
        return _whole(NO_HANDLE), ua.Variant(self.result_of(kept)), _error(FINE)


async def add_methods(management: Node, methods: Methods) -> None:
    """Put the methods into the address space, with the arguments that the specification gives them."""
    result = _argument("result", methods.types.nodes["ResultDataType"].nodeid)
    timeout, handle = _argument("timeout", ua.ObjectIds.Int32), _argument("resultHandle", ua.ObjectIds.UInt32)
    error = _argument("error", ua.ObjectIds.Int32)
    for name, method, given, told in (
        ("GetLatestResult", methods.get_latest_result, [timeout], [handle, result, error]),
        ("GetResultById", methods.get_result_by_id, [_argument("resultId", ua.ObjectIds.String), timeout],
         [handle, result, error]),
        ("GetResultIdListFiltered", methods.get_result_ids,
         [_argument("filter", ua.ObjectIds.ContentFilter), _argument("orderedBy", ua.ObjectIds.RelativePath, True),
          _argument("maxResults", ua.ObjectIds.UInt32), timeout],
         [handle, _argument("resultIdList", ua.ObjectIds.String, True), error]),
        ("ReleaseResultHandle", methods.release_result_handle, [handle], [error]),
    ):
        await management.add_method(methods.types.index, name, uamethod(method), given, told)


def _argument(name: str, kind: Any, array: bool = False) -> ua.Argument:
    argument = ua.Argument()
    argument.Name = name
    argument.DataType = kind if isinstance(kind, ua.NodeId) else ua.NodeId(kind)
    argument.ValueRank = 1 if array else -1
    return argument


def _whole(number: int) -> ua.Variant:
    return ua.Variant(number, ua.VariantType.UInt32)


def _error(number: int) -> ua.Variant:
    return ua.Variant(number, ua.VariantType.Int32)


def _texts(texts: list[str]) -> ua.Variant:
    return ua.Variant(texts, ua.VariantType.String, is_array=True)
