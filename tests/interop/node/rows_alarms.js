"use strict";
const {
    AttributeIds, ClientSubscription, ClientMonitoredItem, DataType, TimestampsToReturn, constructEventFilter, ofType,
    callConditionRefresh, coerceLocalizedText, resolveNodeId, Variant,
} = require("node-opcua");
const { ask, equal, until } = require("./harness.js");
const { nodes, withSession } = require("./connection.js");

const FIELDS = [
    "EventId", "EventType", "SourceName", "Message", "Severity", "Retain", "ConditionName", "Comment", "ClientUserId",
    "ActiveState", "ActiveState.Id", "AckedState.Id", "ConfirmedState.Id", "EnabledState.Id", "ShelvingState.CurrentState",
];

/** Subscribe to the alarms of the server, with an OfType(ConditionType) filter. */
async function listen(session, nodeId = "ns=0;i=2253") {
    const seen = [];
    const subscription = ClientSubscription.create(session, { requestedPublishingInterval: 50, requestedLifetimeCount: 1000, requestedMaxKeepAliveCount: 10, publishingEnabled: true, maxNotificationsPerPublish: 0 });
    const filter = constructEventFilter([...FIELDS, "ConditionId"], ofType("ConditionType"));
    const item = ClientMonitoredItem.create(subscription, { nodeId, attributeId: AttributeIds.EventNotifier }, { samplingInterval: 0, queueSize: 1000, discardOldest: true, filter }, TimestampsToReturn.Both);
    item.on("changed", (values) => {
        const event = {};
        [...FIELDS, "ConditionId"].forEach((name, index) => (event[name] = values[index].value));
        seen.push(event);
    });
    await new Promise((resolve, reject) => {
        item.on("initialized", resolve);
        item.on("err", (message) => reject(new Error(message)));
    });
    return { subscription, seen, last: () => seen[seen.length - 1], next: (n) => until(() => seen.length >= n, `${n} events`) };
}

const call = async (session, objectId, methodId, inputArguments = []) =>
    (await session.call({ objectId, methodId, inputArguments })).statusCode.name;
const bytes = (value) => new Variant({ dataType: DataType.ByteString, value });
const text = (value) => new Variant({ dataType: DataType.LocalizedText, value: coerceLocalizedText(value) });
const double = (value) => new Variant({ dataType: DataType.Double, value });

/** A freshly raised WearLimit and a client that has seen it. */
const raised = (role, work) => () =>
    withSession(role, async (session) => {
        const at = await nodes(session);
        await ask("normal");
        const events = await listen(session);
        await ask("raise");
        await events.next(1);
        await work({ session, at, events, condition: at("WearLimit"), id: events.last().EventId });
        await events.subscription.terminate();
    });

