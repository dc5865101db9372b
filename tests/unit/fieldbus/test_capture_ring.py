"""Which cycle comes next. Truth: a plain simulation of a counter and a ring, in absolute numbers."""

from hypothesis import given
from hypothesis import strategies as st

from impactcell.fieldbus.cycles.capture_ring import CYCLE_PERIOD, cycles_after, next_capture
from impactcell.records import CycleId

SLOTS = 8


def number(absolute: int) -> int:
    """Cycle number of the absolute-th cycle: 1, 2, ... 2^32 - 1, 1, ..."""
    return (absolute - 1) % CYCLE_PERIOD + 1


def ring_of(newest: int, oldest: int) -> list[int]:
    ring = [0] * SLOTS
    for absolute in range(max(oldest, newest - SLOTS + 1), newest + 1):
        ring[absolute % SLOTS] = number(absolute)
    return ring


@given(
    first=st.sampled_from([1, CYCLE_PERIOD - 20]),
    taken=st.integers(0, 30),
    made=st.lists(st.integers(0, 25), min_size=1, max_size=12),
)
def test_every_cycle_once_in_order_or_counted_as_missed(first: int, taken: int, made: list[int]) -> None:
    """`taken` were taken before; then cycles are made in bursts, and the ring is emptied after each."""
    newest = first + taken
    last_absolute, last = newest, CycleId(7, number(newest))
    missed = 0
    received: list[int] = []
    for burst in made:
        newest += burst
        while want := next_capture(last, 7, number(newest), ring_of(newest, first)):
            assert not want.restarted
            absolute = last_absolute + want.missed + 1
            assert number(absolute) == want.cycle_id.cycle
            assert ring_of(newest, first)[want.slot] == want.cycle_id.cycle
            missed += want.missed
            received.append(absolute)
            last_absolute, last = absolute, want.cycle_id
        assert last_absolute == newest
        assert received == sorted(set(received))
    total = sum(made)
    assert len(received) + missed == total
    assert missed == sum(max(0, burst - SLOTS) for burst in made)


@given(st.integers(1, 3 * CYCLE_PERIOD), st.integers(0, 1000))
def test_distance_counts_steps(start: int, steps: int) -> None:
    assert cycles_after(number(start), number(start + steps)) == steps


def test_first_contact_begins_with_the_oldest_and_misses_nothing() -> None:
    want = next_capture(None, 3, 20, ring_of(20, 1))
    assert want is not None
    assert (want.cycle_id, want.missed, want.restarted) == (CycleId(3, 13), 0, False)


def test_first_contact_across_the_wrap() -> None:
    newest = CYCLE_PERIOD + 3
    want = next_capture(None, 3, number(newest), ring_of(newest, CYCLE_PERIOD - 100))
    assert want is not None
    assert want.cycle_id.cycle == number(newest - SLOTS + 1)


def test_nothing_new() -> None:
    assert next_capture(CycleId(1, 20), 1, 20, ring_of(20, 1)) is None
    assert next_capture(None, 1, 0, [0] * SLOTS) is None
    assert next_capture(CycleId(1, 20), 2, 0, [0] * SLOTS) is None


def test_a_restart_is_seen_and_begins_at_one() -> None:
    want = next_capture(CycleId(1, 5000), 2, 3, ring_of(3, 1))
    assert want is not None
    assert (want.cycle_id, want.missed, want.restarted) == (CycleId(2, 1), 0, True)


def test_a_restart_longer_ago_than_the_ring_counts_what_is_gone() -> None:
    want = next_capture(CycleId(1, 5000), 2, 30, ring_of(30, 1))
    assert want is not None
    assert (want.cycle_id, want.missed, want.restarted) == (CycleId(2, 23), 22, True)


def test_a_counter_that_is_kept_over_a_restart_goes_on() -> None:
    """The ring is empty after a start of the module, its counter may not be."""
    want = next_capture(CycleId(1, 65_530), 2, 65_532, ring_of(65_532, 65_531))
    assert want is not None
    assert (want.cycle_id, want.missed, want.restarted) == (CycleId(2, 65_531), 0, True)
    # three of the cycles before the restart had not been read
    want = next_capture(CycleId(1, 65_527), 2, 65_531, ring_of(65_531, 65_531))
    assert want is not None
    assert (want.cycle_id, want.missed) == (CycleId(2, 65_531), 3)


