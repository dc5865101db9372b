"""Another module: the page's examples are read, faults of a map have a place, cells of one line agree."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import ValidationError

from impactcell.errors import SettingsError
from impactcell.fieldbus.link import ModuleLink
from impactcell.fieldbus.map_promises import not_promised
from impactcell.fieldbus.register_map.map_registers import NAMES
from impactcell.fieldbus.register_map.map_validation import validate_map
from impactcell.fieldbus.registers import Register
from impactcell.settings import read_cell, read_cells
from impactcell.settings.cells import read_register_map
from impactcell.settings.judgement import judge_cell
from impactcell.settings.module_section import ModuleSection

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "how-to" / "another-module.md").read_text(encoding="utf-8")
BLOCKS = [
    yaml.safe_load(text) for text in re.findall(r"^```yaml\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
]
SHIPPED = ROOT / "config" / "maps" / "fpga-v1.yaml"


def cell_file(directory: Path, name: str = "press-1", **module: Any) -> Path:
    cell = {
        "format": 1, "cell": name, "alarms": {"wear_limit": 0.25},
        "module": {"register_map": str(SHIPPED), **module},
        "model": str(ROOT / "config" / "models" / "prototype.yaml"),
        "journal": {"file": f"{name}.sqlite"}, "web": None,
    }  # fmt: skip
    path = directory / f"{name}.yaml"
    path.write_text(yaml.safe_dump(cell))
    return path


def link_of(directory: Path, **module: Any) -> ModuleLink:
    return read_cell(cell_file(directory, **module)).settings.module.link


@pytest.mark.parametrize("block", [block["module"] for block in BLOCKS if "module" in block])
def test_the_links_of_the_page_are_links(block: dict[str, Any], tmp_path: Path) -> None:
    for file in ("plant.pem", "service.pem", "service.key"):
        (tmp_path / file).touch()
    link = link_of(tmp_path, **{**block, "register_map": str(SHIPPED)})
    assert link.transport == block["transport"]
    if link.transport == "rtu":
        assert str(link) == "/dev/ttyUSB0 at 115200 baud 8N2 device 3"
        assert link.serial is not None
        assert link.serial.character_s == pytest.approx(11 / 115_200)
    if link.tls is not None:
        assert link.tls.server_name == "press-1.plant"


def test_the_page_has_every_transport_but_the_plain_one() -> None:
    shown = {block["module"]["transport"] for block in BLOCKS if "module" in block}
    assert shown == {"rtu", "rtu_over_tcp", "udp", "tls"}


def test_the_registers_of_the_page_are_registers() -> None:
    poorer, entries = [block for block in BLOCKS if "module" not in block]
    validated = validate_map({"format": 1, "registers": poorer})
    assert (validated.faults, set(validated.constants)) == ([], {"velocity", "sample_rate"})
    validated = validate_map({"format": 1, "registers": entries})
    assert not validated.faults
    force = Register(**validated.registers["peak_force"])
    assert force.decode(force.encode(20.5)) == 20.5


@pytest.mark.parametrize(
    ("module", "told"),
    [
        (
            {"transport": "rtu"},
            r"`transport: rtu` needs `serial` in the place of `host` and `port`, as in `serial: \{device: ",
        ),
        (
            {"serial": {"device": "/dev/ttyS0"}},
            "`serial` belongs to `transport: rtu`, this is `transport: tcp`: say `transport: rtu`, or leave",
        ),
        ({"transport": "tls"}, "needs `tls` with its certificates"),
        ({"transport": "udp", "tls": {"ca_certificate": str(SHIPPED)}}, "does not go with"),
        ({"transport": "ascii"}, "transport"),
        ({"transport": "rtu", "serial": {"device": "x", "parity": "mark"}}, "parity"),
        (
            {"window": 16, "pause_between_requests_ms": 5.0},
            "`window: 16` sends so many requests at once, `pause_between_requests_ms: 5` lets the module",
        ),
        (
            {"transport": "udp", "window": 4},
            "`window: 4` belongs to `transport: tcp`; `udp` has one request in flight: leave it out",
        ),
        (
            {"transport": "rtu", "serial": {"device": "x"}, "device_id": 0},
            "`device_id: 0` asks all and is answered by none on a serial line; give the module's own, 1 to",
        ),
        (
            {"transport": "rtu", "serial": {"device": "x"}, "device_id": 248},
            "`device_id: 248` is reserved on",
        ),
        (
            {"tls": {"ca_certificate": str(SHIPPED), "key": str(SHIPPED)}},
            "`key` is of no use without `certificate`; name both, or leave it out",
        ),
    ],
)
def test_what_does_not_go_together_is_refused(module: dict[str, Any], told: str) -> None:
    with pytest.raises(ValidationError, match=told):
        ModuleSection.model_validate({"register_map": SHIPPED, **module})


@pytest.mark.parametrize(
    "module",
    [
        {"window": 1, "pause_between_requests_ms": 5.0},
        {"transport": "udp", "window": 1},
        {"transport": "rtu", "serial": {"device": "x"}, "device_id": 247},
        {"device_id": 255, "window": 64},
        {"transport": "rtu_over_tcp", "device_id": 0},
        {"tls": {"ca_certificate": str(SHIPPED), "certificate": str(SHIPPED)}},
    ],
)
def test_what_goes_together_is_taken(module: dict[str, Any]) -> None:
    ModuleSection.model_validate({"register_map": SHIPPED, **module})


def test_cells_behind_one_gateway_have_one_request_in_flight(tmp_path: Path) -> None:
    first = cell_file(tmp_path, "a", window=16)
    with pytest.raises(SettingsError) as caught:
        read_cells([first, cell_file(tmp_path, "b", device_id=2, window=1)])
    told = (
        f"`window: 16` is for a module with an endpoint of its own; {tmp_path / 'b.yaml'} is behind the same"
    )
    assert str(caught.value).startswith(f"{first}:")
    assert told in str(caught.value)
    elsewhere = cell_file(tmp_path, "c", port=503, window=16)
    assert len(read_cells([first, elsewhere])) == 2


@pytest.mark.slow
def test_cells_of_one_line_agree_about_it(tmp_path: Path) -> None:
    line = {"device": "/dev/ttyUSB0", "baudrate": 19_200}
    first = cell_file(tmp_path, "a", transport="rtu", serial=line)
    second = cell_file(tmp_path, "b", transport="rtu", serial=line, device_id=2)
    assert len(read_cells([first, second])) == 2
    faster = cell_file(tmp_path, "c", transport="rtu", serial={**line, "baudrate": 9600}, device_id=3)
    with pytest.raises(
        SettingsError, match=r"has another module\.serial; they share one connection: give both the same$"
    ):
        read_cells([first, faster])
    other_line = cell_file(tmp_path, "d", transport="rtu", serial={"device": "/dev/ttyUSB1"})
    assert len(read_cells([first, other_line])) == 2


def test_faults_of_a_map_have_line_and_column(tmp_path: Path) -> None:
    text = SHIPPED.read_text().replace("{address: 36, type: u32,", "{address: 36, type: u33,")
    text = text.replace("  window_cycle:", "  window_cicle:")
    path = tmp_path / "wrong.yaml"
    path.write_text(text)
    with pytest.raises(SettingsError) as caught:
        read_register_map(path)
    lines = text.splitlines()
    at = lines.index("  cycle_counter:") + 1
    said = str(caught.value).splitlines()
    assert any(line.startswith(f"{path}:{at}:3: register cycle_counter: type must be") for line in said)
    at = lines.index("registers:") + 1
    missing = "register window_cycle is missing: the window shows the cycle that was asked for"
    assert any(line.startswith(f"{path}:{at}:1: {missing}") for line in said)


def test_what_a_map_does_not_promise_and_what_nothing_uses_is_told(tmp_path: Path) -> None:
    content = yaml.safe_load(SHIPPED.read_text())
    del content["registers"]["capture_crc32"]
    content["registers"]["peak_forse"] = content["registers"].pop("peak_force")
    path = tmp_path / "poorer.yaml"
    path.write_text(yaml.safe_dump(content))
    told = [str(finding) for finding in judge_cell(read_cell(cell_file(tmp_path, register_map=str(path))))]
    assert any("note: fpga-v1: register peak_forse is not used; did you mean peak_force?" in t for t in told)
    assert any(
        "no register capture_crc32: a wrong bit in header or samples is not noticed" in t for t in told
    )


def _said_of_positioning(tmp_path: Path, content: dict[str, Any]) -> list[str]:
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(content))
    path = cell_file(tmp_path, register_map=str(tmp_path / "map.yaml"))
    cell = yaml.safe_load(path.read_text()) | {"positioning": {"travel_mm": 40.0}, "part": {"mass_kg": 18.9}}
    path.write_text(yaml.safe_dump(cell))
    return [str(found) for found in judge_cell(read_cell(path)) if found.section == "positioning"]


def test_what_a_cell_that_places_parts_lacks_in_its_map_is_a_fault(tmp_path: Path) -> None:
    content = yaml.safe_load(SHIPPED.read_text())
    assert _said_of_positioning(tmp_path, content) == []
    registers = content["registers"]
    registers["positioning_state"]["codes"] = {1: "bereit", 2: "belegt"}
    for name in ("target_sequence", "command_velocity", "command_abort"):
        del registers[name]
    state, missing = sorted(_said_of_positioning(tmp_path, content))
    assert "map fpga-v1: no code of register positioning_state is called `ready`: every tap would" in state
    assert "map fpga-v1: no registers target_sequence, command_velocity: no part can be placed" in missing
    del registers["command_result"], registers["positioning_state"]
    (missing,) = _said_of_positioning(tmp_path, content)
    assert "no registers positioning_state, command_result, target_sequence, command_velocity: no" in missing


def test_registers_that_command_coarse_taps_or_none_are_told(tmp_path: Path) -> None:
    content = yaml.safe_load(SHIPPED.read_text())
    registers = content["registers"]
    registers["command_velocity"] |= {"type": "u16", "unit": "mm/s", "scale": 0.1}
    registers["command_stroke"] |= {"type": "u16", "unit": "um"}
    assert _said_of_commands(tmp_path, content) == []
    registers["command_stroke"] |= {"unit": "mm", "scale": 0.1}
    (steps,) = _said_of_commands(tmp_path, content)
    assert (
        "note: taps are planned in whole steps, 6 mm/min of register command_velocity and 0.1 mm of register "
        "command_stroke: with a tolerance of 50 µm tasks may take more of them, and parts may stay outside"
    ) in steps
    registers["command_velocity"] |= {"scale": 0.001}
    registers["command_stroke"] |= {"scale": 2.0}
    none, ends = (text for text in _said_of_commands(tmp_path, content) if "whole steps" not in text)
    assert "register command_stroke has no value between 0 and 1.5 mm: no tap can be commanded" in none
    assert "note: " not in none
    registers["command_stroke"] |= {"scale": 1.0, "offset": -1e6}  # no code of it is above 0
    assert any(
        "command_stroke has no value between 0 and 1.5" in t for t in _said_of_commands(tmp_path, content)
    )
    registers["command_stroke"] |= {"scale": 2.0, "offset": 0.0}
    assert "note: register command_velocity ends at 3932.1 mm/min: no tap is commanded from there to" in ends


def _said_of_commands(tmp_path: Path, content: dict[str, Any]) -> list[str]:
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(content))
    path = cell_file(tmp_path, register_map=str(tmp_path / "map.yaml"))
    cell = yaml.safe_load(path.read_text()) | {"positioning": {"travel_mm": 40.0}}
    path.write_text(yaml.safe_dump(cell))
    return [
        str(found)
        for found in judge_cell(read_cell(path))
        if re.search("whole steps|register command_", found.message)
    ]


def test_a_map_without_an_abort_is_told_where_parts_are_placed(tmp_path: Path) -> None:
    content = yaml.safe_load(SHIPPED.read_text())
    del content["registers"]["command_abort"]
    (said,) = _said_of_positioning(tmp_path, content)
    assert "no register command_abort: a tap that is executed cannot be aborted" in said


def test_the_shipped_map_promises_all_and_has_no_name_that_nothing_uses() -> None:
    assert not_promised(read_register_map(SHIPPED)) == ()
    maps = [read_register_map(file) for file in SHIPPED.parent.glob("*.yaml")]
    assert {name for each in maps for name in (*each.registers, *each.constants)} == set(NAMES)
