"""A cell file is understood whole, or every fault of it is told at once, with its place."""

import json
import re
import shutil
from pathlib import Path

import pytest

from impactcell.errors import SettingsError
from impactcell.settings import read_cell, read_cells, schema

CONFIG = Path(__file__).resolve().parents[3] / "config"


@pytest.fixture
def config(tmp_path: Path) -> Path:
    shutil.copytree(CONFIG, tmp_path / "config")
    return tmp_path / "config"


def edited(config: Path, old: str, new: str, name: str = "edited") -> Path:
    text = (config / "cells" / "prototype.yaml").read_text()
    assert old in text
    path = config / "cells" / f"{name}.yaml"
    path.write_text(text.replace(old, new))
    return path


@pytest.mark.parametrize("path", sorted((CONFIG / "cells").glob("*.yaml")), ids=lambda path: path.stem)
def test_shipped_cells_are_in_order(path: Path) -> None:
    assert read_cell(path).name


def test_every_fault_at_once_with_its_place(config: Path) -> None:
    path = config / "cells" / "bad.yaml"
    path.write_text(
        "format: 1\ncell: press 1\nmodule:\n  porrt: 502\n  register_map: maps/none.yaml\n  window: 1000\n"
        "model: m.yaml\nalarms: {wear_limit: -1}\njournal: {file: nowhere/x.sqlite}\nopcua: {endpoint: 'http://x'}\n"
    )
    with pytest.raises(SettingsError) as caught:
        read_cell(path)
    places = [line.removeprefix(f"{path}:").split(" ")[0] for line in str(caught.value).splitlines()]
    assert places == ["2:7:", "4:3:", "5:17:", "6:11:", "7:8:", "8:22:", "9:17:", "10:19:"]
    for hint in (
        "did you mean 'port'",
        "as in press-1",
        "there is no file",
        "`impactcell init` writes a first model",
        "no directory",
        "opc.tcp://127.0.0.1",
    ):
        assert hint in str(caught.value)


@pytest.mark.parametrize(
    "host", ["10.0.0.5", "press-1.local", "press-1.", "a" * 63, "fpga_2", "::1", "fe80::1%eth0", "prüfstand"]
)
def test_a_name_or_an_address_is_a_host(config: Path, host: str) -> None:
    assert read_cell(edited(config, "host: 127.0.0.1", f"host: '{host}'")).settings.module.host == host


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        (
            "port: 15020",
            "port: '15020'",
            "module.port: should be a valid integer, not '15020'; leave out the quotes: 15020",
        ),
        (
            "host: 127.0.0.1",
            "host: http://10.0.0.5",
            "6:9: module.host: a host is a name or an address alone: write `host: 10.0.0.5`",
        ),
        ("host: 127.0.0.1", "host: 10.0.0.5:503", "write `host: 10.0.0.5` and `port: 503`"),
        ("host: 127.0.0.1", "host: '[fe80::1]:503/modbus'", "write `host: fe80::1` and `port: 503`"),
        ("host: 127.0.0.1", "host: ' press-1'", "write `host: press-1`"),
        ("host: 127.0.0.1", "host: the module", "write it as in `host: 10.0.0.5`"),
        ("host: 127.0.0.1", "host: 10.0.0.256", "write it as in `host: 10.0.0.5`"),
        ("host: 127.0.0.1", "host: ''", "write it as in `host: 10.0.0.5`"),
        (
            "host: 127.0.0.1",
            "host: press-1..plant",
            "6:9: module.host: a host's name has 1 to 63 characters between its dots, as in press-1.local",
        ),
        ("host: 127.0.0.1", f"host: {'a' * 64}.plant", "module.host: a host's name has 1 to 63 characters"),
        ("host: 127.0.0.1", f"host: {'ü' * 60}", "module.host: a host's name has 1 to 63 characters"),
        (
            "host: 127.0.0.1",
            "host: 127.0.0.1\n  tls: {ca_certificate: ../models/prototype.yaml, server_name: press-1..plant}",
            "server_name: a host's name has 1 to 63 characters between its dots",
        ),
        ("wear_limit: 0.25", "wear_limit: 0,25", "not '0,25'; decimals have a point, not a comma: 0.25"),
        (
            "  stroke_mm: 1.5",
            "  {stroke_mm: 1,5}",
            "5 stands where a key should; decimals have a point, not a comma",
        ),
        ("cell: prototype", "cell: prüfstand", r"letters \(a to z\)"),
        ("port: 15020", "port: 70000", "less than or equal to 65535"),
        ("wear_limit: 0.25", "wear_limit: .nan", "finite"),
        ("wear_limit: 0.25", "wear_limit: 0.2\n  wear_limit: 0.3", "twice"),
        (
            "wear_limit: 0.25",
            "wear_limit: 0.2\n  wear_probability_on: 0.4",
            "wear_probability_off must be below",
        ),
        (
            "wear_limit: 0.25",
            "wear_limit: 0.2\n  wear_warning_probability_off: 0.9",
            "wear_warning_probability_off must be below",
        ),
        ("wear_limit: 0.25", "wear_limit: 0.2\n  wear_warning_cycles: -1", "wear_warning_cycles"),
        (
            "format: 1",
            "format: 1\npositioning: {tolerance_um: 0.5}",
            "tolerance_um 0.5 is finer than encoder_resolution_um 1: raise it",
        ),
        (
            "format: 1",
            "format: 1\npositioning: {tolerance_um: 50, travel_mm: 0.04}",
            r"travel_mm 0.04 is 40 µm, no more than .* \(tolerance_um 50\): check the units of both",
        ),
        ("format: 1", "format: 1\npositioning: {tolerance_um: 50000}", "tolerance_um.* 5000"),
        ("format: 1", "format: 2", "format"),
        ("cell: prototype", "cell: 7", "valid string"),
        ("../models/prototype.yaml", "none.yaml", "no file"),
        ("../models/prototype.yaml", "../maps/fpga-v1.yaml", "model: .* is a register map, not a model"),
        ("../maps/fpga-v1.yaml", "../models/prototype.yaml", "prototype.yaml"),
        ("format: 1", "format: 1\n\tcell: x", "4:1: a tab; YAML is indented with spaces"),
    ],
)
def test_one_fault(config: Path, old: str, new: str, complaint: str) -> None:
    with pytest.raises(SettingsError, match=complaint):
        read_cell(edited(config, old, new))


