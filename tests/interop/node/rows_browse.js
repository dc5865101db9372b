"use strict";
const { AttributeIds, BrowseDirection, ClientSubscription, ClientMonitoredItem, DataType, TimestampsToReturn } = require("node-opcua");
const { ask, equal, until } = require("./harness.js");
const { nodes, typesIndex, withSession, site } = require("./connection.js");

const FOLDERS = ["Friction", "Wear", "Batch", "Signature", "Positioning", "Module", "Model"];

async function names(session, nodeId) {
    const result = await session.browse({ nodeId, browseDirection: BrowseDirection.Forward, resultMask: 63 });
    equal(result.statusCode.name, "Good", "browse " + nodeId);
    return result.references.map((reference) => reference.browseName.name);
}

module.exports = {
    "browse": () =>
        withSession("observer", async (session) => {
            const at = await nodes(session);
            const types = await typesIndex(session);
            const path = await session.translateBrowsePath({
                startingNode: "ns=0;i=85",
                relativePath: {
                    elements: [
                        { targetName: { namespaceIndex: types, name: "ImpactCells" }, referenceTypeId: "ns=0;i=33", includeSubtypes: true },
                        { targetName: { namespaceIndex: types + 1, name: site.cell }, referenceTypeId: "ns=0;i=33", includeSubtypes: true },
                    ],
                },
            });
            equal(path.targets[0].targetId.toString(), at(""), "path to the cell");
            const found = await names(session, at(""));
            for (const folder of [...FOLDERS, "WearLimit", "JournalFault", "StartBatch", "Identification"]) {
                if (!found.includes(folder)) throw new Error(`no ${folder} under the cell: ${found}`);
            }
            // BrowseNext: two references at a time.
            session.requestedMaxReferencesPerNode = 2;
            let page = await session.browse({ nodeId: at("Friction"), browseDirection: BrowseDirection.Forward, resultMask: 63 });
            let all = page.references;
            while (page.continuationPoint && page.continuationPoint.length) {
                page = await session.browseNext(page.continuationPoint, false);
                equal(page.statusCode.name, "Good", "browse next");
                all = all.concat(page.references);
            }
            if (all.length < 9) throw new Error(`BrowseNext gave ${all.length} references`);
        }),

    "read": () =>
        withSession("observer", async (session) => {
            const at = await nodes(session);
            await ask("publish", { mu: 0.2 });
            const value = await session.read({ nodeId: at("Friction/StaticFriction"), attributeId: AttributeIds.Value });
            equal(value.statusCode.name, "Good", "status");
            equal(value.value.value, 0.2, "value");
            if (!value.sourceTimestamp || !value.serverTimestamp) throw new Error("timestamps are missing");
            const range = await session.read({ nodeId: at("Friction/StaticFriction/EURange"), attributeId: AttributeIds.Value });
            equal(range.value.value.high, 1, "EURange");
            const unit = await session.read({ nodeId: at("Friction/PeakForce/EngineeringUnits"), attributeId: AttributeIds.Value });
            equal(unit.value.value.unitId, 5129559, "unit of PeakForce");
            const part = await session.read({ nodeId: at("Signature/Position"), attributeId: AttributeIds.Value, indexRange: "1:3" });
            equal(part.value.value.length, 3, "index range");
            await ask("lost");
            const lost = await session.read({ nodeId: at("Friction/StaticFriction"), attributeId: AttributeIds.Value });
            equal(lost.statusCode.name, "BadNoCommunication", "status without communication");
            equal(lost.value.value, 0.2, "last value without communication");
            await ask("publish", { mu: 0.2 });
            const unknown = await session.read({ nodeId: at("Friction/Nothing"), attributeId: AttributeIds.Value });
            equal(unknown.statusCode.name, "BadNodeIdUnknown", "unknown node");
            const written = await session.write({ nodeId: at("Wear/Limit"), attributeId: AttributeIds.Value, value: { value: { dataType: DataType.Double, value: 1 } } });
            equal(written.name, "BadUserAccessDenied", "write");
        }),

    "subscribe": () =>
        withSession("observer", async (session) => {
            const at = await nodes(session);
            const seen = [];
            const subscription = ClientSubscription.create(session, { requestedPublishingInterval: 50, requestedLifetimeCount: 1000, requestedMaxKeepAliveCount: 10, publishingEnabled: true });
            const item = ClientMonitoredItem.create(subscription, { nodeId: at("Friction/StaticFriction"), attributeId: AttributeIds.Value }, { samplingInterval: 0, queueSize: 100, discardOldest: true }, TimestampsToReturn.Both);
            item.on("changed", (value) => seen.push(value.value.value));
            await until(() => seen.length === 1, "the first value");
            for (const mu of [0.21, 0.22, 0.22, 0.23]) await ask("publish", { mu });
            await until(() => seen.length >= 4, "three more values");
            equal(seen.slice(1).join(), "0.21,0.22,0.23", "values: each change once");
            await subscription.terminate();
        }),
};
