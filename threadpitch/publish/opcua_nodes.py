"""The address space: the pitches of now, and the results that the store keeps.

Objects/ThreadPitch                      PitchMonitorType
Machine, SerialNumber, Source        of the run of now
CALCULATOR START_ANGLE deg           PitchSeriesType: Turn, Group, StartAngle, Target, Pitch, Minimum, ...
ResultManagement                     ResultManagementType: GetLatestResult, GetResultById, ...
Results/RESULT_ID                ResultType: ResultMetaData, ResultContent
"""

from __future__ import annotations

import asyncio
import dataclasses
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from asyncua import Node, Server, ua

from threadpitch.publish.opcua_methods import Methods, add_methods
from threadpitch.publish.opcua_model import Types, add_object, add_quantity, add_variable, make_types
from threadpitch.store import Event, RunFilter, Store, StoredRun
from threadpitch.units import from_si

SHOWN = 50  # results with nodes of their own; the others are had by their id
SERIES = {"pitch_mm": "Pitch", "min_mm": "Minimum", "max_mm": "Maximum", "mean_mm": "Mean", "target_mm": "Target"}
MOST_SERIES = 64  # of one server: names of calculators come from logs
COMPLETED = 1  # ResultState


class Nodes:
    """The nodes of a server, and what they show."""

    def __init__(self, server: Server, store: Store) -> None:
        self._server, self._store = server, store
        self._series: dict[tuple[str, float], dict[str, Node]] = {}
        self._slots: list[dict[str, Node]] = []  # of the newest results
        self._next = 0  # slot
        self._shown: set[str] = set()  # ids of results that have a slot
        self._latest: dict[str, Node] = {}
        self._statistics: dict[str, dict[str, Node]] = {}  # of the latest result

    async def build(self) -> None:
        """Make the address space, with the newest results."""
        self._types = await make_types(self._server)
        self._monitor = await add_object(self._server.nodes.objects, self._types, "ThreadPitch", "PitchMonitorType")
        index = self._types.index
        self._texts = {key: await self._monitor.add_variable(index, name, "") for key, name in (
            ("machine", "Machine"), ("serial_number", "SerialNumber"), ("program", "Program"), ("thread", "Thread"),
            ("source", "Source"))}
        management = await add_object(self._monitor, self._types, "ResultManagement", "ResultManagementType")
        self._results = await management.add_folder(index, "Results")
        await add_methods(management, Methods(self._types, self._store, self._result))
        self._ready = await self._server.get_event_generator(self._types.nodes["ResultReadyEventType"], management)
        self._latest[""] = await add_object(self._monitor, self._types, "LatestResult", "LatestResultType")
        for name in ("ResultId", "Cause", "Sentence"):
            self._latest[name] = await self._latest[""].add_variable(index, name, "")
        for run in reversed(await asyncio.to_thread(self._store.runs, RunFilter(limit=SHOWN))):
            newest = await asyncio.to_thread(self._store.run, run.number)
            await self._show_result(newest)
        if self._shown:
            await self._show_latest(newest)

    async def take(self, event: Event) -> None:
        """Show what has happened."""
        if event.kind == "revolution":
            await self._show_revolution(event)
            return
        for key, node in self._texts.items():
            await node.write_value(str(event.document.get(key) or ""))
        number = event.document.get("run_number")
        if event.kind == "result" and isinstance(number, int) and str(event.run) not in self._shown:
            await self._result_ready(number)

    async def _show_revolution(self, event: Event) -> None:
        told = event.document
        key = str(told["calculator"]), float(told["start_angle_deg"])
        if key not in self._series:
            if len(self._series) >= MOST_SERIES:
                return
            self._series[key] = await self._add_series(*key)
        nodes = self._series[key]
        for field, name in SERIES.items():
            await nodes[name].write_value(_number(told.get(field), event.at))
        if told.get("target_mm") is not None:
            deviation = 1e3 * (told["pitch_mm"] - told["target_mm"])
            await nodes["Deviation"].write_value(_number(deviation, event.at))
        await nodes["Turn"].write_value(ua.DataValue(ua.Variant(told["turn"], ua.VariantType.UInt32),
                                                     SourceTimestamp=_naive(event.at)))
        await nodes["Group"].write_value(str(told["group"]))

    async def _add_series(self, calculator: str, start_angle: float) -> dict[str, Node]:
        parent = await add_object(self._monitor, self._types, f"{calculator} {start_angle:g} deg", "PitchSeriesType")
        nodes = {name: await add_quantity(parent, self._types, name, "mm") for name in SERIES.values()}
        nodes["Deviation"] = await add_quantity(parent, self._types, "Deviation", "um")
        nodes["StartAngle"] = await add_quantity(parent, self._types, "StartAngle", "deg")
        await nodes["StartAngle"].write_value(start_angle)
        index = self._types.index
        nodes["Turn"] = await parent.add_variable(index, "Turn", ua.Variant(0, ua.VariantType.UInt32))
        nodes["Group"] = await parent.add_variable(index, "Group", "")
        return nodes

    async def _result_ready(self, number: int) -> None:
        run = await asyncio.to_thread(self._store.run, number)
        result = await self._show_result(run)
        await self._show_latest(run)
        self._ready.event.ResultId, self._ready.event.Result = run.summary.uid, result
        await self._ready.trigger(message=f"result {number} is ready")

    async def _show_result(self, run: StoredRun) -> Any:
        """In the next slot, which may show an old result: nodes are not removed, as that takes asyncua long."""
        result = self._result(run)
        if run.summary.uid in self._shown:
            return result
        if len(self._slots) < SHOWN:
            self._slots.append(await self._add_slot(f"Result {len(self._slots) + 1:02d}", result))
        else:
            slot = self._slots[self._next % SHOWN]
            self._shown.remove(await slot["ResultId"].read_value())
            for name, value in _parts(result).items():
                await slot[name].write_value(value)
        self._next += 1
        self._shown.add(run.summary.uid)
        return result

    async def _add_slot(self, name: str, result: Any) -> dict[str, Node]:
        nodes, index = self._types.nodes, self._types.index
        kinds = {"ResultMetaData": nodes["ResultMetaDataType"].nodeid,
                 "ResultContent": ua.NodeId(ua.ObjectIds.BaseDataType)}
        parts = _parts(result)
        slot = {"": await add_variable(self._results, ua.QualifiedName(name, index), parts.pop(""),
                                       nodes["ResultDataType"].nodeid, nodes["ResultType"].nodeid)}
        for part, value in parts.items():
            parent = slot[""] if part in kinds else slot["ResultMetaData"]
            slot[part] = await parent.add_variable(index, part, value, datatype=kinds.get(part))
        return slot

    async def _show_latest(self, run: StoredRun) -> None:
        """The newest result as plain nodes, for clients that read no structures."""
        for name, text in (("ResultId", run.summary.uid), ("Cause", run.summary.cause),
                           ("Sentence", run.summary.sentence)):
            await self._latest[name].write_value(str(text or ""))
        shown = {f"{one['Calculator']} {one['Pass']} {one['StartAngle']:g} deg": one for one in _statistics(run)}
        for name in list(shown)[-MOST_SERIES:]:
            if name not in self._statistics and len(self._statistics) < 2 * MOST_SERIES:
                self._statistics[name] = await self._add_statistics(name)
        for name, nodes in self._statistics.items():
            one = shown.get(name, {"Pitch": []})  # what this result does not have is bad
            for figure, node in nodes.items():
                value = ua.Variant(one["Pitch"], ua.VariantType.Double, is_array=True) if figure == "Pitch" else \
                    _number(one.get(figure), run.summary.recorded_at)
                await node.write_value(value)

    async def _add_statistics(self, name: str) -> dict[str, Node]:
        parent = await add_object(self._latest[""], self._types, name, "PitchStatisticsType")
        nodes = {figure: await add_quantity(parent, self._types, figure, "mm")
                 for figure in ("Target", "Minimum", "Maximum", "Mean")}
        nodes["Pitch"] = await add_quantity(parent, self._types, "Pitch", "mm", [])
        return nodes

    def _result(self, run: StoredRun) -> Any:
        make, summary = self._types.make, run.summary
        meta = make(
            "ResultMetaDataType", ResultId=summary.uid, IsPartial=False, IsSimulated=summary.kind == "simulation",
            ResultState=COMPLETED, PartId=summary.serial_number, ExternalRecipeId=summary.program,
            ProductId=summary.thread, CreationTime=_naive(summary.recorded_at),
            ResultEvaluationDetails=ua.LocalizedText(summary.sentence or ""))
        content = [make("PitchStatisticsDataType", **one) for one in _statistics(run)]
        if run.verdict is not None:
            content.append(_verdict(self._types, run.verdict))
        return make("ResultDataType", ResultMetaData=meta, ResultContent=[ua.Variant(one) for one in content])


