"use strict";
const { run } = require("./harness.js");

run({
    ...require("./rows_browse.js"),
    ...require("./rows_security.js"),
    ...require("./rows_alarms.js"),
    ...require("./rows_history.js"),
    ...require("./rows_recovery.js"),
}).then(() => process.exit(0));
