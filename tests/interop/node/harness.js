"use strict";
// Talks with the test that started this process: one JSON object a line, commands out, answers in.
const readline = require("readline");

const waiting = [];
readline.createInterface({ input: process.stdin }).on("line", (line) => {
    const next = waiting.shift();
    if (next) next(JSON.parse(line));
});

const say = (object) => process.stdout.write("@@" + JSON.stringify(object) + "\n");

/** Ask the test to do something to the server or the wire between; resolves when it is done. */
function ask(command, details = {}) {
    return new Promise((resolve) => {
        waiting.push(resolve);
        say({ ask: command, ...details });
    });
}

/** Wait until a condition holds; it is looked at again after each event loop turn of 5 ms. */
async function until(condition, what, timeout = 15000) {
    const end = Date.now() + timeout;
    while (!condition()) {
        if (Date.now() > end) throw new Error("waited in vain for " + what);
        await new Promise((resolve) => setTimeout(resolve, 5));
    }
}

function equal(actual, expected, what) {
    const [a, e] = [String(actual), String(expected)];
    if (a !== e) throw new Error(`${what}: ${a} in place of ${e}`);
}

/** Run rows one after the other, each with what it takes to say whether it passed. */
async function run(rows) {
    for (const [name, row] of Object.entries(rows)) {
        let detail = "";
        const begin = Date.now();
        try {
            detail = (await row()) || "";
        } catch (error) {
            say({ row: name, ok: false, detail: error.stack || String(error) });
            continue;
        }
        say({ row: name, ok: true, detail, ms: Date.now() - begin });
    }
    say({ done: true });
}

module.exports = { ask, equal, run, say, until };