def test_a_counter_that_is_kept_is_told_from_one_that_began_anew_by_the_smaller_loss() -> None:
    """With a full ring: from 65 530 on to 65 600, or from 1 on to 65 600 within one outage."""
    want = next_capture(CycleId(1, 65_530), 2, 65_600, ring_of(65_600, 65_531))
    assert want is not None
    assert (want.cycle_id, want.missed) == (CycleId(2, 65_593), 62)
    want = next_capture(CycleId(1, 23), 2, 24, ring_of(24, 1))  # a start empties the ring: not from 23 on
    assert want is not None
    assert (want.cycle_id, want.missed) == (CycleId(2, 17), 16)
    want = next_capture(CycleId(1, 5), 2, 40, ring_of(40, 1))
    assert want is not None
    assert (want.cycle_id, want.missed) == (CycleId(2, 33), 32)


def test_a_counter_kept_over_a_restart_and_its_wrap() -> None:
    newest = CYCLE_PERIOD + 2
    want = next_capture(CycleId(1, CYCLE_PERIOD - 1), 2, 2, ring_of(newest, newest - 2))
    assert want is not None
    assert (want.cycle_id, want.missed) == (CycleId(2, CYCLE_PERIOD), 0)


def test_skipping_after_a_restart_counts_what_is_skipped() -> None:
    want = next_capture(CycleId(1, 100), 2, 5, ring_of(5, 1), skip=2)
    assert want is not None
    assert (want.cycle_id, want.missed) == (CycleId(2, 3), 2)


def test_a_counter_that_goes_back_is_a_restart_even_in_the_same_session() -> None:
    want = next_capture(CycleId(1, 5000), 1, 2, ring_of(2, 1))
    assert want is not None
    assert (want.cycle_id, want.restarted) == (CycleId(1, 1), True)


def test_a_counter_that_was_set_close_to_its_wrap_misses_nothing() -> None:
    newest = CYCLE_PERIOD - 1
    want = next_capture(CycleId(1, 5), 1, newest, ring_of(newest, newest))
    assert want is not None
    assert (want.cycle_id.cycle, want.missed, want.restarted) == (newest, 0, True)


def test_a_cycle_beyond_the_counter_is_not_taken_yet() -> None:
    ring = ring_of(21, 1)
    want = next_capture(CycleId(1, 19), 1, 20, ring)
    assert want is not None
    assert want.cycle_id.cycle == 20
    assert next_capture(CycleId(1, 20), 1, 20, ring) is None


def test_skipping_leaves_out_the_oldest_and_counts_them() -> None:
    want = next_capture(CycleId(1, 12), 1, 20, ring_of(20, 1), skip=3)
    assert want is not None
    assert (want.cycle_id.cycle, want.missed) == (16, 3)


def test_cycles_that_were_seen_before_a_restart_and_not_taken_are_missed() -> None:
    """Of a module that counts from 1 again, with a ring or one buffer, and of one that goes on counting."""
    want = next_capture(CycleId(1, 5000), 2, 3, ring_of(3, 1), seen=5004)
    assert want is not None
    assert (want.cycle_id, want.missed) == (CycleId(2, 1), 4)
    want = next_capture(CycleId(1, 33), 2, 1, [1], seen=34)
    assert want is not None
    assert (want.cycle_id, want.missed) == (CycleId(2, 1), 1)
    went_on = next_capture(CycleId(1, 65_527), 2, 65_531, ring_of(65_531, 65_531), seen=65_530)
    assert went_on is not None
    assert (went_on.cycle_id, went_on.missed) == (CycleId(2, 65_531), 3)
    nothing_new = next_capture(CycleId(1, 5000), 2, 3, ring_of(3, 1), seen=5000)
    assert nothing_new is not None
    assert nothing_new.missed == 0
