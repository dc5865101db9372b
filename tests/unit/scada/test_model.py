"""The NodeSet2 file against the bindings of the code, by an XML parser that knows nothing of OPC UA."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import pytest

import impactcell
from impactcell.alarms import RULES
from impactcell.quantities import BY_PATH, CYCLE, HISTORY, MODULE
from impactcell.records.quantity import DataType
from impactcell.scada import nodeset as of_nodes
from impactcell.scada.nodeset import MODEL_FILE, next_free, nodeset

GAP = BY_PATH["Model/Gap"]
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


def test_every_number_has_one_node() -> None:
    text = nodeset()
    assert {number: names for number, names in of_nodes._names(text).items() if len(names) > 1} == {}
    assert f"i={next_free(text, 6000)}" not in text


@pytest.mark.parametrize(
    ("number", "taken_by"),
    [
        (6092, "ImpactCellType/StartBatch/InputArguments"),
        (6090, "ImpactCellType/Model/Gap/EURange"),
        (5016, "ImpactCells"),
        (1002, "ImpactCellAlarmType"),
    ],
)
def test_a_number_that_is_taken_is_refused_by_name(
    number: int, taken_by: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It made a file with two nodes of one NodeId, without a word."""
    following = next_free(nodeset(), number)
    value = replace(GAP, path="Model/Another", number=number, unit=None)
    monkeypatch.setattr(of_nodes, "CYCLE", (*CYCLE, value))
    with pytest.raises(SystemExit) as refused:
        of_nodes._main()
    told = str(refused.value.code)
    assert told.startswith(f"{number} is taken by ")
    assert taken_by in told
    assert "ImpactCellType/Model/Another" in told
    assert "a value in impactcell/quantities.py" in told
    assert told.endswith(f"the next free number is {following}")
    assert "Another" not in MODEL_FILE.read_text(encoding="utf-8")


def test_a_value_with_a_unit_takes_three_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    first = next_free(nodeset(), 6000)
    value = replace(GAP, path="Model/Another", number=first)
    monkeypatch.setattr(of_nodes, "CYCLE", (*CYCLE, value))
    assert next_free(nodeset(), 6000) == first + 3
    more = replace(value, path="Model/More", number=first + 2)
    monkeypatch.setattr(of_nodes, "CYCLE", (*CYCLE, value, more))
    with pytest.raises(ValueError, match=rf"{first + 2} is taken by .*/Another/EngineeringUnits and by"):
        nodeset()


def test_every_condition_watches_what_is_published() -> None:
    watched = {rule.input_node for rule in RULES.values() if rule.input_node}
    assert watched <= {quantity.path for quantity in (*CYCLE, *MODULE)}


def test_what_has_a_history_is_kept() -> None:
    for quantity in CYCLE:
        assert not quantity.has_history or (quantity.column and quantity.quality_column), quantity.path
        assert not quantity.has_history or quantity.data_type is DataType.DOUBLE, quantity.path
        assert (quantity.unit is None) == (quantity.eu_range is None), quantity.path
