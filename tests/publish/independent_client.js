// A plant's client by an OPC UA implementation of its own (node-opcua): node independent_client.js URL [USER PASSWORD]
// prints what it reads as JSON.
const { OPCUAClient, AttributeIds, MessageSecurityMode, SecurityPolicy, UserTokenType, DataType } =
  require("node-opcua-client");

const [url, userName, password] = process.argv.slice(2);
const security = userName
  ? { securityMode: MessageSecurityMode.SignAndEncrypt, securityPolicy: SecurityPolicy.Basic256Sha256 }
  : {};

async function children(session, nodeId) {
  const found = await session.browse({ nodeId, referenceTypeId: "HierarchicalReferences", includeSubtypes: true,
                                       browseDirection: 0, resultMask: 63 });
  return Object.fromEntries(found.references.map((one) => [one.browseName.name, one]));
}

async function value(session, reference) {
  const read = await session.read({ nodeId: reference.nodeId, attributeId: AttributeIds.Value });
  return { status: read.statusCode.name, value: read.value.value, type: DataType[read.value.dataType] };
}

async function quantity(session, parent, name) {
  const reference = (await children(session, parent.nodeId))[name];
  const unit = (await children(session, reference.nodeId)).EngineeringUnits;
  const information = (await value(session, unit)).value;
  const found = await value(session, reference);
  return { ...found, value: ArrayBuffer.isView(found.value) ? Array.from(found.value) : found.value,
           unit: information.displayName.text, unitId: information.unitId,
           analogUnit: reference.typeDefinition.toString() === "ns=0;i=17497" };
}

async function main() {
  const client = OPCUAClient.create({ endpointMustExist: false, connectionStrategy: { maxRetry: 1 }, ...security });
  await client.connect(url);
  const session = await client.createSession(userName ? { type: UserTokenType.UserName, userName, password } : undefined);
  try {
    const monitor = (await children(session, "ObjectsFolder")).ThreadPitch;
    const parts = await children(session, monitor.nodeId);
    const series = await children(session, parts["log 180 deg"].nodeId);
    const latest = await children(session, parts.LatestResult.nodeId);
    const management = await children(session, parts.ResultManagement.nodeId);
    const results = await children(session, management.Results.nodeId);
    const call = async (name, inputArguments) => (await session.call({
      objectId: parts.ResultManagement.nodeId, methodId: management[name].nodeId, inputArguments })).outputArguments;
    const timeout = { dataType: DataType.Int32, value: 0 };
    const [, ids, error] = await call("GetResultIdListFiltered", [
      { dataType: DataType.ExtensionObject, value: null }, { dataType: DataType.ExtensionObject, arrayType: 1, value: [] },
      { dataType: DataType.UInt32, value: 0 }, timeout]);
    const [, newest] = await call("GetLatestResult", [timeout]);
    const [, oldest] = await call("GetResultById",
      [{ dataType: DataType.String, value: ids.value[ids.value.length - 1] }, timeout]);
    const [, , unknown] = await call("GetResultById", [{ dataType: DataType.String, value: "nobody" }, timeout]);
    const written = await session.write({ nodeId: series.Pitch.nodeId, attributeId: AttributeIds.Value,
      value: { value: { dataType: DataType.Double, value: 9 } } });
    console.log(JSON.stringify({
      machine: (await value(session, parts.Machine)).value,
      turn: await value(session, series.Turn),
      pitch: await quantity(session, parts["log 180 deg"], "Pitch"),
      deviation: await quantity(session, parts["log 180 deg"], "Deviation"),
      startAngle: await quantity(session, parts["log 180 deg"], "StartAngle"),
      cause: (await value(session, latest.Cause)).value,
      allPitches: await quantity(session, latest["log 1 180 deg"], "Pitch"),
      mean: await quantity(session, latest["log 1 180 deg"], "Mean"),
      results: Object.keys(results).length,
      ids: ids.value, error: error.value, unknown: unknown.value,
      newest: newest.value.resultMetaData.resultId, part: newest.value.resultMetaData.partId,
      content: newest.value.resultContent.map((one) => one.value),
      oldest: oldest.value.resultMetaData.resultId,
      written: written.name,
    }));
  } finally {
    await session.close();
    await client.disconnect();
  }
}

main().catch((error) => { console.error(error.message); process.exit(1); });
