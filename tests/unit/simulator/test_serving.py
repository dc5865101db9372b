"""Scenario files, and the simulator as a process of its own."""

import itertools
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.errors import SettingsError
from simulator.__main__ import main
from simulator.scenario import read_scenario
from simulator.serving import read_register_map
from tests.certificates import Authority
from tests.patience import PATIENCE_S

CONFIG = Path(__file__).parents[3] / "config"
GOOD = "format: 1\nregister_map: m.yaml\nstrikes: {period_s: 1}\n"


@pytest.mark.parametrize("name", ["prototype", "demo", "new-effect", "positioning"])
def test_the_scenarios_that_come_with_it(name: str) -> None:
    scenario = read_scenario(CONFIG / "sim" / f"{name}.yaml")
    assert read_register_map(CONFIG / "sim" / scenario.register_map).name == "fpga-v1"
    assert (scenario.strikes is None) == (name == "positioning")


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("", "1:1", "is empty"),
        ("format: 1\n  x: 2\n", "2:4", "indent the line as its neighbours"),
        ("format: 1\nformat: 1\n", "2:1", "is given twice"),
        ("format: 1\nstrikes: {period_s: 1}\n", "1:1", "'register_map' is missing"),
        ("format: 1\nregister_map: m.yaml\n", "1:1", "give either `strikes`"),
        (GOOD + "positioning: {}\n", "1:1", "give either `strikes`"),
        (GOOD + "speed: 1\n", "4:1", "unknown key 'speed'"),
        (GOOD + "listen: {port: 70000}\n", "4:16", "listen.port: "),
        (GOOD + "part: {mass_kg: heavy}\n", "4:17", "part.mass_kg: "),
        (GOOD + "acceleration: 0\n", "4:15", "acceleration: "),
        (GOOD + "plant:\n  effects:\n    wind: {}\n", "6:5", "unknown effect 'wind'"),
        (
            GOOD + "plant: {effects: {surface_tilt: {a: 1.0}}}\n",
            "4:18",
            "surface_tilt has no parameter 'a'",
        ),
        (GOOD + "batches: [{from_cycle: 2, id: A}]\n", "1:1", "the first begins with cycle 1"),
        (GOOD + "deviations: [{cycle: 1, kind: dent, size: 1.0}]\n", "4:31", "deviations[0].kind: "),
    ],
)
def test_faults_of_a_scenario(tmp_path: Path, text: str, place: str, message: str) -> None:
    file = tmp_path / "s.yaml"
    file.write_text(text)
    with pytest.raises(SettingsError) as caught:
        read_scenario(file)
    assert str(caught.value).startswith(f"{file}:{place}:")
    assert message in str(caught.value)


@settings(max_examples=150, deadline=None)
@given(
    text=st.one_of(
        st.text(max_size=60),
        st.text(alphabet="format: 1{}[]&*!<>|\n\t-ae.", max_size=60).map(lambda text: GOOD + text),
    )
)
def test_any_scenario_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    file = tmp_path_factory.mktemp("fuzz") / "s.yaml"
    file.write_text(text, encoding="utf-8", errors="ignore")
    try:
        read_scenario(file)
    except SettingsError as error:
        message = str(error)
    else:
        return
    assert str(file) in message


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    ["a: !!int x\n", "[" * 5000, "a: &a [*a]\n", "1: 2\n", "? [1]\n: 2\n", "a: &a [1,1,1,1,1,1,1,1,1]\n"],
)
def test_odd_yaml_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "s.yaml"
    if "1,1" in text:
        text += "".join(
            f"{b}: &{b} [{','.join([f'*{a}'] * 9)}]\n" for a, b in itertools.pairwise("abcdefghi")
        )
    file.write_text(text)
    with pytest.raises(SettingsError, match=r"s\.yaml:"):
        read_scenario(file)


def test_all_faults_of_a_scenario_at_once(tmp_path: Path) -> None:
    file = tmp_path / "s.yaml"
    file.write_text(GOOD + "a: 1\nb: 2\nseed: -1\n")
    with pytest.raises(SettingsError) as caught:
        read_scenario(file)
    assert len(str(caught.value).splitlines()) == 3