@pytest.mark.parametrize(
    "endpoint", ["opc.tcp://", "opc.tcp://h:notaport", "opc.tcp://h:99999", "http://h:1", "h:1"]
)
def test_an_endpoint_that_could_not_be_listened_on(config: Path, endpoint: str) -> None:
    with pytest.raises(SettingsError, match="has host and port"):
        read_cell(edited(config, "cell: prototype", f"cell: prototype\nopcua: {{endpoint: '{endpoint}'}}"))


def test_faults_of_cell_map_and_model_at_once(config: Path) -> None:
    (config / "maps" / "bad.yaml").write_text("format: 1\nname: bad\nregisters: {}\n")
    (config / "models" / "bad.yaml").write_text("format: 1\nname: 7\n")
    path = config / "cells" / "bad.yaml"
    path.write_text(
        "format: 1\ncell: c\nmodule: {register_map: ../maps/bad.yaml, window: 1000}\n"
        "model: ../models/bad.yaml\nalarms: {wear_limit: 0.2}\n"
    )
    with pytest.raises(SettingsError) as caught:
        read_cell(path)
    for file in (path, config / "maps" / "bad.yaml", config / "models" / "bad.yaml"):
        assert file.name in str(caught.value)
    assert "maps/bad.yaml" in str(caught.value)
    assert "models/bad.yaml" in str(caught.value)


@pytest.mark.parametrize(
    ("host", "is_same"),
    [("localhost", True), ("'::1'", True), ("0x7f.1", True), ("127.0.0.2", False), ("press-1", False)],
)
def test_one_module_is_one_however_its_address_is_written(
    config: Path, monkeypatch: pytest.MonkeyPatch, host: str, is_same: bool
) -> None:
    """And nobody is asked for a name, which may be another's tomorrow."""
    monkeypatch.delattr("socket.getaddrinfo")
    first = edited(config, "host: 127.0.0.1", "host: 127.0.0.1", "first")
    second = edited(config, "cell: prototype", "cell: other", "second")
    second.write_text(second.read_text(encoding="utf-8").replace("host: 127.0.0.1", f"host: {host}"))
    said = ""
    try:
        read_cells([first, second])
    except SettingsError as fault:
        said = str(fault)
    assert ("same module and register map" in said) == is_same


