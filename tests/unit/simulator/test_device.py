"""The module as a state machine: what it shows in its registers, read as the service reads them."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from impactcell.fieldbus.decoding import capture, used_counts
from impactcell.fieldbus.registers import RegisterMap, capture_crc32
from impactcell.records import Capture
from simulator.device import Device, Truth
from simulator.scenario import Scenario
from simulator.serving import read_register_map

MAP = read_register_map(Path(__file__).parents[3] / "config" / "maps" / "fpga-v1.yaml")
SENSORS = {
    "force": {"rate_hz": 10000, "noise_std": 0.4, "longest_s": 0.2},
    "position": {"rate_hz": 10000, "noise_std": 1.5e-6, "longest_s": 0.3},
}


def scenario(**changed: Any) -> Scenario:
    content = {"format": 1, "register_map": "x", "strikes": {"period_s": 1.0}, "sensors": SENSORS}
    return Scenario.model_validate(content | changed)


def positioning(**changed: Any) -> Scenario:
    return scenario(strikes=None, positioning={"directions": [1, -1]}, **changed)


class Client:
    """Reads and writes as the service does, without a network."""

    def __init__(self, made: Scenario, registers: RegisterMap = MAP, **options: Any) -> None:
        self.truth: list[Truth] = []
        self.registers = registers
        self.faults: list[str] = []
        self.device = Device(made, registers, on_truth=self.truth.append, **options)

    def get(self, name: str) -> Any:
        register = self.registers[name]
        return register.decode(self.device.read("holding", register.address, register.words))

    def put(self, name: str, value: Any) -> None:
        register = self.registers[name]
        self.device.write(register.address, register.encode(value))

    def command(
        self, sequence: int, velocity: float = 0.05, stroke: float = 0.0015, direction: int = 1
    ) -> None:
        self.put("command_velocity", velocity)
        self.put("command_stroke", stroke)
        self.put("command_direction", direction)
        self.put("command_sequence", sequence)

    def read_slot(self, slot: int) -> Capture:
        self.put("slot_select", slot)
        header = {register.name: self.get(register.name) for register in self.registers.header()}
        counts = used_counts(self.registers, header)
        samples = {}
        for name, count in counts.items():
            register = self.registers[name]
            words = count * register.words_per_value
            samples[name] = self.device.read("holding", register.address, words)
        first = self.registers["window_slot"].address
        last = self.registers["capture_crc32"].address
        words = self.device.read("holding", first, last - first)
        assert header["capture_crc32"] == capture_crc32(words, *samples.values())
        assert header["window_sequence"] == self.get("window_sequence_after")
        assert header["window_sequence"] % 2 == 0
        got, self.faults = capture(self.registers, header, samples)
        return got


def test_identity_before_the_first_cycle() -> None:
    client = Client(scenario(), session=77)
    client.device.update(0.5)
    assert client.get("module_name") == "IMPACT-FPGA"
    assert client.get("map_version") == 1
    assert client.get("serial_number") == "SIM-0001"
    assert client.get("session") == 77
    assert client.get("cycle_counter") == 0
    assert client.get("newest_slot") == 0xFFFF
    assert client.get("state") == 1
    assert not np.any(client.get("ring_cycle"))
    assert client.device.due_s == pytest.approx(1.0)


def test_a_cycle_from_contact_to_rest() -> None:
    client = Client(scenario(), epoch_ns=10**18, now_s=100.0)
    client.device.update(101.01)
    assert client.get("state") == 2
    assert client.get("cycle_counter") == 0
    client.device.update(client.device.due_s)
    assert client.get("state") == 1
    assert client.get("cycle_counter") == 1
    truth = client.truth[0]
    got = client.read_slot(int(client.get("newest_slot")))
    assert client.faults == []
    assert got.cycle == 1
    assert got.time_ns == 10**18 + 10**9 == truth["time_ns"]
    assert got.velocity_m_s == pytest.approx(4000 / 60000, rel=1e-6)
    assert got.mass_kg == pytest.approx(18.9)
    assert got.stroke_m == pytest.approx(0.0015)
    assert got.dwell_s == pytest.approx(1.0)
    assert got.batch_id == "A"
    assert got.summary is not None
    assert got.summary.peak_force_n == pytest.approx(truth["peak_force_n"], rel=1e-6)
    assert got.summary.sliding_distance_m == pytest.approx(truth["sliding_distance_m"], rel=1e-6)
    assert got.force is not None
    assert got.position is not None
    assert got.force.values.max() == pytest.approx(truth["peak_force_n"], abs=2.0)
    assert got.position.values[-10:].mean() == pytest.approx(truth["displacement_m"], abs=2e-6)
    assert got.force.time_s[0] == pytest.approx(1e-4)
    np.testing.assert_allclose(np.diff(got.position.time_s), 1e-4, atol=1e-12)


def test_the_ring_holds_the_last_cycles_and_counts_what_it_lost() -> None:
    client = Client(scenario())
    slots = MAP.slots
    for second in range(slots + 8):
        client.device.update(second + 0.9)
    ring = np.array(client.get("ring_cycle"))
    newest = int(client.get("cycle_counter"))
    assert newest == slots + 7
    assert sorted(ring) == list(range(newest - slots + 1, newest + 1))
    assert client.get("overwritten_count") == newest - slots
    for slot in range(slots):
        assert client.read_slot(slot).cycle == ring[slot]


def test_acknowledged_cycles_are_not_counted_as_lost() -> None:
    client = Client(scenario(), session=5)
    for second in range(MAP.slots + 8):
        client.device.update(second + 0.9)
        client.put("acknowledge_session", 5)
        client.put("acknowledge_cycle", client.get("cycle_counter"))
    assert client.get("overwritten_count") == 0
    assert client.get("acknowledged_cycle") == client.get("cycle_counter")
    client.put("acknowledge_session", 4)
    client.put("acknowledge_cycle", 1)
    assert client.get("acknowledged_cycle") == client.get("cycle_counter")


def test_same_seed_same_registers() -> None:
    def image(seed: int) -> bytes:
        client = Client(scenario(seed=seed))
        for second in range(4):
            client.device.update(second + 0.9)
        first, last = MAP["window_slot"].address, MAP["window_sequence_after"].address
        client.put("slot_select", 2)
        return client.device.read("holding", first, last - first).tobytes()

    assert image(1) == image(1)
    assert image(1) != image(2)


def test_acceleration_keeps_the_physics_and_shortens_the_wait() -> None:
    slow, fast = Client(scenario()), Client(scenario(acceleration=100.0))
    for step in range(60):
        slow.device.update(step * 0.1)
        fast.device.update(step * 0.001)
    assert [truth["mu_s"] for truth in slow.truth] == [truth["mu_s"] for truth in fast.truth]
    assert len(slow.truth) == 5


def test_wear_batches_and_deviation_follow_the_script() -> None:
    made = scenario(
        scatter={"friction": 0.0},
        wear={"mu_s_per_1000_cycles": 1.0},
        batches=[
            {"from_cycle": 1, "id": "A"},
            {"from_cycle": 4, "id": "B", "shift": 0.02},
            {"from_cycle": 6, "id": "C", "shift": -0.01, "announced": False},
        ],
        deviations=[{"cycle": 3, "kind": "level", "size": 0.1}],
    )
    client = Client(made)
    batches = []
    for second in range(8):
        client.device.update(second + 0.9)
        if client.get("cycle_counter"):
            batches.append(client.read_slot(int(client.get("newest_slot"))).batch_id)
    expected = [0.2, 0.201, 0.202 * 1.1, 0.223, 0.224, 0.195, 0.196]
    np.testing.assert_allclose([truth["mu_s"] for truth in client.truth], expected, rtol=1e-12)
    assert [truth["batch"] for truth in client.truth] == ["A", "A", "A", "B", "B", "C", "C"]
    assert batches == ["A", "A", "A", "B", "B", "B", "B"]
    assert client.truth[2]["deviation"] == "level"
    assert client.get("batch_announced") == "B"
    assert client.get("batch_from_cycle") == 4


def test_a_batch_announced_by_a_writing_plc() -> None:
    client = Client(scenario())
    client.device.update(1.9)
    client.put("batch_announced", "X-7")
    client.put("batch_from_cycle", 3)
    assert client.get("cycle_counter") == 1
    client.put("batch_sequence", client.get("batch_sequence") + 1)
    seen = []
    for second in (2, 3, 4):
        client.device.update(second + 0.9)
        seen.append(client.read_slot(int(client.get("newest_slot"))).batch_id)
    assert seen == ["A", "X-7", "X-7"]


@pytest.mark.parametrize("kind", ["bump", "tilt", "ripple"])
def test_deviation_along_the_stroke(kind: str) -> None:
    plain = Client(scenario(scatter={"friction": 0.0}))
    size = {"bump": 0.5, "tilt": 30.0, "ripple": 0.4}[kind]
    deviant = Client(
        scenario(
            scatter={"friction": 0.0},
            deviations=[{"cycle": 2, "kind": kind, "size": size, "at_m": 0.002, "width_m": 5e-4}],
        )
    )
    for client in (plain, deviant):
        for step in range(40):
            client.device.update(step * 0.1)
    lost = [
        a["displacement_m"] - b["displacement_m"] for a, b in zip(plain.truth, deviant.truth, strict=True)
    ]
    assert lost[0] == lost[2] == 0.0
    assert abs(lost[1]) > 5e-6


def test_an_effect_appears() -> None:
    effect = {"stribeck_friction": {"friction_increase": 0.03, "stribeck_velocity_m_s": 0.04}}
    client = Client(scenario(appearances=[{"from_cycle": 3, "effects": effect}]))
    for step in range(40):
        client.device.update(step * 0.1)
    assert ["stribeck_friction" in truth["effects"] for truth in client.truth] == [False, False, True]


def test_restart_begins_a_new_session_and_the_wear_goes_on() -> None:
    client = Client(scenario(scatter={"friction": 0.0}, wear={"mu_s_per_1000_cycles": 1.0}), session=9)
    for step in range(35):
        client.device.update(step * 0.1)
    assert client.device.restart() == 10
    assert client.get("session") == 10
    assert client.get("cycle_counter") == 0
    assert not np.any(client.get("ring_cycle"))
    for step in range(35, 45):
        client.device.update(step * 0.1)
    assert client.get("cycle_counter") == 1
    assert client.truth[-1]["mu_s"] == pytest.approx(0.203)
    assert client.truth[-1]["session"] == 10
    assert client.read_slot(int(client.get("newest_slot"))).batch_id == "A"


def test_counter_wraps_past_zero() -> None:
    client = Client(scenario())
    client.device.set_counter(2**32 - 2)
    for step in range(35):
        client.device.update(step * 0.1)
    assert [truth["cycle"] for truth in client.truth] == [2**32 - 1, 1, 2]
    assert client.get("cycle_counter") == 2


def test_busy_and_overrun() -> None:
    client = Client(scenario())
    client.device.update(0.1)
    client.device.busy(2.0)
    with pytest.raises(BlockingIOError):
        client.get("state")
    with pytest.raises(BlockingIOError):
        client.put("slot_select", 1)
    client.device.update(2.2)
    client.device.overrun(20)
    assert client.get("cycle_counter") >= 20


def test_ends_after_so_many_cycles() -> None:
    client = Client(scenario(strikes={"period_s": 1.0, "cycles": 2}))
    for step in range(60):
        client.device.update(step * 0.1)
    assert client.get("cycle_counter") == 2
    assert client.device.due_s == math.inf


def test_addresses_that_are_not_there_or_not_writable() -> None:
    client = Client(scenario())
    with pytest.raises(LookupError):
        client.device.read("holding", 40_000, 10)
    with pytest.raises(LookupError):
        client.put("cycle_counter", 3)
    with pytest.raises(ValueError, match="99"):
        client.put("slot_select", 99)


@pytest.mark.parametrize(
    "kind", ["empty", "constant_force", "saturated", "no_separation", "not_a_number", "no_force"]
)
def test_faulty_captures(kind: str) -> None:
    client = Client(scenario(faulty_captures=[{"cycle": 1, "kind": kind}]))
    for step in range(20):
        client.device.update(step * 0.1)
    got = client.read_slot(1)
    match kind:
        case "empty":
            assert got.force is None
            assert got.position is None
        case "no_force":
            assert got.force is None
            assert got.position is not None
        case "constant_force":
            assert got.force is not None
            assert np.ptp(got.force.values) == 0.0
        case "saturated":
            assert got.force is not None
            assert got.force.full_scale is not None
            assert (got.force.values >= got.force.full_scale[1]).any()
        case "no_separation":
            assert got.force is not None
            assert got.force.values[-1] > 100.0
        case _:
            assert got.force is not None
            assert len(got.force.values) < int(client.get("force_count"))
            assert "not a number" in client.faults[0]


def test_slow_motion_is_recorded_to_its_end_at_a_lower_rate() -> None:
    sensors = {
        "force": {"rate_hz": 1_000_000, "noise_std": 0.4, "longest_s": 0.02},
        "position": {"rate_hz": 20_000, "noise_std": 1.5e-6, "longest_s": 0.2},
    }
    client = Client(scenario(strikes={"period_s": 2.0, "velocities_mm_per_min": [100.0]}, sensors=sensors))
    for step in range(40):
        client.device.update(step * 0.1)
    got = client.read_slot(1)
    assert got.position is not None
    assert got.position.time_s[-1] > 0.88
    assert got.position.values[-1] == pytest.approx(client.truth[0]["displacement_m"], abs=6e-6)


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


def test_the_same_command_twice_strikes_once() -> None:
    client = Client(positioning())
    client.command(1)
    client.put("command_sequence", 1)
    client.device.update(client.device.due_s)
    client.put("command_sequence", 1)
    assert client.get("cycle_counter") == 1
    assert client.device.due_s == math.inf


@pytest.mark.parametrize(
    "command",
    [
        {"velocity": 0.2},
        {"velocity": 0.0},
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
