"use strict";
const { AggregateFunction, AttributeIds, HistoryReadRequest, ReadRawModifiedDetails, ReadProcessedDetails, ReadEventDetails, TimestampsToReturn, constructEventFilter, ofType, resolveNodeId } = require("node-opcua");
const { ask, equal } = require("./harness.js");
const { nodes, withSession } = require("./connection.js");

async function pages(session, nodeId, historyReadDetails) {
    const pages = [];
    let continuationPoint = null;
    do {
        const request = new HistoryReadRequest({
            historyReadDetails, nodesToRead: [{ nodeId, continuationPoint }],
            releaseContinuationPoints: false, timestampsToReturn: TimestampsToReturn.Both,
        });
        const result = (await session.historyRead(request)).results[0];
        if (!result.statusCode.isGood()) throw new Error(`history: ${result.statusCode.name}`);
        pages.push(result.historyData);
        continuationPoint = result.continuationPoint;
    } while (continuationPoint && continuationPoint.length);
    return pages;
}

module.exports = {
    "history raw with continuation": () =>
        withSession("observer", async (session) => {
            const at = await nodes(session);
            const past = await ask("history", { count: 2500 });
            const [start, end] = [new Date(past.start), new Date(past.end)];
            const details = new ReadRawModifiedDetails({ isReadModified: false, startTime: start, endTime: end, numValuesPerNode: 0, returnBounds: false });
            const found = await pages(session, at("Friction/StaticFriction"), details);
            const values = found.flatMap((page) => page.dataValues.map((value) => value.value.value));
            equal(found.length, 3, "pages");
            equal(values.length, 2500, "values");
            equal(values.every((value, index) => value === index), true, "in order, none lost");
            const back = new ReadRawModifiedDetails({ isReadModified: false, startTime: end, endTime: start, numValuesPerNode: 10, returnBounds: false });
            const newest = (await pages(session, at("Friction/StaticFriction"), back))[0].dataValues.map((value) => value.value.value);
            equal(newest.join(), [2499, 2498, 2497, 2496, 2495, 2494, 2493, 2492, 2491, 2490].join(), "backwards");
            const simple = await session.readHistoryValue(at("Friction/StaticFriction"), start, end);
            // The helper asks for bounding values too: there is none after the last value.
            equal(simple.historyData.dataValues.length, 1000, "helper, first page");
            const bounds = await pages(session, at("Friction/StaticFriction"), new ReadRawModifiedDetails({ isReadModified: false, startTime: new Date(start.getTime() + 1500), endTime: new Date(start.getTime() + 3500), numValuesPerNode: 0, returnBounds: true }));
            equal(bounds[0].dataValues.map((value) => value.value.value).join(), "1,2,3,4", "bounding values");
        }),

    "history aggregates with continuation": () =>
        withSession("observer", async (session) => {
            const at = await nodes(session);
            const past = await ask("history", { count: 2500 });
            const [start, end] = [new Date(past.start), new Date(past.end)];
            // One value a second, v(i) = i: over 10 s the mean is 10 k + 4.5.
            const read = async (fn) => {
                const result = await session.readAggregateValue({ nodeId: at("Friction/StaticFriction") }, start, end, fn, 10000);
                equal(result.statusCode.name, "Good", "aggregate");
                return result.historyData.dataValues;
            };
            const mean = await read(AggregateFunction.Average);
            equal(mean.length, 250, "intervals");
            equal(mean.every((value, k) => Math.abs(value.value.value - (10 * k + 4.5)) < 1e-9), true, "Average");
            equal((await read(AggregateFunction.Minimum)).every((value, k) => value.value.value === 10 * k), true, "Minimum");
            equal((await read(AggregateFunction.Maximum)).every((value, k) => value.value.value === 10 * k + 9), true, "Maximum");
            equal((await read(AggregateFunction.Count)).every((value) => value.value.value === 10), true, "Count");
            const details = new ReadProcessedDetails({ startTime: start, endTime: end, processingInterval: 1000, aggregateType: [resolveNodeId("ns=0;i=2352")], aggregateConfiguration: { useServerCapabilitiesDefaults: true } });
            const found = await pages(session, at("Friction/StaticFriction"), details);
            equal(found.length, 3, "pages");
            equal(found.flatMap((page) => page.dataValues).length, 2500, "intervals over all pages");
        }),

    "history of alarms": () =>
        withSession("observer", async (session) => {
            const at = await nodes(session);
            const past = await ask("alarm history");
            const details = new ReadEventDetails({
                startTime: new Date(past.start), endTime: new Date(past.end), numValuesPerNode: 0,
                filter: constructEventFilter(["ConditionName", "ActiveState.Id", "Message"], ofType("ConditionType")),
            });
            const found = await pages(session, at(""), details);
            const names = found.flatMap((page) => page.events.map((event) => event.eventFields[0].value + event.eventFields[1].value));
            equal(names.join(), "WearLimittrue,WearLimitfalse,BatchShifttrue", "transitions");
        }),
};
