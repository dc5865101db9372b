"use strict";
const { AttributeIds, ClientSubscription, ClientMonitoredItem, TimestampsToReturn } = require("node-opcua");
const { ask, equal, until } = require("./harness.js");
const { makeClient, nodes, site, user } = require("./connection.js");

/**
 * A client that listens through the wire that can be cut; every value that is published must arrive once.
 *
 * On a new connection node-opcua may ask for a message again that a Publish response is bringing already: by its
 * number it is the same one, and has to say the same.
 */
const outage = (how, published) => async () => {
    const client = await makeClient({ client: { connectionStrategy: { maxRetry: -1, initialDelay: 50, maxDelay: 200 }, keepSessionAlive: true } });
    await client.connect(site.wire);
    const session = await client.createSession(user("observer"));
    const at = await nodes(session);
    const seen = [];
    await ask("publish", { mu: 0.5 });
    const subscription = ClientSubscription.create(session, { requestedPublishingInterval: 50, requestedLifetimeCount: 2000, requestedMaxKeepAliveCount: 10, publishingEnabled: true });
    ClientMonitoredItem.create(subscription, { nodeId: at("Friction/StaticFriction"), attributeId: AttributeIds.Value }, { samplingInterval: 0, queueSize: 1000, discardOldest: true }, TimestampsToReturn.Both);
    const messages = new Map();
    const differing = [];
    subscription.on("raw_notification", (message) => {
        const told = (message.notificationData ?? []).flatMap((data) => data?.monitoredItems ?? []);
        const values = told.map((one) => Math.round(one.value.value.value * 1e6));
        if (!values.length) return;
        const before = messages.get(message.sequenceNumber);
        if (before === undefined) seen.push(...values);
        else if (String(before) !== String(values)) differing.push(message.sequenceNumber);
        messages.set(message.sequenceNumber, values);
    });
    await until(() => seen.length === 1, "the first value");
    const sent = [500000];
    const publish = async (count) => {
        for (let i = 0; i < count; i++) {
            const mu = 0.5 + 1e-6 * sent.length;
            sent.push(Math.round(mu * 1e6));
            await ask("publish", { mu });
        }
    };
    await publish(5);
    await until(() => seen.length === sent.length, "values before");
    await ask(how.begin);
    await publish(published);
    if (how.end) await ask(how.end);
    await publish(5);
    await until(() => seen.includes(sent[sent.length - 1]), "the last value", 30000);
    const missing = sent.filter((value) => !seen.includes(value));
    equal(missing.length, 0, `values lost (${missing.slice(0, 5)})`);
    equal(seen.length, sent.length, "values, each once");
    equal(differing.length, 0, `messages that said another thing the second time (${differing})`);
    await publish(3);
    await until(() => seen.length === sent.length, "values after");
    await session.close();
    await client.disconnect();
    return `${sent.length} values`;
};

module.exports = {
    "recovery after an orderly close": outage({ begin: "close" }, 20),
    "recovery after a TCP reset": outage({ begin: "reset" }, 20),
    "recovery after a 5 s outage": outage({ begin: "cut", end: "mend" }, 50),
    "recovery after a 5 s outage without a reset": outage({ begin: "stall", end: "mend" }, 50),
};
