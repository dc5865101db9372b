"""What the pages take from the code is all that there is."""

import json
import re
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from impactcell.alarms import RULES
from impactcell.fieldbus.registers import RegisterMap
from impactcell.process.exit_codes import ExitCode
from impactcell.quantities import CYCLE, HISTORY, MODULE
from impactcell.settings import schema
from tests.between_workers import computed_once

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def pages() -> Iterator[dict[str, str]]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "docs"))
        from generators import PAGES

        yield computed_once("generated-pages", lambda: {name: make() for name, make in PAGES.items()})


def test_every_room_is_drawn_once_and_below_what_imports_it(pages: dict[str, str]) -> None:
    drawn = re.findall(r">([\w ]+)</text>", pages["architecture.svg"])
    rooms = {path.parent.name for path in (ROOT / "impactcell").glob("*/__init__.py")}
    assert rooms <= set(drawn)
    assert len(drawn) == len(set(drawn))
    assert drawn.index("service") < drawn.index("cell") < drawn.index("physics") < drawn.index("records")
    edge = re.findall(r'fill="#dbeafe".*?>(\w+)</text>', pages["architecture.svg"])
    assert {"fieldbus", "service", "scada"} <= set(edge)
    assert not {"cell", "physics", "tracking", "records"} & set(edge)


