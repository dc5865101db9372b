"""Variables, conditions and methods of a cell, from the NodeSet2 file that the server loads."""

import xml.etree.ElementTree as ET
from pathlib import Path

from generators.markdown import code, table

ROOT = Path(__file__).resolve().parents[2]
NODESET = ROOT / "impactcell" / "scada" / "model" / "ImpactCell.NodeSet2.xml"
UA = "{http://opcfoundation.org/UA/2011/03/UANodeSet.xsd}"
KINDS = ("UAVariable", "UAMethod")


def variables() -> str:
    """Write a row a node that has a description, in the order of the file."""
    rows = []
    for node in ET.parse(NODESET).getroot():  # our own file
        kind = node.tag.removeprefix(UA)
        description = node.findtext(f"{UA}Description", "")
        if kind not in KINDS or not description:
            continue
        name = node.attrib["BrowseName"].split(":", 1)[-1]
        rows.append(
            (code(name), kind.removeprefix("UA").lower(), node.attrib.get("DataType", ""), description)
        )
    return table(("browse name", "kind", "type", "description"), rows)
