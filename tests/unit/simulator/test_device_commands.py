"""The module on command: taps by handshake, abort, and any order of it all."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from simulator.serving import read_register_map
from tests.integration.processes import CONFIG
from tests.module_client import MAP, Client, positioning, scenario


def test_a_tap_on_command_moves_the_part() -> None:
    client = Client(positioning(part={"mass_kg": 12.0}))
    assert client.get("positioning_state") == 1
    client.command(1)
    assert client.get("command_result") == 1
    assert client.get("positioning_state") == 2
    assert client.get("command_cycle") == 0
    client.device.update(client.device.due_s)
    assert client.get("command_result") == 2
    assert client.get("command_cycle") == client.get("cycle_counter") == 1
    moved = client.truth[0]["displacement_m"]
    assert client.get("part_position") == pytest.approx(moved, abs=1e-9)
    assert client.get("part_mass") == 12.0
    client.command(2, direction=-1)
    client.device.update(client.device.due_s)
    assert client.get("part_position") == pytest.approx(moved - client.truth[1]["displacement_m"], abs=2e-9)
    back = client.read_slot(2)
    assert back.direction == -1
    assert back.start_m == pytest.approx(moved, abs=1e-9)
    assert back.position is not None
    assert back.position.values[-1] == pytest.approx(-client.truth[1]["displacement_m"], abs=1e-5)


def test_states_are_shown_by_the_names_that_the_map_has_for_them(tmp_path: Path) -> None:
    """Fixed numbers were shown: a map with others had a module that was never ready."""
    content = yaml.safe_load((CONFIG / "maps" / "fpga-v1.yaml").read_text(encoding="utf-8"))
    content["registers"]["state"]["codes"] = {0: "not ready", 1: "fault", 7: "ready"}
    content["registers"]["positioning_state"]["codes"] = {10: "none", 11: "ready", 12: "executing"}
    content["registers"]["command_result"]["codes"] = {4: "executing", 5: "done", 9: "refused value"}
    (tmp_path / "map.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    client = Client(positioning(), read_register_map(tmp_path / "map.yaml"))
    names = ("state", "positioning_state", "command_result")
    assert [client.get(name) for name in names] == [7, 11, 0]
    client.command(1)
    assert [client.get(name) for name in names] == [0, 12, 4]
    client.device.update(client.device.due_s)
    assert [client.get(name) for name in names] == [7, 11, 5]
    client.command(2, velocity=0.0)
    assert [client.get(name) for name in names] == [7, 11, 9]
    placeless = Client(scenario(), read_register_map(tmp_path / "map.yaml"))
    assert placeless.get("positioning_state") == 10


def test_the_same_command_twice_strikes_once() -> None:
    client = Client(positioning())
    client.command(1)
    client.put("command_sequence", 1)
    client.device.update(client.device.due_s)
    client.put("command_sequence", 1)
    assert client.get("cycle_counter") == 1
    assert client.device.due_s == math.inf


@pytest.mark.parametrize("first", [1, 2**32 - 2, 2**32 - 1])
def test_a_request_that_is_delivered_after_a_later_one_strikes_nothing(first: int) -> None:
    """It was held up in the network, and repeated meanwhile; numbers begin anew with 1."""
    client, last = Client(positioning()), 2**32 - 1
    numbers = [first, first % last + 1, (first + 1) % last + 1]
    for made, number in enumerate(numbers, start=1):
        client.command(number)
        client.device.update(client.device.due_s)
        for late in numbers[:made]:
            client.put("command_sequence", late)
            assert client.device.due_s == math.inf
        assert (client.get("command_accepted"), client.get("command_result")) == (number, 2)
        assert client.get("cycle_counter") == made
    client.device.restart()
    client.command(first)
    assert client.get("command_accepted") == first


@pytest.mark.parametrize(
    "command",
    [
        {"velocity": 0.2},
        {"velocity": 0.0},
        {"velocity": 1e-41},
        {"velocity": math.nan},
        {"stroke": 0.01},
        {"stroke": -0.001},
        {"direction": 0},
        {"direction": 2},
    ],
)
def test_impossible_commands_are_refused(command: dict[str, float]) -> None:
    client = Client(positioning())
    client.command(1, **command)  # type: ignore[arg-type]
    assert client.get("command_result") == 3
    assert client.get("command_accepted") == 1
    assert client.get("positioning_state") == 1
    assert client.device.due_s == math.inf


def test_commands_out_of_turn_are_refused() -> None:
    scheduled = Client(scenario())
    scheduled.command(1)
    assert scheduled.get("command_result") == 4
    client = Client(positioning())
    client.command(1)
    client.command(2)
    assert client.get("command_result") == 4
    client.device.update(client.device.due_s)
    assert client.get("cycle_counter") == 1


def test_the_limits_themselves_are_allowed() -> None:
    client = Client(positioning())
    client.command(1, velocity=0.1, stroke=0.0015)
    assert client.get("command_result") == 1


def test_abort_halts_the_actuator_where_it_is() -> None:
    whole, cut = Client(positioning()), Client(positioning())
    for client in (whole, cut):
        client.device.update(1.0)
        client.command(1, velocity=0.02)
    cut.device.update(1.03)
    cut.put("command_abort", 1)
    for client in (whole, cut):
        client.device.update(client.device.due_s)
    assert whole.get("command_result") == 2
    assert cut.get("command_result") == 5
    assert cut.get("command_abort") == 0
    assert cut.truth[0]["stroke_m"] == pytest.approx(0.02 * 0.03)
    assert 0.0 < cut.get("part_position") < whole.get("part_position")
    cut.command(2)
    assert cut.get("command_result") == 1


def test_parts_come_one_after_the_other() -> None:
    tasks = [
        {"target_m": 0.003, "tolerance_m": 0.002},
        {"target_m": -0.01, "start_m": 0.001, "mass_kg": 30.0},
    ]
    client = Client(scenario(strikes=None, positioning={"directions": [1], "pause_s": 1.0, "tasks": tasks}))
    assert client.get("target_sequence") == 1
    assert client.get("target_position") == pytest.approx(0.003)
    client.command(1)
    client.device.update(client.device.due_s)
    assert client.truth[-1]["inside"] is True
    assert client.truth[-1]["taps"] == 1
    client.device.update(client.device.due_s)
    assert client.get("target_sequence") == 2
    assert client.get("target_position") == pytest.approx(-0.01)
    assert client.get("part_position") == pytest.approx(0.001)
    assert client.get("part_mass") == 30.0


class AnyOrder(RuleBasedStateMachine):
    """Time, commands, aborts, restarts and selections in any order."""

    @initialize()
    def start(self) -> None:
        self.client = Client(positioning(), session=1)
        self.now = 0.0
        self.sequence = 0
        self.session = 1

    @rule(step=st.floats(0.0, 0.3))
    def wait(self, step: float) -> None:
        self.now += step
        self.client.device.update(self.now)

    @rule(velocity=st.floats(-0.1, 0.2), stroke=st.floats(-1e-3, 3e-3), direction=st.integers(-2, 2))
    def strike(self, velocity: float, stroke: float, direction: int) -> None:
        self.sequence += 1
        self.client.command(self.sequence, velocity, stroke, direction)
        assert self.client.get("command_accepted") == self.sequence

    @rule()
    def abort(self) -> None:
        self.client.put("command_abort", 1)

    @rule()
    def restart(self) -> None:
        self.session += 1
        assert self.client.device.restart() == self.session
        self.sequence = 0

    @rule(slot=st.integers(0, MAP.slots - 1))
    def select(self, slot: int) -> None:
        cycle = self.client.read_slot(slot).cycle if np.array(self.client.get("ring_cycle"))[slot] else 0
        assert cycle == np.array(self.client.get("ring_cycle"))[slot]

    @invariant()
    def consistent(self) -> None:
        if not hasattr(self, "client"):
            return
        counter = self.client.get("cycle_counter")
        assert np.max(self.client.get("ring_cycle")) == counter
        assert (self.client.get("state") == 2) == (
            self.client.get("command_result") == 1 or self._under_way()
        )
        assert self.client.get("session") == self.session
        moved = [truth for truth in self.client.truth if "position_m" in truth]
        expected = moved[-1]["position_m"] if moved else 0.0
        assert self.client.get("part_position") == pytest.approx(expected, abs=1e-9)

    def _under_way(self) -> bool:
        # A second command while one is being executed is refused, and the first goes on.
        return math.isfinite(self.client.device.due_s)


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(max_examples=25, stateful_step_count=20, deadline=None)
