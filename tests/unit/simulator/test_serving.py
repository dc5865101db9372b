"""Scenario files, and the simulator as a process of its own."""

import itertools
import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactcell.errors import SettingsError
from simulator.__main__ import main
from simulator.scenario import read_scenario
from simulator.serving import read_register_map
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


def read_registers(port: int, address: int, count: int) -> bytes:
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as link:
        link.sendall(bytes([0, 1, 0, 0, 0, 6, 1, 3]) + address.to_bytes(2, "big") + count.to_bytes(2, "big"))
        reply = b""
        while len(reply) < 9 + 2 * count:
            part = link.recv(1024)
            assert part, reply
            reply += part
    return reply[9:]


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


def test_a_port_that_is_taken(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert main(["serve", str(CONFIG / "sim" / "demo.yaml"), "--port", str(port)]) == 1
    told = capsys.readouterr().err
    assert "cannot listen" in told
    assert "--port chooses another" in told