def test_missing_files_end_with_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["serve", str(tmp_path / "absent.yaml")]) == 2
    assert "cannot be read" in capsys.readouterr().err
    file = tmp_path / "s.yaml"
    file.write_text(GOOD)
    assert main(["serve", str(file)]) == 2
    assert "m.yaml: cannot be read" in capsys.readouterr().err
    (tmp_path / "m.yaml").write_text("format: 1\nname: x\nregisters: {}\n")
    assert main(["serve", str(file)]) == 2
    assert "register cycle_counter is missing" in capsys.readouterr().err


@pytest.fixture
def taken_port() -> Iterator[str]:
    """A port at which nothing can listen: a scenario that is not refused ends there, and does not serve."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        yield str(taken.getsockname()[1])


UNSIGNED = {
    name: {"address": address, "type": "u16"}
    for name, address in (("mass", 30), ("direction", 31), ("serial_number", 32))
}
"""Registers of a map in which no text and nothing below 0 can stand."""


@pytest.mark.parametrize(
    ("layout", "text", "told"),
    [
        *(
            (
                "summary",
                f"faulty_captures: [{{cycle: 1, kind: empty}}, {{cycle: 2, kind: @{kind}}}]",
                f"`faulty_captures[1]` ({kind}) is one of the force, and the register map has no `force`",
            )
            for kind in ("constant_force", "saturated", "no_separation", "not_a_number")
        ),
        (
            "one-buffer",
            "faulty_captures: [{cycle: 2, kind: @not_a_number}]",
            "`faulty_captures[0].kind` cannot be shown: register force has no code for a value that is not a",
        ),
        (
            "summary",
            "faults: [{at_s: 1, kind: set_counter, value: @70000}]",
            "`faults[0].value` cannot be shown: register cycle_counter: value outside 0..65535; change it",
        ),
        (
            "summary",
            "batches: [{from_cycle: 1, id: A}, {from_cycle: 9, id: @twenty-characters-it}]",
            "`batches[1].id` cannot be shown: register batch_id: 20 bytes do not fit 8 registers",
        ),
        (
            "fpga-v1",
            f"batches: [{{from_cycle: 1, id: @{'ü' * 17}}}]",
            "register batch_announced: 34 bytes do not fit 16 registers",
        ),
        ("fpga-v1", "serial_number: @Prüfstand-Süd-1", "serial_number: 17 bytes do not fit 8 registers"),
        (
            "unsigned",
            "part: {mass_stated: @false}",
            "`part.mass_stated` cannot be shown: register mass has no",
        ),
        (
            "unsigned",
            "strikes: {directions: @[1, -1]}",
            "`strikes.directions` cannot be shown: register direc",
        ),
        ("unsigned", "serial_number: @ABC", "register serial_number is a number, not 'ABC'"),
        (
            "nameless",
            "positioning: @{directions: [1]}",
            "`positioning` cannot be shown: register command_result has no code named 'done' or 'executing'",
        ),
    ],
)
def test_what_a_map_cannot_show_is_told_before_anything_is_served(
    tmp_path: Path, layout: str, text: str, told: str, taken_port: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """`@` marks the place that is told."""
    shipped = {"unsigned": "summary", "nameless": "fpga-v1"}.get(layout, layout)
    content = yaml.safe_load((CONFIG / "maps" / f"{shipped}.yaml").read_text())
    content["registers"] |= UNSIGNED if layout == "unsigned" else {}
    if layout == "nameless":
        content["registers"]["command_result"]["codes"] = {7: "refused value"}
    (tmp_path / "m.yaml").write_text(yaml.safe_dump(content))
    file = tmp_path / "s.yaml"
    good = (
        GOOD
        if text.split(":", maxsplit=1)[0] not in ("strikes", "positioning")
        else GOOD.replace("strikes: {period_s: 1}\n", "")
    )
    file.write_text(good + text.replace("@", "") + "\n")
    assert main(["serve", str(file), "--port", taken_port]) == 2
    place = f"{file}:{good.count(chr(10)) + 1}:{text.index('@') + 1}: "
    lines = capsys.readouterr().err.splitlines()
    assert any(line.startswith(place) and told in line for line in lines), lines


def test_a_batch_that_the_plc_does_not_announce_fits_every_map(
    tmp_path: Path, taken_port: str, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (
        f"batches: [{{from_cycle: 1, id: {'A' * 16}}}, {{from_cycle: 2, id: {'x' * 99}, announced: false}}]\n"
    )
    file = tmp_path / "s.yaml"
    file.write_text(GOOD.replace("m.yaml", str(CONFIG / "maps" / "summary.yaml")) + text)
    assert main(["serve", str(file), "--port", taken_port]) == 1
    assert "cannot listen" in capsys.readouterr().err


def test_a_wait_for_what_the_map_does_not_have_is_told_with_its_place(
    tmp_path: Path, taken_port: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "s.yaml"
    maps = str(CONFIG / "maps" / "summary.yaml")
    file.write_text(GOOD.replace("m.yaml", maps).replace("period_s: 1", "ahead: 8"))
    assert main(["serve", str(file), "--port", taken_port]) == 2
    assert capsys.readouterr().err.startswith(
        f"{file}:3:18: `strikes.ahead` waits until cycles are acknowledged"
    )


def test_certificates_lie_where_the_scenario_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, taken_port: str, capsys: pytest.CaptureFixture[str]
) -> None:
    certificate, key = Authority(tmp_path, "plant").issue("module")
    file, elsewhere = tmp_path / "s.yaml", tmp_path / "elsewhere"
    listen = f"listen: {{transport: tls, certificate: {certificate.name}, key: {key.name}}}\n"
    good = GOOD.replace("m.yaml", str(CONFIG / "maps" / "summary.yaml"))
    file.write_text(good + listen)
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    assert main(["serve", str(file), "--port", taken_port]) == 1
    assert "--port chooses another" in capsys.readouterr().err
    file.write_text(good + listen.replace(key.name, "absent.key"))
    assert main(["serve", str(file), "--port", taken_port]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"{file}:4:{listen.index(key.name) + 1}: listen.key: ")
    assert f"{tmp_path / 'absent.key'} cannot be read: No such file or directory" in told


def read_registers(port: int, address: int, count: int) -> bytes:
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as link:
        link.sendall(bytes([0, 1, 0, 0, 0, 6, 1, 3]) + address.to_bytes(2, "big") + count.to_bytes(2, "big"))
        reply = b""
        while len(reply) < 9 + 2 * count:
            part = link.recv(1024)
            assert part, reply
            reply += part
    return reply[9:]


@pytest.mark.slow
@pytest.mark.parametrize(("how", "code"), [(signal.SIGTERM, 0), (signal.SIGINT, 130)])
def test_serves_until_it_is_told_to_stop(tmp_path: Path, how: signal.Signals, code: int) -> None:
    scenario = (CONFIG / "sim" / "demo.yaml").read_text().replace("../maps", str(CONFIG / "maps"))
    (tmp_path / "s.yaml").write_text(scenario + "acceleration: 20\n")
    truth = tmp_path / "truth.jsonl"
    command = [sys.executable, "-m", "simulator", "serve", str(tmp_path / "s.yaml"), "--truth", str(truth)]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, cwd=CONFIG.parent
    ) as process:
        try:
            assert process.stdout is not None
            started = json.loads(process.stdout.readline())
            assert started["cell"] == "demo"
            assert read_registers(started["port"], 0, 8).rstrip(b"\0") == b"IMPACT-FPGA"
            while int.from_bytes(read_registers(started["port"], 36, 2), "big") < 3:
                pass
        finally:
            process.send_signal(how)
            out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == code
    assert (out, err) == ("", "")
    lines = [json.loads(line) for line in truth.read_text().splitlines()]
    assert [line["cycle"] for line in lines] == list(range(1, len(lines) + 1))
    assert len(lines) >= 3
    assert lines[0]["mu_s"] == pytest.approx(0.2, rel=0.05)


@pytest.mark.slow
def test_it_ends_with_its_parent_where_asked_to(tmp_path: Path) -> None:
    scenario = (CONFIG / "sim" / "demo.yaml").read_text().replace("../maps", str(CONFIG / "maps"))
    (tmp_path / "s.yaml").write_text(scenario)
    command = [sys.executable, "-m", "simulator", "serve", str(tmp_path / "s.yaml"), "--until-stdin-ends"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=CONFIG.parent
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        port = json.loads(process.stdout.readline())["port"]
        process.stdin.write("what is said is not looked at")
        process.stdin.flush()
        assert read_registers(port, 0, 8).rstrip(b"\0") == b"IMPACT-FPGA"
        process.stdin.close()
        assert process.wait(timeout=PATIENCE_S) == 0


def test_a_port_that_is_taken(taken_port: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["serve", str(CONFIG / "sim" / "demo.yaml"), "--port", taken_port]) == 1
    told = capsys.readouterr().err
    assert "cannot listen" in told
    assert "--port chooses another" in told