module.exports = {
    "events with OfType(ConditionType)": raised("observer", async ({ events, at }) => {
        const event = events.last();
        equal(event.ConditionName, "WearLimit", "name");
        equal(event.SourceName, "press-1", "source");
        equal(event["ActiveState.Id"], true, "active");
        equal(event["AckedState.Id"], false, "acknowledged");
        equal(event.Severity, 700, "severity");
        equal(event.ConditionId.toString(), at("WearLimit"), "ConditionId");
        await ask("clear");
        await events.next(2);
        equal(events.last()["ActiveState.Id"], false, "cleared");
        equal(events.last().Retain, true, "retained until acknowledged");
    }),

    "ConditionRefresh": () =>
        withSession("observer", async (session) => {
            await ask("normal");
            await ask("raise");
            const events = await listen(session);
            await callConditionRefresh(session, events.subscription.subscriptionId);
            await events.next(1);
            const found = events.seen.filter((event) => event.ConditionName === "WearLimit");
            equal(found.length, 1, "retained condition shown again");
            equal(found[0].Retain, true, "retain");
            await events.subscription.terminate();
        }),

    "ConditionRefresh of an unknown subscription": () =>
        withSession("observer", async (session) => {
            const argument = new Variant({ dataType: DataType.UInt32, value: 4711 });
            equal(await call(session, "ns=0;i=2782", "ns=0;i=3875", [argument]), "BadSubscriptionIdInvalid", "refresh");
        }),

    "Acknowledge by helper": raised("operator", async ({ session, events, condition, id }) => {
        const status = await session.acknowledgeCondition(condition, id, "seen");
        equal(status.name, "Good", "acknowledge");
        await events.next(2);
        equal(events.last()["AckedState.Id"], true, "acknowledged");
        equal(events.last().Comment.text, "seen", "comment");
        equal(events.last().ClientUserId, "operator", "user");
        equal((await session.acknowledgeCondition(condition, id, "again")).name, "BadConditionBranchAlreadyAcked", "repeat");
    }),

    "Acknowledge by method": raised("operator", async ({ session, events, condition, id }) => {
        equal(await call(session, condition, "ns=0;i=9111", [bytes(id), text("by method")]), "Good", "acknowledge");
        await events.next(2);
        equal(events.last()["AckedState.Id"], true, "acknowledged");
    }),

    "Confirm": raised("operator", async ({ session, events, condition, id }) => {
        await session.acknowledgeCondition(condition, id, "seen");
        await events.next(2);
        equal(events.last()["ConfirmedState.Id"], false, "to be confirmed");
        equal((await session.confirmCondition(condition, events.last().EventId, "mended")).name, "Good", "confirm");
        await events.next(3);
        equal(events.last()["ConfirmedState.Id"], true, "confirmed");
        equal((await session.confirmCondition(condition, events.last().EventId, "again")).name, "BadConditionBranchAlreadyConfirmed", "repeat");
    }),

    "AddComment": raised("operator", async ({ session, events, condition, id }) => {
        equal((await session.addCommentCondition(condition, id, "a note")).name, "Good", "comment");
        await events.next(2);
        equal(events.last().Comment.text, "a note", "comment");
    }),

    "shelving": raised("operator", async ({ session, events, at, condition }) => {
        const state = at("WearLimit/ShelvingState");
        equal(await call(session, state, "ns=0;i=2947"), "BadConditionNotShelved", "unshelve what is not shelved");
        equal(await call(session, state, "ns=0;i=2949", [double(60000)]), "Good", "TimedShelve");
        await events.next(2);
        equal(events.last()["ShelvingState.CurrentState"].text, "Timed Shelved", "state");
        equal(await call(session, state, "ns=0;i=2949", [double(60000)]), "BadConditionAlreadyShelved", "repeat");
        equal(await call(session, state, "ns=0;i=2949", [double(1e12)]), "BadShelvingTimeOutOfRange", "too long");
        equal(await call(session, state, "ns=0;i=2947"), "Good", "Unshelve");
        equal(await call(session, condition, at("WearLimit/ShelvingState/OneShotShelve")), "Good", "OneShotShelve on the condition");
        equal(await call(session, state, "ns=0;i=2948"), "BadConditionAlreadyShelved", "repeat");
        equal(await call(session, state, "ns=0;i=2947"), "Good", "Unshelve");
        await events.next(5);
        equal(events.last()["ShelvingState.CurrentState"].text, "Unshelved", "state");
    }),

    "Enable and Disable": raised("engineer", async ({ session, events, condition, id }) => {
        equal(await call(session, condition, "ns=0;i=9027"), "BadConditionAlreadyEnabled", "Enable");
        equal(await call(session, condition, "ns=0;i=9028"), "Good", "Disable");
        await events.next(2);
        equal(events.last()["EnabledState.Id"], false, "disabled");
        equal(events.last().Retain, false, "retain");
        equal((await session.acknowledgeCondition(condition, id, "x")).name, "BadConditionDisabled", "acknowledge while disabled");
        equal(await call(session, condition, "ns=0;i=9028"), "BadConditionAlreadyDisabled", "Disable again");
        equal(await call(session, condition, "ns=0;i=9027"), "Good", "Enable");
    }),

    "wrong EventId": raised("operator", async ({ session, condition }) => {
        const wrong = Buffer.from("00112233445566778899aabbccddeeff", "hex");
        equal((await session.acknowledgeCondition(condition, wrong, "x")).name, "BadEventIdUnknown", "acknowledge");
        equal((await session.confirmCondition(condition, wrong, "x")).name, "BadEventIdUnknown", "confirm");
        equal((await session.addCommentCondition(condition, wrong, "x")).name, "BadEventIdUnknown", "comment");
    }),

    "observer may not acknowledge": raised("observer", async ({ session, condition, id }) => {
        equal((await session.acknowledgeCondition(condition, id, "x")).name, "BadUserAccessDenied", "acknowledge");
    }),

    "methods of the cell": () =>
        withSession("engineer", async (session) => {
            const at = await nodes(session);
            const string = (value) => new Variant({ dataType: DataType.String, value });
            const flag = new Variant({ dataType: DataType.Boolean, value: true });
            equal(await call(session, at(""), at("StartBatch"), [string("B-7"), flag]), "Good", "StartBatch");
            equal(await call(session, at(""), at("StartBatch"), [string("B-7")]), "BadArgumentsMissing", "too few");
            equal(await call(session, at(""), at("StartBatch"), [double(1), flag]), "BadInvalidArgument", "wrong type");
            equal(await call(session, at(""), at("SetTarget"), [double(12.5)]), "Good", "SetTarget");
            equal(await call(session, at(""), at("SetTarget"), [double(1e9)]), "BadInvalidArgument", "out of range");
            equal(await call(session, at(""), at("ResetWear"), [text("new plate")]), "Good", "ResetWear");
            equal(await call(session, at(""), at("AbortPositioning")), "Good", "AbortPositioning");
            equal(await call(session, at("WearLimit"), at("AbortPositioning")), "BadMethodInvalid", "method of another object");
        }),
};
