"""One shot with a wrong mass, velocity, position or sign is left out and told; hidden effects are not."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from impactcell.campaign import Campaign, read
from impactcell.discrepancy.data import check_campaign_units, prepare, without_unlike_shots
from impactcell.discrepancy.data.free_slide import DECELERATION_RATIO
from impactcell.discrepancy.data.tap import BALANCE_RATIO, SPEED_RATIO
from impactcell.discrepancy.report import german_notes, german_sentences
from impactcell.errors import CampaignError
from impactcell.quality import inspect_campaign
from impactcell.records import Capture, Channel
from tests.discrepancy.study import Job, quick_campaign


@lru_cache
def taps() -> Campaign:
    return quick_campaign(Job("none", (), 7, shots=24))


def scaled(channel: Channel | None, factor: float) -> Channel:
    assert channel is not None
    return replace(channel, values=factor * channel.values)


def ends_at(shot: Capture, end_s: float) -> Capture:
    """Give a shot of which all channels end while the actuator pushes."""

    def cut(channel: Channel | None) -> Channel | None:
        if channel is None:
            return None
        kept = channel.time_s < end_s
        return replace(channel, time_s=channel.time_s[kept], values=channel.values[kept])

    return replace(shot, force=cut(shot.force), position=cut(shot.position), actuator=cut(shot.actuator))


def with_wrong(given: Campaign, change: Callable[[Capture], Capture], *numbers: int) -> Campaign:
    return replace(
        given, shots=tuple(change(shot) if shot.cycle in numbers else shot for shot in given.shots)
    )


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda s: replace(s, velocity_m_s=s.velocity_m_s / 6e4), r"velocity_mm_per_min .*about 6e\+4"),
        (lambda s: replace(s, velocity_m_s=s.velocity_m_s / 2.5), "velocity_mm_per_min .*about 2.[3-7]"),
        (lambda s: replace(s, mass_kg=s.mass_kg / 1.5), "mass_kg or force_n .*about 1.[456]"),
        (lambda s: replace(s, mass_kg=1e3 * s.mass_kg), "mass_kg or force_n .*about 1e-3"),
        (lambda s: replace(s, position=scaled(s.position, 1e3)), r"position_m or time_s .*about 1e\+3"),
        (lambda s: replace(s, force=scaled(s.force, -1.0)), "force_n pulls with .* turn its sign"),
        (lambda s: replace(s, position=scaled(s.position, -1.0)), "position_m goes .* turn its sign or dir"),
        (lambda s: replace(s, position=scaled(s.position, 0.0)), "position is constant|does not move"),
        (lambda s: ends_at(s, 0.008), r"record ends \d\.?\d* ms after contact, while .*: record until"),
    ],
)
def test_a_shot_of_which_a_column_is_wrong_is_left_out_and_told(
    change: Callable[[Capture], Capture], told: str
) -> None:
    prepared = prepare(with_wrong(taps(), change, 7))
    assert sorted(shot.number for shot in prepared.shots) == [n for n in range(1, 25) if n != 7]
    (note,) = (note for note in prepared.notes if "is left out" in note)
    assert re.match(rf"Shot 7 is left out: .*({told})", note)
    language, said = german_sentences.note(note)
    assert language == "de"
    assert said.startswith("Stoß 7 ist ausgelassen: ")


@pytest.mark.parametrize("channel", ["force", "position"])
def test_a_sign_that_is_wrong_in_all_shots_is_refused_and_no_unit_is_blamed(channel: str) -> None:
    given = taps()
    turned = [replace(shot, **{channel: scaled(getattr(shot, channel), -1.0)}) for shot in given.shots]
    told = rf"wrong in 24 of 24 shots; of the first, its {channel}_\w .*turn"
    with pytest.raises(CampaignError, match=told):
        prepare(replace(given, shots=tuple(turned)))
    some = (*turned[:10], *given.shots[10:])  # fewer than half: told one by one
    assert len(prepare(replace(given, shots=some)).shots) == 14


def test_several_shots_with_the_same_slip_are_one_note() -> None:
    wrong = with_wrong(taps(), lambda shot: replace(shot, mass_kg=1e3 * shot.mass_kg), 3, 8, 20)
    (note,) = (note for note in prepare(wrong).notes if "is left out" in note)
    assert note.startswith("Shot 3 is left out: ")
    assert note.endswith("; for the like so are 8, 20.")
    language, said = german_sentences.note(note)
    assert (language, said.rpartition("; ")[2]) == ("de", "aus gleichem Grund auch 8, 20.")


def test_every_ratio_that_a_shot_is_judged_by_has_a_german_name() -> None:
    assert {SPEED_RATIO.name, BALANCE_RATIO.name, DECELERATION_RATIO.name} == set(german_notes.RATIOS)


def test_what_is_wrong_in_most_shots_is_refused_as_before() -> None:
    wrong = with_wrong(
        taps(), lambda shot: replace(shot, velocity_m_s=shot.velocity_m_s / 6e4), *range(1, 16)
    )
    with pytest.raises(CampaignError, match=r"check the unit of .* \(off by a factor of about 6e\+4\)"):
        prepare(wrong)


@pytest.mark.parametrize("height_m", [0.05, -0.05])
def test_a_spike_in_each_shot_hides_neither_speed_nor_sign(height_m: float) -> None:
    """Lone samples are far off for the line's sake: the part's motion is between all others."""

    def spiked(shot: Capture) -> Capture:
        assert shot.position is not None
        values = shot.position.values.copy()
        values[len(values) // 2] += height_m
        values[len(values) - 20 : len(values) - 18] += height_m
        return replace(shot, position=replace(shot.position, values=values))

    given = with_wrong(taps(), spiked, *range(1, 25))
    check_campaign_units(given)
    assert without_unlike_shots(given, inspect_campaign(given)) == (given, {})
    slow = with_wrong(given, lambda shot: replace(shot, velocity_m_s=60.0 * shot.velocity_m_s), *range(1, 25))
    with pytest.raises(CampaignError, match=r"velocity_mm_per_min \(off by a factor of about 1/60\)"):
        check_campaign_units(slow)


def test_few_shots_do_not_say_what_is_usual() -> None:
    few = replace(taps(), shots=taps().shots[:5])
    wrong = with_wrong(few, lambda shot: replace(shot, mass_kg=1e3 * shot.mass_kg), few.shots[0].cycle)
    assert without_unlike_shots(wrong, inspect_campaign(wrong)) == (wrong, {})


@pytest.mark.parametrize(
    ("effect", "strength"),
    [  # of a gap of 6, and far more
        ("actuator_droop", 0.62), ("actuator_droop", 3.0), ("adhesion", 0.43), ("force_saturation", 0.5),
        ("force_saturation", 1.0), ("force_sensor_gain", 6.0), ("force_sensor_offset", 2.1),
        ("friction_patch", 6.0), ("hertz_contact", 3.6), ("mass_error", 6.0), ("viscous_friction", 3.0),
        ("position_dependent_friction", 0.66), ("presliding_compliance", 1.6),
    ],
)  # fmt: skip
def test_no_shot_is_left_out_for_what_is_hidden(effect: str, strength: float) -> None:
    given = quick_campaign(Job("single", (effect,), 12, strength=strength, shots=36))
    assert without_unlike_shots(given, inspect_campaign(given)) == (given, {})


@pytest.mark.parametrize(
    "name", ["contactnets-slides", "sample-campaigns/no-effect", "sample-campaigns/one-effect"]
)
def test_no_shot_of_the_shared_data_is_left_out(name: str, shared_data: Path) -> None:
    given = read(shared_data / name)
    assert without_unlike_shots(given, inspect_campaign(given)) == (given, {})


def test_a_slide_in_millimetres_is_left_out(shared_data: Path) -> None:
    slides = read(shared_data / "contactnets-slides")
    few = replace(slides, shots=slides.shots[:20])
    number = few.shots[4].cycle
    wrong = with_wrong(few, lambda shot: replace(shot, position=scaled(shot.position, 1e3)), number)
    kept, unlike = without_unlike_shots(wrong, inspect_campaign(wrong))
    assert list(unlike) == [number]
    assert "position_m or time_s (off by a factor of about 1e+3)" in unlike[number]
    assert np.all([shot.cycle != number for shot in kept.shots])
