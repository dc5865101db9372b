"""When to poll and when to connect again; the time is the test's own."""

import math
import random
from collections.abc import Callable

import numpy as np
import pytest

from impactcell.fieldbus.cycles.backoff import CEILING_S, Backoff
from impactcell.fieldbus.cycles.poll_schedule import COARSE_S, FINE_S, IDLE_S, QUIET_S, PollSchedule
from impactcell.fieldbus.link import SerialLine

ROUND_TRIP_S = 1e-4


def follow(
    periods_s: list[float],
    round_trip_s: float = ROUND_TRIP_S,
    busy_s: float = 0.0,
    clock: Callable[[float], float] = lambda now_s: now_s,
) -> tuple[list[float], float]:
    """Poll through cycles with these periods; returns how late each was seen, and polls per cycle.

    The poller is held up before each poll for a random time of mean `busy_s`; `clock` is the module's.
    """
    schedule, now_s, due_s, asked_s = PollSchedule(), 0.0, 0.0, 0.0
    late, polls = [], 0
    held_up = np.random.default_rng(9)
    for period_s in periods_s:
        due_s += period_s
        while now_s < due_s:
            asked_s = now_s + schedule.delay_s(now_s)
            now_s = asked_s + round_trip_s + held_up.exponential(busy_s)
            polls += 1
            schedule.record_poll(asked_s, now_s, new=now_s >= due_s)
        late.append(now_s - due_s)
        schedule.update(clock(due_s))
    return late, polls / len(periods_s)


@pytest.mark.parametrize(
    ("baudrate", "parity", "stop_bits", "silence_s"),
    [
        (9600, "E", 1, 4.0104e-3), (9600, "N", 2, 4.0104e-3), (9600, "N", 1, 3.6458e-3),
        (19_200, "E", 1, 2.0052e-3), (38_400, "E", 1, 1.75e-3), (115_200, "N", 1, 1.75e-3),
    ],
)  # fmt: skip
def test_the_silence_that_ends_a_frame_is_that_of_the_standard(
    baudrate: int, parity: str, stop_bits: int, silence_s: float
) -> None:
    """Modbus over Serial Line V1.02, 2.5.1.1: 3.5 characters of 11 bits (or 10), 1.75 ms above 19 200."""
    line = SerialLine("port", baudrate, parity, stop_bits)
    assert line.silence_s == pytest.approx(silence_s, rel=1e-4)


def test_regular_cycles_are_seen_soon_with_few_polls() -> None:
    jitter = np.random.default_rng(1).normal(0.5, 0.002, 300)
    late, polls = follow(list(jitter))
    assert np.quantile(late[20:], 0.99) < 2 * FINE_S
    assert polls < 15  # three milliseconds all the time would be 167


def test_a_busy_service_polls_no_more_for_it() -> None:
    periods = list(np.random.default_rng(1).normal(0.5, 0.002, 300))
    assert follow(periods, busy_s=0.02)[1] <= follow(periods)[1]


def test_a_cycle_seen_late_does_not_make_the_next_one_late() -> None:
    """A held-up poller is late by the time it was held up: 99 of 100 draws are below 4.6 means."""
    late, _ = follow([0.5] * 600, busy_s=0.01)
    assert np.quantile(late[20:], 0.99) < 1.5 * 0.046
    assert np.median(late[20:]) < 0.015


@pytest.mark.parametrize("first_s", [0.0, 0.05, 0.2, 0.45])
def test_cycles_that_waited_at_the_start_do_not_make_later_ones_late(first_s: float) -> None:
    """Fifteen in the ring, the newest of them old: its age says little of when the next one can be seen."""
    schedule, now_s = PollSchedule(), 0.0
    schedule.record_poll(0.0, 0.0, new=True)
    for cycle in range(-14, 1):
        schedule.update(0.5 * cycle - first_s, newest=cycle == 0)
    late, polls = [], 0
    for cycle in range(1, 60):
        due_s = 0.5 * cycle - first_s
        while now_s < due_s:
            now_s += schedule.delay_s(now_s)
            polls += 1
            schedule.record_poll(now_s, now_s, new=now_s >= due_s)
        late.append(now_s - due_s)
        schedule.update(due_s)
    assert max(late) <= QUIET_S + 1e-9
    assert max(late[3:]) < 2 * FINE_S
    assert polls < 10 * 59


def test_a_module_that_is_slow_for_once_or_for_good() -> None:
    """One cycle shown 20 ms late costs the next ones little; from cycle 100 on all are."""
    held_up = np.zeros(200)
    held_up[50], held_up[100:] = 0.02, 0.02
    schedule, now_s = PollSchedule(), 0.0
    late, polls = [], np.zeros(200)
    for cycle, held_up_s in enumerate(held_up):
        shown_s = 0.5 * cycle + held_up_s
        while now_s < shown_s:
            now_s += schedule.delay_s(now_s)
            polls[cycle] += 1
            schedule.record_poll(now_s, now_s, new=now_s >= shown_s)
        late.append(now_s - shown_s)
        schedule.update(0.5 * cycle)
    assert max(late[51:100]) < 2 * FINE_S
    assert max(late[20:50]) < 2 * FINE_S
    assert max(late[110:]) < 2 * FINE_S
    assert max(polls[60:100]) < 10
    assert max(polls[120:]) < 10