def _parts(result: Any) -> dict[str, ua.Variant]:
    """The values of a slot's nodes by their names; "" is the whole."""
    meta = result.ResultMetaData
    return {"": ua.Variant(result), "ResultMetaData": ua.Variant(meta),
            "ResultContent": ua.Variant(result.ResultContent, ua.VariantType.Variant, is_array=True),
            **{field.name: ua.Variant(getattr(meta, field.name)) for field in dataclasses.fields(meta)
               if field.name != "Encoding"}}


def _statistics(run: StoredRun) -> list[dict[str, Any]]:
    """A line for every pass and start angle: mm, degrees, P(n) with NaN where a turn is missing."""
    found = []
    for one in run.passes:
        shown = one.effective or one.table.statistics
        for row, angle in enumerate(one.table.start_angles.tolist()):
            figures = {"Minimum": shown.minimum[row], "Maximum": shown.maximum[row], "Mean": shown.mean[row]}
            found.append({
                "Calculator": one.calculator, "Pass": one.label, "StartAngle": round(from_si(angle, "deg"), 9),
                "Target": None if one.target is None else from_si(one.target, "mm"),
                **{name: from_si(float(value), "mm") for name, value in figures.items()},
                "Pitch": [from_si(value, "mm") for value in one.table.pitch[row].tolist()]})
    return found


def _verdict(types: Types, verdict: Mapping[str, Any]) -> Any:
    advice = [str(one) for one in verdict.get("advice") or ()]
    return types.make("VerdictDataType", Cause=str(verdict.get("cause") or ""),
                      Sentence=str(verdict.get("sentence") or ""), Advice=advice)


def _number(value: Any, at: datetime) -> ua.DataValue:
    """A number of an instant; bad where it is not known."""
    if value is None or math.isnan(value):
        return ua.DataValue(StatusCode=ua.StatusCode(ua.StatusCodes.BadNoData), SourceTimestamp=_naive(at))
    return ua.DataValue(ua.Variant(float(value), ua.VariantType.Double), SourceTimestamp=_naive(at))


def _naive(instant: datetime) -> datetime:
    """As asyncua takes it: UTC without a zone."""
    return instant.astimezone(UTC).replace(tzinfo=None)
