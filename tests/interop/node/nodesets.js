"use strict";
// Loads the shipped NodeSet2 files with node-opcua's own parser; warnings go to stdout as they come.
const { AddressSpace } = require("node-opcua");
const { generateAddressSpace } = require("node-opcua-address-space/nodeJS");
const { nodesets } = require("node-opcua-nodesets");

const [impactcell, ...companions] = process.argv.slice(2);

async function main() {
    const space = AddressSpace.create();
    const files = companions.length ? companions : [nodesets.di, nodesets.ia, nodesets.machinery];
    await generateAddressSpace(space, [nodesets.standard, ...files, impactcell]);
    const types = space.getNamespaceIndex("urn:impactcell:ua");
    const cell = space.findObjectType("ImpactCellType", types);
    const made = cell.instantiate({ browseName: "press-1", organizedBy: space.rootFolder.objects });
    const found = (path) => path.split("/").reduce((node, name) => node && node.getChildByName(name), made);
    const friction = found("Friction/StaticFriction");
    console.log("@@" + JSON.stringify({
        type: cell.browseName.toString(),
        unit: friction.getChildByName("EngineeringUnits").readValue().value.value.unitId,
        high: friction.getChildByName("EURange").readValue().value.value.high,
        methods: ["StartBatch", "ResetWear", "SetTarget", "AbortPositioning"].filter((name) => found(name)),
        alarms: ["WearLimit", "BatchShift", "DeviantCycle", "ModuleConnection", "ModelGap", "PositioningFault", "JournalFault", "WearWarning"].filter((name) => found(name)),
        identification: !!found("Identification/SerialNumber"),
    }));
    space.dispose();
}
main().then(() => process.exit(0), (error) => { console.log("@@" + JSON.stringify({ error: error.stack })); process.exit(1); });
