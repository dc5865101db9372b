"""The demo tells what its scenario does, and what the cell has to find out by itself."""

import contextlib
import logging
import socket
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from impactcell.demo import scenario_setup
from impactcell.demo.scenario_setup import (
    CONFIG,
    SCENARIOS,
    TOUR_OVER,
    customary_port,
    fit_events,
    story,
    tour_end,
)
from simulator.process import strike_conditions
from simulator.scenario import read_scenario


def test_a_batch_that_the_plc_keeps_to_itself_is_told_as_such() -> None:
    batches = [
        {"from_cycle": 1, "id": "A"},
        {"from_cycle": 40, "id": "B", "shift": 0.01},
        {"from_cycle": 90, "id": "C", "announced": False},
    ]
    assert story({"wear": {"from_cycle": 1}, "batches": batches}) == (
        (1, "the surface wears: mu_s grows slowly"),
        (40, "batch B is on the table"),
        (90, "batch C is on the table, and the PLC says nothing of it"),
    )


def test_what_compiles_is_a_step_that_shows_how_long_it_takes(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    begun: list[str] = []

    def compile_for_long(*_: object) -> None:
        assert begun == ["setting up"]
        raise KeyboardInterrupt

    monkeypatch.setattr(scenario_setup, "warm_up", compile_for_long)
    monkeypatch.setattr(scenario_setup, "named_steps", lambda: contextlib.nullcontext(begun.append))
    caplog.set_level(logging.INFO, "impactcell")
    with pytest.raises(KeyboardInterrupt), scenario_setup.set_up_scenario("demo", None):
        pass


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_a_demo_says_when_its_tour_is_over(scenario: str) -> None:
    content = yaml.safe_load((CONFIG / "sim" / f"{scenario}.yaml").read_text(encoding="utf-8"))
    said = tour_end(content)
    if scenario == "demo":
        assert said == ((131, TOUR_OVER),)
        assert max(cycle for cycle, _ in story(content)) == 90
    else:  # a last part ends the one, a new model the other
        assert said == ()


@pytest.mark.slow
def test_the_simulator_ends_with_a_demo_that_is_killed(tmp_path: Path) -> None:
    text = (CONFIG / "sim" / "demo.yaml").read_text(encoding="utf-8")
    (tmp_path / "s.yaml").write_text(text.replace("../maps", str(CONFIG / "maps")), encoding="utf-8")
    program = (
        "import sys, pathlib\n"
        "from impactcell.demo.scenario_setup import _simulator\n"
        "with _simulator(pathlib.Path(sys.argv[1])) as port:\n"
        "    print(port, flush=True)\n"
        "    sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path / "s.yaml")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=scenario_setup.ROOT,
    ) as process:
        assert process.stdout is not None
        port = int(process.stdout.readline())
        socket.create_connection(("127.0.0.1", port)).close()
        process.kill()
    with contextlib.suppress(ConnectionRefusedError, ConnectionResetError):
        while True:  # the suite's own timeout ends it
            socket.create_connection(("127.0.0.1", port)).close()


def test_a_demo_that_nobody_ends_keeps_a_friction_that_its_model_knows() -> None:
    scenario = read_scenario(CONFIG / "sim" / "demo.yaml")
    model = yaml.safe_load((CONFIG / "models" / "prototype.yaml").read_text(encoding="utf-8"))
    low, high = model["predictors"][0]["mu_s_range"]
    for cycle in (200, 2_000, 100_000):
        assert low < strike_conditions(scenario, cycle, 0.0, 1).plant.mu_s < high


@pytest.mark.parametrize(("cycles", "begins"), [(None, [1, 40, 90]), (50, [1, 20, 45]), (1, [1, 2, 3])])
def test_batches_stay_in_their_order_however_short_the_demo_is(cycles: int | None, begins: list[int]) -> None:
    content = {"batches": [{"from_cycle": cycle, "id": str(cycle)} for cycle in (1, 40, 90)]}
    assert [batch["from_cycle"] for batch in fit_events(content, cycles)["batches"]] == begins


def test_of_demos_that_start_at_once_one_has_the_customary_port() -> None:
    """Before, each found the port free, and the second to listen at it ended with a fault."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = int(free.getsockname()[1])
        with customary_port(port) as where_it_is_taken:
            assert where_it_is_taken == 0
    with customary_port(port) as first, customary_port(port) as second:
        assert (first, second) == (port, 0)
        socket.create_server(("127.0.0.1", first)).close()
    with customary_port(port) as later:
        assert later == port