@pytest.mark.slow
def test_cells_of_one_process_do_not_share_what_is_one_cells(config: Path) -> None:
    journal = f"cell: prototype\njournal: {{file: {config / 'one.sqlite'}}}"
    first = edited(config, "cell: prototype", journal, "first")
    second = edited(
        config,
        "cell: prototype",
        journal.replace("prototype", "other") + "\nopcua: {max_sessions: 3}",
        "second",
    )
    with pytest.raises(SettingsError) as caught:
        read_cells([first, second])
    assert "same journal file" in str(caught.value)
    assert "same module and register map" in str(caught.value)
    assert "same endpoint" in str(caught.value)
    for place, way_out in (
        ("3:12", "change host, port or device_id of one, or give one another register_map"),
        ("2:17", "a journal belongs to one cell: name another file"),
        ("1:1", "opcua.max_sessions is 3 here and 100 there; cells at one port share one server: give both"),
    ):
        assert any(place and way_out in line for line in str(caught.value).splitlines())
    namesake = edited(config, "port: 15020", "port: 15021", "namesake")
    told = r"namesake.yaml:4:7: cell 'prototype' is in .*first.yaml too; rename one"
    with pytest.raises(SettingsError, match=told):
        read_cells([first, namesake])
    with pytest.raises(SettingsError, match=r"first.yaml: is given twice; name it once$"):
        read_cells([first, first])
    assert [cell.name for cell in read_cells([first])] == ["prototype"]


def test_cells_begun_in_two_directories_are_told_which_settings_differ(config: Path) -> None:
    """Their users and certificates lie beside each: what differs stood nowhere, nor where to change it."""
    for name, port in (("first", 15021), ("second", 15022)):
        path = edited(config, "port: 15020", f"port: {port}", name)
        directory = config / name
        directory.mkdir()
        text = path.read_text().replace("cell: prototype", f"cell: {name}").replace("../", "../../")
        if name == "second":
            text += "opcua: {users_file: users.yaml, certificates_dir: pki}\n"
        text = text.replace("../../maps", "../maps").replace("../../models", "../models")
        (directory / f"{name}.yaml").write_text(text)
    cells = [config / "first" / "first.yaml", config / "second" / "second.yaml"]
    with pytest.raises(SettingsError) as caught:
        read_cells(cells)
    line = len(cells[1].read_text().splitlines())
    there, here = config / "first", config / "second"
    page, server = str(caught.value).splitlines()
    assert page == (
        f"{cells[1]}:{line}:21: {cells[0]} is on the same page (web.endpoint), but has another "
        f"opcua.users_file ({here}/users.yaml here, {there}/users.yaml there); give both the same, or one a "
        "web.endpoint of its own"
    )
    assert server == (
        f"{cells[1]}:{line}:21: {cells[0]} has the same endpoint, but other opcua settings: "
        f"opcua.users_file is {here}/users.yaml here and {there}/users.yaml there, "
        f"opcua.certificates_dir is {here}/pki here and {there}/pki there; "
        "cells at one port share one server: give both the same, or one an opcua.endpoint of another port"
    )


@pytest.mark.parametrize(
    ("sections", "told"),
    [
        (
            "monitoring: {port: 8480}",
            "20:20: monitoring.port and web.endpoint are both port 8480; change one",
        ),
        ("monitoring: {port: 4840, host: 0.0.0.0}", "monitoring.port and opcua.endpoint are both port 4840"),
        (
            "web: {endpoint: 'http://127.0.0.1:4840'}",
            "20:17: opcua.endpoint and web.endpoint are both port 4840; change one",
        ),
    ],
)
def test_two_listeners_at_one_port(config: Path, sections: str, told: str) -> None:
    """`check` found such a cell in order; `run` said that the port was taken, by the same cell."""
    path = edited(config, "wear_limit: 0.25", f"wear_limit: 0.25\n{sections}")
    with pytest.raises(SettingsError, match=re.escape(told)):
        read_cells([path])
    read_cells([edited(config, "wear_limit: 0.25", "wear_limit: 0.25\nmonitoring: {port: 0}", "any")])


def test_listeners_of_two_cells_at_one_port(config: Path) -> None:
    first = edited(config, "wear_limit: 0.25", "wear_limit: 0.25\nmonitoring: {port: 8481}", "first")
    other = "wear_limit: 0.25\nweb: {endpoint: 'http://127.0.0.1:8481'}"
    second = edited(config, "wear_limit: 0.25", other, "second")
    with pytest.raises(
        SettingsError, match=r"web.endpoint and monitoring.port of .*first.yaml are both port 8481"
    ):
        read_cells([first, second])


def test_word_order_of_the_cell_takes_the_place_of_the_maps(config: Path) -> None:
    plain = read_cell(config / "cells" / "prototype.yaml").register_map
    turned = read_cell(edited(config, "port: 15020", "port: 15020\n  word_order: little")).register_map
    value = plain["cycle_counter"].encode(1)
    assert list(turned["cycle_counter"].encode(1)) == list(value)[::-1]


def test_every_key_of_the_schema_says_what_it_means() -> None:
    document = json.loads(schema())
    for name, section in {"CellSettings": document, **document["$defs"]}.items():
        for key, entry in section["properties"].items():
            assert "description" in entry or "$ref" in json.dumps(entry) or key == "format", f"{name}.{key}"
