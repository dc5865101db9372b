"""The NodeSet2 file against the bindings of the code, by an XML parser that knows nothing of OPC UA."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

import impactcell
from impactcell.alarms import RULES
from impactcell.quantities import CYCLE, HISTORY, MODULE
from impactcell.scada.nodeset import MODEL_FILE, nodeset

MODEL = Path(impactcell.__file__).parent / "scada" / "model"
NS = "{http://opcfoundation.org/UA/2011/03/UANodeSet.xsd}"


@pytest.fixture(scope="module")
def nodes() -> list[ET.Element]:
    root = ET.parse(MODEL / "ImpactCell.NodeSet2.xml").getroot()
    return [element for element in root if element.get("NodeId")]


def _name(element: ET.Element) -> str:
    return element.get("BrowseName", "").partition(":")[2] or element.get("BrowseName", "")


def test_every_variable_is_bound_and_every_binding_has_a_variable(nodes: list[ET.Element]) -> None:
    by_id = {element.get("NodeId"): element for element in nodes}
    cell = next(element for element in nodes if _name(element) == "ImpactCellType")
    folders = {
        element.get("NodeId"): _name(element)
        for element in nodes
        if element.tag == f"{NS}UAObject" and element.get("ParentNodeId") == cell.get("NodeId")
    }
    found = {
        f"{folders[parent]}/{_name(element)}"
        for element in nodes
        if element.tag == f"{NS}UAVariable" and (parent := element.get("ParentNodeId")) in folders
    }
    assert found == {quantity.path for quantity in (*CYCLE, *MODULE)}
    assert set(HISTORY) <= found
    assert len(by_id) == len(nodes), "a NodeId is there twice"


def test_every_node_has_a_description(nodes: list[ET.Element]) -> None:
    assert [_name(e) for e in nodes if not (e.findtext(f"{NS}Description") or "").strip()] == []


def test_every_condition_has_its_type(nodes: list[ET.Element]) -> None:
    names = {_name(element) for element in nodes}
    assert set(RULES) | {f"{name}AlarmType" for name in RULES} <= names


def test_references_inside_the_file_lead_somewhere(nodes: list[ET.Element]) -> None:
    ids = {element.get("NodeId") for element in nodes}
    for element in nodes:
        for reference in element.iter(f"{NS}Reference"):
            target = reference.text or ""
            assert not target.startswith("ns=1;") or target in ids, (element.get("NodeId"), target)


def test_the_file_is_what_the_tables_say() -> None:
    assert MODEL_FILE.read_text(encoding="utf-8") == nodeset(), "run python -m impactcell.scada.nodeset"


def test_every_condition_watches_what_is_published() -> None:
    watched = {rule.input_node for rule in RULES.values() if rule.input_node}
    assert watched <= {quantity.path for quantity in (*CYCLE, *MODULE)}


def test_what_has_a_history_is_kept() -> None:
    for quantity in CYCLE:
        assert not quantity.has_history or (quantity.column and quantity.quality_column), quantity.path
        assert (quantity.unit is None) == (quantity.eu_range is None), quantity.path
