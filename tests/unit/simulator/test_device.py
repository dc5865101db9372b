"""The module on a schedule: what it shows in its registers, read as the service reads them."""

import asyncio
import math

import numpy as np
import pytest
import yaml

from impactcell.errors import SettingsError
from impactcell.fieldbus.registers import RegisterMap
from simulator.image import RegisterImage
from simulator.serving import serve
from tests.integration.processes import CONFIG
from tests.module_client import MAP, Client, scenario

COUNTERS = ("cycle_counter", "ring_cycle", "window_cycle", "acknowledge_cycle", "acknowledged_cycle",
            "batch_from_cycle", "command_cycle")  # fmt: skip


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


def test_a_schedule_that_waits_for_the_first_request() -> None:
    waiting = Client(scenario(strikes={"period_s": 1.0, "begin": "with_first_request"}))
    waiting.device.update(500.0)
    assert waiting.get("cycle_counter") == 0
    assert waiting.device.due_s == math.inf
    waiting.device.request_came(700.0)
    assert waiting.device.due_s == pytest.approx(701.0)
    waiting.device.request_came(700.5)
    assert waiting.device.due_s == pytest.approx(701.0)
    at_once = Client(scenario(strikes={"period_s": 1.0}))
    at_once.device.request_came(0.25)
    assert at_once.device.due_s == pytest.approx(1.0)


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


def test_a_schedule_that_waits_until_cycles_are_stored() -> None:
    client = Client(scenario(strikes={"period_s": 1.0, "ahead": 3}), session=5)

    def acknowledge(cycle: int) -> None:
        client.put("acknowledge_session", 5)
        client.put("acknowledge_cycle", cycle)

    def made_by(until_s: float) -> int:
        for _ in range(4):  # it makes a few at a time
            client.device.update(until_s)
        return int(client.get("cycle_counter"))

    assert made_by(2.9) == 2  # as any schedule, while it need not wait
    assert made_by(50.0) == 3
    assert client.device.due_s == math.inf
    acknowledge(2)
    assert made_by(50.9) == 4, "the one that was late, and none to make up for it"
    assert made_by(99.0) == 5
    client.device.set_counter(70)
    assert made_by(199.0) == 73
    acknowledge(72)
    client.device.restart()
    assert made_by(299.0) == 3
    assert client.get("overwritten_count") == 0


def short_counter(kind: str) -> RegisterMap:
    """The shipped map, of a module whose counters are of a type with few numbers."""
    content = yaml.safe_load((CONFIG / "maps" / "fpga-v1.yaml").read_text())
    for name in COUNTERS:
        content["registers"][name]["type"] = kind
    return RegisterMap.from_mapping(content)


@pytest.mark.parametrize(("kind", "last"), [("u16", 65_535), ("bcd16", 9_999), ("bcd32", 99_999_999)])
def test_a_schedule_goes_on_waiting_where_a_short_counter_begins_anew(kind: str, last: int) -> None:
    """Cycle 0 is one like the others, and acknowledged as they are."""
    registers = short_counter(kind)
    client = Client(scenario(strikes={"period_s": 1.0, "ahead": 2}), registers, session=5)
    client.put("acknowledge_session", 5)
    client.device.set_counter(last - 1)
    for second in range(registers.slots + 8):
        client.device.update(second + 0.9)
        client.put("acknowledge_cycle", client.get("cycle_counter"))
    cycles = [truth["cycle"] for truth in client.truth]
    assert cycles[:4] == [last, 0, 1, 2]
    assert len(cycles) == registers.slots + 7
    assert client.get("acknowledged_cycle") == client.get("cycle_counter") == cycles[-1]
    assert client.get("overwritten_count") == 0


def test_a_short_counter_that_begins_anew_counts_what_its_ring_lost() -> None:
    registers = short_counter("u16")
    client = Client(scenario(), registers, session=5)
    client.put("acknowledge_session", 5)
    client.device.set_counter(65_533)
    client.device.overrun(registers.slots)  # 65534, 65535, 0, 1 and so on
    client.put("acknowledge_cycle", 65_535)
    client.device.overrun(2)
    assert client.get("overwritten_count") == 0
    client.device.overrun(3)
    assert client.get("overwritten_count") == 3
    assert client.get("ring_cycle").tolist().count(0) == 0


@pytest.mark.slow
def test_short_registers_that_count_begin_anew() -> None:
    """Before, the module broke off as soon as one of them was full."""
    content = yaml.safe_load((CONFIG / "maps" / "fpga-v1.yaml").read_text())
    for name in ("overwritten_count", "window_sequence", "window_sequence_after"):
        content["registers"][name]["type"] = "bcd16"
    image = RegisterImage(RegisterMap.from_mapping(content), session=5)
    for _ in range(10_000 + MAP.slots + 3):
        image.complete({}, {})
        image.write(MAP["slot_select"].address, MAP["slot_select"].encode(image.get("newest_slot")))
    assert image.get("overwritten_count") == 3
    assert image.get("window_sequence") == image.get("window_sequence_after") < 10_000


@pytest.mark.parametrize(("registers", "last"), [(MAP, 2**32 - 1), (short_counter("u16"), 65_535)])
def test_a_batch_that_is_announced_while_the_counter_begins_anew(registers: RegisterMap, last: int) -> None:
    batches = [{"from_cycle": 1, "id": "A"}, {"from_cycle": 3, "id": "B"}]
    client = Client(scenario(batches=batches), registers)
    client.device.set_counter(last - 1)
    seen = []
    for second in range(1, 6):
        client.device.update(second + 0.9)
        seen.append(client.read_slot(int(client.get("newest_slot"))).batch_id)
    assert seen == ["A", "A", "B", "B", "B"]
    assert client.get("batch_from_cycle") == client.truth[2]["cycle"]


def test_a_schedule_cannot_wait_for_what_the_map_does_not_have() -> None:
    summary = RegisterMap.from_mapping(yaml.safe_load((CONFIG / "maps" / "summary.yaml").read_text()))
    with pytest.raises(SettingsError, match=r"`strikes\.ahead` waits .* no `acknowledge_cycle`"):
        asyncio.run(serve(scenario(strikes={"ahead": 1}), summary))


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


def test_wear_that_ends_stays_as_it_is() -> None:
    wear = {"mu_s_per_1000_cycles": 1.0, "until_cycle": 4}
    client = Client(scenario(scatter={"friction": 0.0}, wear=wear))
    for second in range(7):
        client.device.update(second + 0.9)
    expected = [0.2, 0.201, 0.202, 0.203, 0.203, 0.203]
    np.testing.assert_allclose([truth["mu_s"] for truth in client.truth], expected, rtol=1e-12)


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