def test_every_room_is_described_with_files_that_are_there() -> None:
    page = (ROOT / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`\w[^|]*) \|[^|]*\|([^|]*)\|$", page, flags=re.MULTILINE)
    described = {
        room: re.findall(r"`([^`]+)`", files)
        for rooms, files in rows
        for room in re.findall(r"`([\w.]+)`", rooms)
    }
    rooms = {path.parent.name for path in (ROOT / "impactcell").glob("*/__init__.py")}
    assert rooms | {"simulator", "errors.py", "quantities.py"} == set(described)
    for room, files in described.items():
        home = ROOT if room == "simulator" else ROOT / "impactcell"
        assert (home / room).exists(), room
        for file in files:
            assert (home / room / file).exists() or (home / file).exists(), (room, file)


def test_every_module_has_its_line(pages: dict[str, str]) -> None:
    for path in (ROOT / "impactcell").rglob("*.py"):
        if path.name != "__init__.py" and path.parent.name != "effects" and path.parent.name != "impactcell":
            assert f"{path.stem}` |" in pages["rooms.md"], path


def test_a_page_is_printed_in_a_checkout(
    pages: dict[str, str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    monkeypatch.setattr(sys, "argv", ["generators", "rooms.md"])
    runpy.run_module("generators", run_name="__main__")
    assert capsys.readouterr().out == pages["rooms.md"] + "\n"
    monkeypatch.setattr(sys, "argv", ["generators", "of_no_page.md"])
    with pytest.raises(SystemExit, match=r"name some of alarms\.md"):
        runpy.run_module("generators", run_name="__main__")


def test_a_page_that_includes_one_says_how_to_print_it(pages: dict[str, str]) -> None:
    for page in (ROOT / "docs").glob("*/*.md"):
        text = page.read_text(encoding="utf-8")
        for name in re.findall(r"\.\./_generated/([\w.]+)", text):
            assert re.search(rf"% .*-m generators\b.* {re.escape(name)}", text), (page, name)
            assert name in pages


def test_every_verb_is_listed(pages: dict[str, str]) -> None:
    for verb in ("demo", "run", "check", "estimate", "track", "discrepancy", "users add", "model accept"):
        assert f"## impactcell {verb}\n" in pages["command_line.md"]
    assert "| `--seed SEED` | Of the resampling. | `0` |" in pages["command_line.md"]
    assert "| `-o, --output DIR` | Where to write. | required |" in pages["command_line.md"]
    assert "[[" not in pages["command_line.md"]
    assert "| With `--base`: shots or batches that fit. |" in pages["command_line.md"]
    assert not re.search(r"--\w", re.sub(r"`[^`]*`", "", pages["command_line.md"])), "it is set as a dash"


def test_the_simulator_and_the_exit_codes_are_listed(pages: dict[str, str]) -> None:
    for verb in ("campaign", "serve"):
        assert f"## python -m simulator {verb}\n" in pages["command_line.md"]
    for exit_code in ExitCode:
        assert f"| {int(exit_code)} |" in pages["command_line.md"]


def test_every_key_of_a_cell_file_is_listed(pages: dict[str, str]) -> None:
    whole = json.loads(schema())
    for section in (whole, *whole["$defs"].values()):
        for key in section.get("properties", {}):
            assert f"| `{key}` |" in pages["cell_file.md"]


def test_nodes_and_conditions_are_listed(pages: dict[str, str]) -> None:
    for path in ("Friction/StaticFriction", "Wear/CyclesToLimitHigh", "Signature/TSquared", "StartBatch"):
        assert f"| `{path}` |" in pages["nodes.md"]
    marked = re.findall(r"^\| `([^`]+)` \| [^|]+ \| [^|]+, history \|", pages["nodes.md"], flags=re.MULTILINE)
    assert sorted(marked) == sorted(HISTORY)
    assert "`Expected` (Boolean)" in pages["nodes.md"], "arguments of methods, with their types"
    for path, typed in (("Signature/Position", r"Double\[\], unit mm"), ("<condition>/Statistic", "Double")):
        assert re.search(rf"^\| `{path}` \| [^|]+ \| {typed} \|", pages["nodes.md"], re.MULTILINE)
    for quantity in (*CYCLE, *MODULE):
        unit = "" if quantity.unit is None else f", unit {quantity.unit.symbol or 1}"
        assert re.search(
            rf"^\| `{quantity.path}` \| [^|]+ \| [\w\[\]]+{unit}(, history)? \|",
            pages["nodes.md"],
            re.MULTILINE,
        ), quantity.path
    for name, rule in RULES.items():
        assert f"| `{name}` | {rule.settings.severity} |" in pages["alarms.md"]
        row = next(row for row in pages["alarms.md"].splitlines() if row.startswith(f"| `{name}` |"))
        assert row.endswith("| yes |") == (rule.evaluate is not None), "whose delays the cell file sets"
    assert re.search(r"^\| `cycle_counter` \| 36 \| [^|]+ \| u32 \|", pages["register_map.md"], re.MULTILINE)


def test_a_register_is_listed_with_all_that_its_map_says(pages: dict[str, str]) -> None:
    rows = {row.split("`")[1]: row for row in pages["register_map.md"].splitlines() if row.startswith("| `")}
    assert "string, 8 registers" in rows["module_name"]
    assert "expect: IMPACT-FPGA" in rows["module_name"]
    assert "scale: 0.025; saturation: [-32767, 32767]; not_a_number: -32768" in rows["force"]
    assert "codes: 0 none, 1 executing, 2 done, 3 refused value" in rows["command_result"]


def test_registers_that_need_each_other_are_listed(pages: dict[str, str]) -> None:
    _, found, rest = pages["register_map.md"].partition("## What works only together")
    assert found
    (positioning,) = (row for row in rest.splitlines() if row.startswith("| positioning |"))
    registers = RegisterMap.from_mapping(
        yaml.safe_load((ROOT / "config" / "maps" / "fpga-v1.yaml").read_text(encoding="utf-8"))
    )
    told = set(re.findall(r"`(\w+)`", positioning))
    of_positioning = {
        name for name in registers.registers if re.match("positioning|command|target|part", name)
    }
    assert told == of_positioning - {"command_abort"}


def test_an_outside_request_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    from generators.offline import outside_requests

    page, style = tmp_path / "page.html", tmp_path / "style.css"
    page.write_text('<a href="https://example.org">link</a><script src="static/here.js"></script>')
    style.write_text("body { background: url(data:image/png;base64,AA) }")
    assert outside_requests(tmp_path) == []
    page.write_text('<script async src="https://cdn.example.org/there.js"></script>')
    style.write_text("@font-face { src: url('//fonts.example.org/a.woff2') }")
    assert len(outside_requests(tmp_path)) == 2
