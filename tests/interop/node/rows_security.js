"use strict";
const { MessageSecurityMode, SecurityPolicy, UserTokenType, OPCUAClient } = require("node-opcua");
const fs = require("fs");
const { ask, equal } = require("./harness.js");
const { makeClient, nodes, site, user, withSession } = require("./connection.js");

const readOne = async (session) => {
    const at = await nodes(session);
    equal((await session.read({ nodeId: at("Model/Name") })).statusCode.name, "Good", "read");
};

async function refused(work, pattern, what) {
    try {
        await work();
    } catch (error) {
        if (!pattern.test(error.message + " " + (error.response ? error.response.toString() : ""))) {
            throw new Error(`${what}: ${error.message}`);
        }
        return error.message.split("\n")[0];
    }
    throw new Error(`${what}: was let in`);
}

const policy = (name) => () =>
    withSession("operator", readOne, { client: { securityPolicy: SecurityPolicy[name], securityMode: MessageSecurityMode.SignAndEncrypt } });

module.exports = {
    "policy Basic256Sha256": policy("Basic256Sha256"),
    "policy Aes128_Sha256_RsaOaep": policy("Aes128_Sha256_RsaOaep"),
    "policy Aes256_Sha256_RsaPss": policy("Aes256_Sha256_RsaPss"),

    "discovery without security": async () => {
        const client = OPCUAClient.create({ endpointMustExist: false, connectionStrategy: { maxRetry: 0 } });
        await client.connect(site.endpoint);
        const endpoints = await client.getEndpoints();
        await client.disconnect();
        equal(endpoints.length, 3, "endpoints");
        for (const endpoint of endpoints) equal(endpoint.securityMode, MessageSecurityMode.SignAndEncrypt, "mode");
    },

    "session without security": () =>
        refused(
            () => withSession("observer", readOne, { client: { securityMode: MessageSecurityMode.None, securityPolicy: SecurityPolicy.None } }),
            /BadSecurityModeInsufficient|End point must exist/,
            "session without security"
        ),

    "wrong password": () =>
        refused(
            () => withSession("observer", readOne, { identity: { type: UserTokenType.UserName, userName: "observer", password: "guess" } }),
            /BadUserAccessDenied/,
            "wrong password"
        ),

    "anonymous": () =>
        refused(
            () => withSession("observer", readOne, { identity: { type: UserTokenType.Anonymous } }),
            /BadIdentityTokenRejected|[Aa]nonymous|Cannot find/,
            "anonymous"
        ),

    "user certificate": () =>
        withSession("observer", readOne, {
            identity: {
                type: UserTokenType.Certificate,
                certificateData: fs.readFileSync(site.person.certificateDer),
                privateKey: fs.readFileSync(site.person.key, "ascii"),
            },
        }),

    "untrusted certificate, trusted without a restart": async () => {
        const own = site.stranger;
        const message = await refused(() => withSession("observer", readOne, { own }), /./, "untrusted certificate");
        const kept = await ask("rejected");
        equal(kept.count >= 1, true, "rejected certificate kept");
        await ask("trust");
        await withSession("observer", readOne, { own });
        return message;
    },
};
