"""The types of the OPC UA server, modelled on OPC 40001-101 (Machinery, Result Transfer).

Their names and fields are those of that specification; they live in a namespace of their own, because this is not its
whole: filters of results, file transfer and acknowledgement are missing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from asyncua import Node, Server, ua
from asyncua.common.structures104 import new_struct, new_struct_field

NAMESPACE = "urn:threadpitch:results"
UNITS = {"mm": ("MMT", "millimetre"), "um": ("4H", "micrometre"), "deg": ("DD", "degree")}  # UNECE Recommendation 20
_UNECE = "http://www.opcfoundation.org/UA/units/un/cefact"
_TEXT, _FLAG, _WHOLE = ua.VariantType.String, ua.VariantType.Boolean, ua.VariantType.Int32
_TIME, _NUMBER = ua.VariantType.DateTime, ua.VariantType.Double


@dataclass(frozen=True)
class Types:
    """The types by their names: classes of structures, nodes of all."""

    index: int  # of the namespace
    classes: dict[str, type]
    nodes: dict[str, Node]

    def make(self, name: str, **fields: Any) -> Any:
        """A value of a structure."""
        return self.classes[name](**fields)


async def make_types(server: Server) -> Types:
    """Put the types into the address space."""
    index = await server.register_namespace(NAMESPACE)
    nodes: dict[str, Node] = {}

    async def structure(name: str, **fields: Any) -> None:
        made = [new_struct_field(field, kind, array=array, optional=optional)
                for field, (kind, array, optional) in fields.items()]
        nodes[name], _ = await new_struct(server, index, name, made)

    await structure(
        "ResultMetaDataType", ResultId=(_TEXT, False, False), IsPartial=(_FLAG, False, True),
        IsSimulated=(_FLAG, False, True), ResultState=(_WHOLE, False, True), PartId=(_TEXT, False, True),
        ExternalRecipeId=(_TEXT, False, True), ProductId=(_TEXT, False, True), CreationTime=(_TIME, False, True),
        ResultEvaluationDetails=(ua.VariantType.LocalizedText, False, True))
    await structure(
        "PitchStatisticsDataType", Calculator=(_TEXT, False, False), Pass=(_TEXT, False, False),
        StartAngle=(_NUMBER, False, False), Target=(_NUMBER, False, True), Minimum=(_NUMBER, False, False),
        Maximum=(_NUMBER, False, False), Mean=(_NUMBER, False, False), Pitch=(_NUMBER, True, False))
    await structure("VerdictDataType", Cause=(_TEXT, False, False), Sentence=(_TEXT, False, False),
                    Advice=(_TEXT, True, False))
    await structure("ResultDataType", ResultMetaData=(nodes["ResultMetaDataType"], False, False),
                    ResultContent=(ua.VariantType.Variant, True, True))
    # asyncua makes the classes once in a process, by their names; what it returns are only those that are new.
    await server.load_data_type_definitions()
    classes = {name: getattr(ua, name) for name in nodes}
    base = server.nodes
    for name in ("PitchMonitorType", "PitchSeriesType", "LatestResultType", "PitchStatisticsType",
                 "ResultManagementType"):
        nodes[name] = await base.base_object_type.add_object_type(index, name)
    nodes["ResultType"] = await base.base_variable_type.add_variable_type(
        index, "ResultType", nodes["ResultDataType"].nodeid)
    nodes["ResultReadyEventType"] = await server.create_custom_event_type(
        index, "ResultReadyEventType", ua.ObjectIds.BaseEventType,
        [("ResultId", _TEXT), ("Result", ua.VariantType.ExtensionObject, nodes["ResultDataType"].nodeid)])
    return Types(index, classes, nodes)


async def add_object(parent: Node, types: Types, name: str, kind: str) -> Node:
    """An object of one of the types."""
    return await parent.add_object(types.index, name, objecttype=types.nodes[kind].nodeid)


async def add_variable(parent: Node, name: ua.QualifiedName, value: ua.Variant, data_type: ua.NodeId,
                       kind: ua.NodeId) -> Node:
    """A variable of a type of its own (``Node.add_variable`` makes plain ones only)."""
    attributes = ua.VariableAttributes()
    attributes.DisplayName = attributes.Description = ua.LocalizedText(name.Name)
    attributes.DataType, attributes.Value = data_type, value
    attributes.ValueRank = ua.ValueRank.OneDimension if value.is_array else ua.ValueRank.Scalar
    attributes.AccessLevel = attributes.UserAccessLevel = ua.AccessLevel.CurrentRead.mask
    item = ua.AddNodesItem()
    item.RequestedNewNodeId, item.BrowseName = ua.NodeId(0, name.NamespaceIndex), name
    item.NodeClass, item.ParentNodeId = ua.NodeClass.Variable, parent.nodeid
    item.ReferenceTypeId, item.TypeDefinition = ua.NodeId(ua.ObjectIds.HasComponent), kind
    item.NodeAttributes = attributes
    (added,) = await parent.session.add_nodes([item])
    added.StatusCode.check()
    return Node(parent.session, added.AddedNodeId)


async def add_quantity(parent: Node, types: Types, name: str, unit: str, values: list[float] | None = None) -> Node:
    """A number, or an array of them, with its engineering unit (AnalogUnitType); a number is bad until it is known."""
    node = await add_variable(
        parent, ua.QualifiedName(name, types.index),
        ua.Variant(0.0 if values is None else values, _NUMBER, is_array=values is not None),
        ua.NodeId(ua.ObjectIds.Double), ua.NodeId(ua.ObjectIds.AnalogUnitType))
    code, long_name = UNITS[unit]
    information = ua.EUInformation(_UNECE, int.from_bytes(code.encode("ascii"), "big"), ua.LocalizedText(unit),
                                   ua.LocalizedText(long_name))
    await node.add_property(0, "EngineeringUnits", ua.Variant(information), datatype=ua.ObjectIds.EUInformation)
    if values is None:
        await node.write_value(ua.DataValue(StatusCode=ua.StatusCode(ua.StatusCodes.BadWaitingForInitialData)))
    return node