@pytest.mark.parametrize("rate", [1.0 - 1e-4, 1.0, 1.0 + 1e-4])
def test_the_clock_of_the_module_may_drift_and_be_set(rate: float) -> None:
    def clock(now_s: float) -> float:
        return 1.7e9 + rate * now_s + (3600.0 if now_s > 100.0 else 0.0) - (7200.0 if now_s > 200.0 else 0.0)

    jitter = np.random.default_rng(1).normal(0.5, 0.002, 600)
    late, polls = follow(list(jitter), clock=clock)
    assert np.quantile(late[20:], 0.99) < 2 * FINE_S
    assert polls < 15


@pytest.mark.parametrize(
    "clock",
    [
        math.floor,
        lambda now_s: 1e-3 * now_s,
        lambda now_s: 1e3 * now_s,
        lambda now_s: 1.7e9,
        lambda now_s: -now_s,
        lambda now_s: now_s + 3600.0 * (now_s % 7.0 > 3.5),
    ],
    ids=["whole seconds", "too slow", "too fast", "stands still", "backwards", "to and fro"],
)
def test_a_clock_of_no_use_makes_no_cycle_late(clock: Callable[[float], float]) -> None:
    late, polls = follow(list(np.random.default_rng(1).normal(0.5, 0.002, 300)), clock=clock)
    assert max(late) <= QUIET_S + ROUND_TRIP_S + 1e-9
    assert polls < 0.5 / QUIET_S


def test_after_a_pause_the_rhythm_is_soon_known_again() -> None:
    jitter = np.random.default_rng(1).normal(0.5, 0.002, 80)
    jitter[40] = 10_000.0
    late, _ = follow(list(jitter))
    assert late[40] <= IDLE_S
    assert max(late[41:]) <= QUIET_S + 1e-9
    assert max(late[65:]) < 2 * FINE_S


def test_irregular_cycles_are_never_seen_later_than_the_quiet_poll() -> None:
    periods = np.random.default_rng(2).exponential(0.4, 500) + 0.1
    late, _ = follow(list(periods))
    assert np.quantile(late, 0.99) <= IDLE_S
    assert np.quantile(late, 0.9) <= 2 * QUIET_S


def test_an_idle_module_is_left_in_peace() -> None:
    schedule = PollSchedule()
    for cycle in range(5):
        schedule.record_poll(0.5 * cycle - 0.01, 0.5 * cycle - 0.01, new=False)
        schedule.record_poll(0.5 * cycle, 0.5 * cycle, new=True)
        schedule.update(0.5 * cycle)
    assert schedule.delay_s(60.0) == IDLE_S


def test_cycles_by_hand_every_minute_or_so_cost_few_polls() -> None:
    periods = np.random.default_rng(2).exponential(60.0, 60) + 5.0
    late, polls = follow(list(periods))
    assert max(late) <= IDLE_S + ROUND_TRIP_S
    assert polls / np.mean(periods) < 20  # a second


def test_a_module_without_cycles_is_left_in_peace_after_a_while() -> None:
    schedule, now_s, polls = PollSchedule(), 0.0, 0
    while now_s < 60.0:
        schedule.record_poll(now_s, now_s, new=False)
        now_s += schedule.delay_s(now_s)
        polls += 1
    assert polls < 1000
    assert schedule.delay_s(now_s) == IDLE_S


def test_a_slow_line_has_rest_between_polls() -> None:
    schedule = PollSchedule()
    assert schedule.delay_s(0.0) > 0.0
    schedule.record_poll(0.0, 0.2, new=False)
    assert schedule.delay_s(0.2) == pytest.approx(0.6)


def test_over_a_slow_line_a_cycle_is_seen_within_two_round_trips() -> None:
    """A poll that just missed it, a round trip of rest, and the poll that shows it."""
    late, polls = follow(list(np.random.default_rng(1).normal(0.5, 0.002, 300)), round_trip_s=0.03)
    assert np.quantile(late[20:], 0.99) < 2 * 0.03 + 2 * FINE_S
    assert polls < 8


def test_one_slow_answer_does_not_put_off_the_next_poll() -> None:
    """A module that is busy with its new cycle answers late just when that cycle is due."""
    schedule = PollSchedule()
    for cycle in range(20):
        schedule.record_poll(0.5 * cycle - 0.002, 0.5 * cycle - 0.001, new=False)
        schedule.record_poll(0.5 * cycle + 0.001, 0.5 * cycle + 0.002, new=True)
        schedule.update(0.5 * cycle)
    schedule.record_poll(9.998, 10.006, new=False)
    assert schedule.delay_s(10.006) <= COARSE_S


def test_backoff_grows_with_jitter_to_its_ceiling_and_begins_anew() -> None:
    backoff = Backoff(random.Random(3))
    delays = [backoff.next_delay_s() for _ in range(200)]
    assert delays[0] <= 0.02
    assert max(delays) <= CEILING_S == 0.4
    assert min(delays[10:]) >= 0.5 * CEILING_S
    assert len(set(delays)) == 200
    backoff.reset()
    assert backoff.next_delay_s() <= 0.02
