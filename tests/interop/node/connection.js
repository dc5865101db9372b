"use strict";
// How every row connects: client, session, nodes by path.
const path = require("path");
const {
    AttributeIds,
    MessageSecurityMode,
    OPCUACertificateManager,
    OPCUAClient,
    SecurityPolicy,
    UserTokenType,
} = require("node-opcua");

const site = JSON.parse(process.env.SITE);
let manager;

async function certificates() {
    if (!manager) {
        manager = new OPCUACertificateManager({
            rootFolder: path.join(site.directory, "node-pki"),
            automaticallyAcceptUnknownCertificate: true,
        });
        await manager.initialize();
    }
    return manager;
}

async function makeClient(options = {}) {
    const own = options.own || site.client;
    return OPCUAClient.create({
        applicationName: "node",
        applicationUri: "urn:test:client",
        clientCertificateManager: await certificates(),
        certificateFile: own.certificate,
        privateKeyFile: own.key,
        securityMode: MessageSecurityMode.SignAndEncrypt,
        securityPolicy: SecurityPolicy.Basic256Sha256,
        endpointMustExist: false,
        keepSessionAlive: true,
        requestedSessionTimeout: 60000,
        connectionStrategy: { maxRetry: 1, initialDelay: 100, maxDelay: 300 },
        ...options.client,
    });
}

const user = (role) => ({ type: UserTokenType.UserName, userName: role, password: site.passwords[role] });

/** Run `work(session, client)` in a session of a role. */
async function withSession(role, work, options = {}) {
    const client = await makeClient(options);
    await client.connect(options.endpoint || site.endpoint);
    try {
        const session = await client.createSession(options.identity || user(role));
        try {
            return await work(session, client);
        } finally {
            await session.close();
        }
    } finally {
        await client.disconnect();
    }
}

let namespaces;
async function nodes(session) {
    namespaces ||= (await session.read({ nodeId: "ns=0;i=2255", attributeId: AttributeIds.Value })).value.value;
    const cells = namespaces.indexOf("urn:impactcell:cells");
    return (below) => `ns=${cells};s=${site.cell}${below ? "/" + below : ""}`;
}

async function typesIndex(session) {
    await nodes(session);
    return namespaces.indexOf("urn:impactcell:ua");
}

module.exports = { certificates, makeClient, nodes, site, typesIndex, user, withSession };
