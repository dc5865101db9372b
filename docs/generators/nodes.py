"""Variables, conditions and methods of a cell, from the NodeSet2 file that the server loads."""

import xml.etree.ElementTree as ET
from pathlib import Path

from generators.markdown import code, table

ROOT = Path(__file__).resolve().parents[2]
NODESET = ROOT / "impactcell" / "scada" / "model" / "ImpactCell.NodeSet2.xml"
UA = "{http://opcfoundation.org/UA/2011/03/UANodeSet.xsd}"
TYPES = "{http://opcfoundation.org/UA/2008/02/Types.xsd}"
KINDS = ("UAVariable", "UAMethod")
PROPERTIES = ("EURange", "EngineeringUnits", "InputArguments")
"""Nodes below a variable or method that its own row tells of."""
CONDITION, CONDITION_TYPE = "<condition>", "ImpactCellAlarmType"
"""What stands for the name of each condition, and the type that declares what all of them have."""
ARRAY = "1"
"""ValueRank of an array of one dimension."""
DATA_TYPES = {
    "i=1": "Boolean",
    "i=11": "Double",
    "i=12": "String",
    "i=15": "ByteString",
    "i=21": "LocalizedText",
}
"""Types of arguments, Part 6, A.2."""


def variables() -> str:
    """Write a row a node that has a description, in the order of the file."""
    root = ET.parse(NODESET).getroot()  # our own file
    objects = {node.attrib["NodeId"]: _name(node) for node in root.iter(f"{UA}UAObject")}
    objects |= {
        node.attrib["NodeId"]: CONDITION
        for node in root.iter(f"{UA}UAObjectType")
        if _name(node) == CONDITION_TYPE
    }
    below = {(node.attrib.get("ParentNodeId"), _name(node)): node for node in root.iter(f"{UA}UAVariable")}
    rows = []
    for node in root:
        kind = node.tag.removeprefix(UA)
        description, name = node.findtext(f"{UA}Description", ""), _name(node)
        if kind not in KINDS or not description or name in PROPERTIES:
            continue
        folder = objects.get(node.attrib.get("ParentNodeId", ""))
        arguments = below.get((node.attrib["NodeId"], "InputArguments"))
        typed = f"method: {_arguments(arguments)}" if kind == "UAMethod" else _data_type(node)
        path = f"{folder}/{name}" if folder else name
        unit = _unit(below.get((node.attrib["NodeId"], "EngineeringUnits")))
        history = "history" if node.attrib.get("Historizing") == "true" else ""
        rows.append((code(path), description, ", ".join(filter(None, (typed, unit, history)))))
    return table(("path below the cell", "description", "type and unit, or arguments"), rows)


def _name(node: ET.Element) -> str:
    return node.attrib.get("BrowseName", "").split(":", 1)[-1]


def _data_type(node: ET.Element) -> str:
    """Say the type of a variable; an array as `Double[]`."""
    return node.attrib.get("DataType", "") + ("[]" if node.attrib.get("ValueRank") == ARRAY else "")


def _unit(node: ET.Element | None) -> str:
    """Say the unit as people write it; 1 of a pure number."""
    if node is None:
        return ""
    told = node.findtext(f".//{TYPES}EUInformation/{TYPES}DisplayName/{TYPES}Text")
    return f"unit {told or 1}"


def _arguments(node: ET.Element | None) -> str:
    if node is None:
        return "none"
    told = []
    for argument in node.iter(f"{TYPES}Argument"):
        kind = argument.findtext(f"{TYPES}DataType/{TYPES}Identifier", "")
        said = argument.findtext(f"{TYPES}Description/{TYPES}Text", "")
        told.append(f"{code(argument.findtext(f'{TYPES}Name', ''))} ({DATA_TYPES[kind]}): {said}")
    return " ".join(told)
