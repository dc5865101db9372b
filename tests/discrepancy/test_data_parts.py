"""Parts of the data by themselves: drives, blocks, columns and what is held out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.campaign import Campaign
from impactcell.discrepancy.data import driven_blocks, measured_drive, prepare, prepared_campaign
from impactcell.discrepancy.data.measured_drive import SmoothedDrive, position_response, smooth_drive
from impactcell.discrepancy.data.noise_floor import sensor_noise
from impactcell.discrepancy.data.prepared_shots import MOTION_COVARIATES
from impactcell.discrepancy.data.tap import Tap
from impactcell.discrepancy.data.unit_checks import PlausibleRatio, check_units
from impactcell.discrepancy.laws.law import COVARIATE_WORDS
from impactcell.discrepancy.report import german_sentences
from impactcell.errors import CampaignError
from impactcell.features.noise_at_rest import NoiseAtRest, noise_at_rest, std_of_pieces
from impactcell.records import Capture, Channel
from impactcell.web.texts.import_notes import page_note
from tests.discrepancy.study import Job, campaign, name_effects, quick_campaign


def test_a_part_that_turns_round_goes_on_by_the_ratio_of_its_accelerations() -> None:
    """Under a constant force back, v0 falls by (F + f) / m until it turns, and grows by (F - f) / m then.

    x(T) = t* v0 / 2 - a2 (T - t*)^2 / 2 with t* = v0 / a1, so that dx/dv0 = t* + (a2 / a1) (T - t*).
    """
    mass, force, friction, end = 3.0, 40.0, 5.0, 0.05
    time = np.linspace(0.0, end, 42)
    before, after = (force + friction) / mass, (force - friction) / mass
    turns = 16.5 * time[1]
    speed = np.where(time < turns, before * (turns - time), -after * (time - turns))
    drive = SmoothedDrive(time, np.full(len(time), -force), 1e-4)
    response, step = position_response(drive, speed, mass, friction), time[1]
    for knot in (3, 7, 12):
        by_speed = (turns - time[knot]) + after / before * (end - turns)
        assert response[-1, knot] == pytest.approx(step / mass * by_speed, rel=0.03)


def test_a_drive_that_is_a_line_stays_one() -> None:
    time = np.arange(0.0, 0.3, 4e-4)
    drive = smooth_drive(time, 5.0 - 30.0 * time, 0.3)
    assert drive.force_n == pytest.approx(5.0 - 30.0 * drive.time_s, abs=1e-6)


def test_friction_of_a_block_is_that_of_its_mass(monkeypatch: pytest.MonkeyPatch) -> None:
    """Coulomb friction, mu_k m g, is what the whitener of a driven block takes the part to lose."""

    @dataclass
    class Block:
        times: Any
        values: Any
        drive: Any
        covariates: dict[str, float]
        whitener: Any = None

    time = np.linspace(0.0, 0.5, 200)
    position, empty, frictions = 0.02 * np.sin(12.0 * time), np.empty(0), []

    def noted(drive: SmoothedDrive, speed: np.ndarray, mass: float, friction: float) -> np.ndarray:
        frictions.append((mass, friction))
        return position_response(drive, speed, mass, friction)

    monkeypatch.setattr(measured_drive, "position_response", noted)
    block: Any = Block(
        (empty, time, empty),
        (empty, position, empty),
        np.vstack([time, 8.0 * np.cos(12.0 * time)]),
        {"mass": 2.0},
    )
    whitened = measured_drive.whiten_block(block, 1e-6, 9.81, 0.25)
    assert frictions == [(2.0, pytest.approx(0.25 * 2.0 * 9.81))]
    assert whitened.whitener.shape == (len(whitened.times[1]),) * 2


def test_a_slip_is_fast_and_of_one_direction() -> None:
    speed = np.concatenate(
        [np.full(20, 1e-4), np.full(30, 0.3), np.zeros(25), np.full(40, -0.2), np.full(20, 1e-4)]
    )
    parts = [(part.tolist(), sense) for part, sense in measured_drive._slip_intervals(speed)]
    assert parts == [([*range(20, 50)], 1.0), ([*range(75, 115)], -1.0)]


def test_blocks_are_cut_beside_a_stretch_without_samples() -> None:
    time = np.concatenate([np.arange(0.0, 2.0, 1e-3), np.arange(4.0, 12.0, 1e-3)])
    speed = np.sin(2.0 * np.pi * 5.0 * time)
    cuts = driven_blocks._cut_samples(time, speed)
    assert len(cuts) > 5
    assert np.median(np.abs(speed[cuts])) == pytest.approx(1.0, abs=0.02)
    assert np.abs(speed[cuts]).min() > 0.5
    assert time[cuts[0]] < 2.0 < 4.0 < time[cuts[-1]]


def test_a_column_of_nothing_but_zeros_does_not_vary() -> None:
    shots: Any = [
        SimpleNamespace(covariates={"zero": 0.0, "load": 2.0 + place, "same": 5.0, "gap": math.nan})
        for place in range(4)
    ]
    strategy: Any = SimpleNamespace(record_of=lambda _: 0)
    assert prepared_campaign._varying_covariates(strategy, shots) == ("load",)


def test_a_channel_that_shows_no_noise_and_states_none_is_refused() -> None:
    prepared: Any = SimpleNamespace(
        shots=(SimpleNamespace(values=(np.full(50, 3.0), np.empty(0), np.empty(0))),),
        stated_noise=(math.nan,) * 3,
    )
    with pytest.raises(CampaignError, match="neither is its noise stated"):
        sensor_noise(prepared)


@pytest.mark.parametrize("correlation", [0.0, 0.8])
@pytest.mark.parametrize("stated", [None, 1.5e-6])
def test_noise_before_contact_that_is_more_than_neighbours_show_is_taken(
    correlation: float, stated: float | None
) -> None:
    """First-order autoregressive noise of a standard deviation of 1.5 µm, 200 samples before contact."""
    rng = np.random.default_rng(3)
    recorded, counted = [], []
    for shot in range(24):
        values = rng.normal(0.0, 1.5e-6, 400)
        for i in range(1, len(values)):
            values[i] = correlation * values[i - 1] + math.sqrt(1.0 - correlation**2) * values[i]
        values[60] += 1e-4 * (shot % 6 == 0)  # a spike in some shots
        whole, kept = (SimpleNamespace(values=part, noise_std=stated) for part in (values, values[200:]))
        recorded.append(SimpleNamespace(force=None, position=whole, actuator=None))
        counted.append(SimpleNamespace(force=None, position=kept, actuator=None))
    taps: Any = (recorded, counted)
    found = noise_at_rest(*taps)
    assert set(found) == ({"position"} if correlation > 0.0 and stated is None else set())
    for one in found.values():
        assert one.std == pytest.approx(1.5e-6, rel=0.05)
        assert one.where == "before contact"


@pytest.mark.parametrize(
    ("noise", "told"),
    [("white", None), ("correlated", 1.5), ("heavy", 1.5), ("moving", None), ("driven", None)],
)
def test_noise_after_the_tap_tells_where_nothing_was_recorded_before_it(
    noise: str, told: float | None
) -> None:
    """The part slides for 600 samples and lies for 400, or slides to the end."""
    rng = np.random.default_rng(5)
    shots = []
    for _ in range(24):
        values = rng.normal(0.0, 1.5e-6, 1000)
        if noise == "correlated":
            for i in range(1, len(values)):
                values[i] = 0.9 * values[i - 1] + math.sqrt(0.19) * values[i]
        elif noise == "heavy":
            values = 1.5e-6 * rng.standard_t(3.0, 1000) / math.sqrt(3.0)
        last = 1000 if noise == "moving" else 600
        values += 4e-3 * (1.0 - np.clip(1.0 - np.arange(1000) / last, 0.0, None) ** 2)
        channel = SimpleNamespace(values=values, noise_std=None)
        shots.append(SimpleNamespace(force=None, position=channel, actuator=None))
    taps: Any = shots
    found = noise_at_rest(taps, taps, rest_after=noise != "driven")
    assert set(found) == ({"position"} if told else set())
    for one in found.values():
        assert one.std == pytest.approx(1e-6 * (told or 0.0), rel=0.06)
        assert one.where == "after the tap"


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("size", [40, 300])
def test_short_pieces_show_all_of_correlated_noise(correlation: float, size: int) -> None:
    """About a level of its own a piece of 40 samples shows 0.79 of the standard deviation at 0.9."""
    rng = np.random.default_rng(int(100 * correlation) + size)
    estimates = []
    for _ in range(40):
        values = rng.normal(size=(30, size))
        for i in range(1, size):
            values[:, i] *= math.sqrt(1.0 - correlation**2)
            values[:, i] += correlation * values[:, i - 1]
        estimates.append(std_of_pieces([row + 10.0 * rng.normal() for row in values]))
    assert np.mean(estimates) == pytest.approx(1.0, abs=0.03)
    assert np.std(estimates) < 0.1


def test_the_floor_is_that_at_rest_where_neighbouring_samples_show_a_part() -> None:
    rng = np.random.default_rng(8)
    values = (rng.normal(0.0, 0.3, 200), rng.normal(0.0, 1e-6, 200), np.empty(0))
    prepared: Any = SimpleNamespace(
        shots=(SimpleNamespace(values=values),),
        stated_noise=(math.nan,) * 3,
        noise_at_rest={"force": NoiseAtRest(0.9, 3.0, "after the tap")},
    )
    floor = sensor_noise(prepared)
    assert floor.noise_std[0] == 0.9
    assert floor.noise_std[1] == pytest.approx(1e-6, rel=0.2)
    assert floor.source == ("estimated", "estimated", "none")
    assert "0.9 N was estimated from samples at rest after the tap, 3 times what neighb" in floor.notes[0]
    assert "state noise_std_n of sensors: force in campaign.yaml" in floor.notes[0]
    assert "from neighbouring samples" in floor.notes[1]


@pytest.mark.slow
def test_correlated_noise_that_nobody_stated_is_no_gap() -> None:
    """Against what neighbouring samples show it had been a gap of 1.7 noise floors, and `unknown`."""

    def unstated(shot: Capture) -> Capture:
        channels = {
            name: replace(channel, noise_std=None)
            for name in ("force", "position", "actuator")
            if (channel := getattr(shot, name)) is not None
        }
        return replace(shot, **channels)

    job = Job("none", (), 5_061_000, shots=30, coloured=True)
    given = campaign(job)
    found = name_effects(replace(given, shots=tuple(map(unstated, given.shots))), seed=job.seed)
    assert found.conclusion.verdict == "no_gap"
    assert found.floor.noise_std == pytest.approx(prepare(given).stated_noise, rel=0.15)


@pytest.mark.parametrize(
    ("value", "columns", "factor"),
    [
        (1520.0, "force_n or mass_kg", "1e+3"),
        (2e-6, "force_n or mass_kg", "1e-6"),
        (25.0, "force_n or mass_kg", "1e+3"),
        (1.4 / 60.0, "position_m or velocity_mm_per_min", "1/60"),
        (1.4 * 60.0, "position_m or velocity_mm_per_min", "60"),
        (1.4e-3, "position_m or velocity_mm_per_min", "1e-3"),
        (1.4 * 6e4, "position_m or velocity_mm_per_min", "6e+4"),
        (1.4 / 6e4, "position_m or velocity_mm_per_min", "1/6e+4"),
        (1.4e6, "position_m or velocity_mm_per_min", "1e+6"),
    ],
)
def test_a_wrong_unit_is_told_with_the_factor_between_units(value: float, columns: str, factor: str) -> None:
    ratio = PlausibleRatio(0.05, 20.0, "a ratio", columns)
    with pytest.raises(CampaignError) as fault:
        check_units([{ratio: value}])
    assert str(fault.value).endswith(f"(off by a factor of about {factor})")


def test_no_factor_is_told_where_a_ratio_is_nothing() -> None:
    ratio = PlausibleRatio(0.05, 20.0, "a ratio", "position_m or velocity_mm_per_min")
    with pytest.raises(CampaignError) as fault:
        check_units([{ratio: 0.0}])
    told = "a ratio is 0, where about 1 is possible: check the unit of position_m or velocity_mm_per_min"
    assert str(fault.value) == told
    german = page_note(f"{told}; it will be refused as it stands (--unit NAME=UNIT says another)", "de")[1]
    assert german.startswith("Einheit prüfen: position_m oder velocity_mm_per_min (")


@pytest.mark.slow
def test_a_quarter_of_every_setting_is_held_out() -> None:
    """Whether a setting has many shots or one: over 400 splits, as often as chance allows."""
    velocities = np.array([1.0] * 8 + [2.0] * 5 + [3.0])
    shots: Any = [
        SimpleNamespace(velocity_m_s=velocity, direction=1, mass_kg=1.0, covariates={})
        for velocity in velocities.tolist()
    ]
    share = np.zeros(len(shots))
    for seed in range(400):
        training, held_out = Tap().split(shots, seed)
        assert sorted([*training, *held_out]) == list(range(len(shots)))
        share[held_out] += 1.0 / 400
    spread = 4.0 * math.sqrt(share.mean() * (1.0 - share.mean()) / 400)
    for velocity in np.unique(velocities):
        assert share[velocities == velocity].mean() == pytest.approx(share.mean(), abs=spread)


def test_a_sample_at_the_actuators_halt_says_nothing() -> None:
    """The force jumps there: whether the sample is of before or after is a matter of rounding."""
    job = Job("single", (), 3, shots=12)
    made = campaign(job)
    bent = []
    for shot in made.shots:
        assert shot.force is not None
        at_halt = np.abs(shot.force.time_s - made.stroke_m / shot.velocity_m_s) < 1e-9
        values = shot.force.values + np.where(at_halt, 20.0, 0.0)
        bent.append(replace(shot, force=replace(shot.force, values=values)))
    assert any(
        not np.array_equal(one.force.values, other.force.values)
        for one, other in zip(bent, made.shots, strict=True)
    )
    as_made, as_bent = prepare(made), prepare(replace(made, shots=tuple(bent)))
    for one, other in zip(as_made.shots, as_bent.shots, strict=True):
        for left, right in zip((*one.times, *one.values), (*other.times, *other.values), strict=True):
            assert np.array_equal(left, right)


@pytest.mark.parametrize(("channel", "height"), [("force", 1e3), ("position", 1e-3), ("actuator", 1e-4)])
def test_lone_outliers_are_no_missing_effect(channel: str, height: float) -> None:
    """Three of them among 24 shots were 40 noise floors that no known effect explains."""
    made = quick_campaign(Job("single", (), 3, shots=24))
    shots = list(made.shots)
    for place, sample in ((2, 20), (11, 60), (17, 100)):
        recorded = getattr(shots[place], channel)
        values = recorded.values.copy()
        values[sample] += height
        shots[place] = replace(shots[place], **{channel: replace(recorded, values=values)})
    prepared = prepare(replace(made, shots=tuple(shots)))
    assert "Outliers of 3 shots are left out of the fits." in prepared.notes
    sizes = [shot.size for shot in prepare(made).shots]
    assert sum(sizes) - sum(shot.size for shot in prepared.shots) == 3
    number = ("force", "position", "actuator").index(channel)
    largest = [np.abs(shot.values[number]).max() for shot in prepared.shots]
    assert largest == pytest.approx([np.abs(shot.values[number]).max() for shot in prepare(made).shots])


def clipped(made: Campaign, channel: str, places: Sequence[int], share: float) -> Campaign:
    """Let a channel of some shots end at a share of its way, whichever the way is."""
    shots = list(made.shots)
    for place in places:
        recorded: Channel = getattr(shots[place], channel)
        end = share * recorded.values[int(np.abs(recorded.values).argmax())]
        values = np.minimum(recorded.values, end) if end > 0.0 else np.maximum(recorded.values, end)
        shots[place] = replace(shots[place], **{channel: replace(recorded, values=values)})
    return replace(made, shots=tuple(shots))


@pytest.mark.parametrize("channel", ["force", "position"])
def test_clipped_samples_are_left_out_and_so_is_said(channel: str) -> None:
    made = quick_campaign(Job("single", (), 3, shots=24))
    places, number = (2, 11, 17), ("force", "position", "actuator").index(channel)
    prepared, whole = prepare(clipped(made, channel, places, 0.8)), prepare(made)
    for place, (shot, sound) in enumerate(zip(prepared.shots, whole.shots, strict=True)):
        for other in {0, 1, 2} - {number}:
            assert np.array_equal(shot.values[other], sound.values[other])
        values = sound.values[number]
        below = np.abs(values) < 0.8 * np.abs(getattr(made.shots[place], channel).values).max()
        kept = np.isin(sound.times[number], shot.times[number])
        assert np.isin(shot.values[number], values).all()
        assert kept.all() if place not in places else below[kept].all()
        assert (kept | ~below).sum() >= len(values) - 8  # noise dips below the end beside it
    (said,) = [note for note in prepared.notes if "left out" in note]
    assert said == "Clipped samples of 3 shots are left out of the fits."
    assert german_sentences.note(said) == ("de", "Begrenzte Messwerte werden nicht angepasst (Stöße: 3).")
    assert not any("gap in time" in note for note in prepared.notes)


def test_a_force_that_is_clipped_in_some_shots_hides_nothing() -> None:
    """Fitted, a quarter of the contacts clipped left an unknown gap of several noise floors."""
    job = Job("single", (), 3, shots=20)
    made = clipped(quick_campaign(job), "force", range(0, 20, 4), 0.7)
    found = name_effects(made, seed=job.seed, library=("force_saturation",))
    assert (found.verdict, found.added) == ("no_gap", ())


def test_a_column_takes_no_name_that_the_workflow_has_for_something_else() -> None:
    """A law over a column `force` was printed as one over the contact force; `mass` replaced the mass."""
    made = quick_campaign(Job("single", (), 3, shots=12))
    columns = {"mass": 3.0, "time": 4.0, "force": 5.0, "oil": 20.0}
    given = replace(made, shots=tuple(replace(shot, covariates=dict(columns)) for shot in made.shots))
    prepared = prepare(given)
    assert [shot.covariates["mass"] for shot in prepared.shots] == [shot.mass_kg for shot in made.shots]
    assert {shot.columns for shot in prepared.shots} == {(("oil", 20.0),)}
    notes = [note for note in prepared.notes if "is not used" in note]
    assert [note.split()[1] for note in notes] == ["mass", "time", "force"]
    assert all("another name" in note and german_sentences.note(note)[0] == "de" for note in notes)
    assert set(COVARIATE_WORDS) == set(MOTION_COVARIATES)
