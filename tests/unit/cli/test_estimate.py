"""`impactcell estimate` on campaigns of the simulator's plant and on the sample campaigns."""

import csv
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import TextIO

import numpy as np
import pytest

from impactcell.campaign import Campaign, Excitation, Sensor, write
from impactcell.campaign import read as read_campaign
from impactcell.cli.direction_note import note_of_direction
from impactcell.cli.estimate import estimate
from impactcell.cli.estimate_columns import COLUMNS
from impactcell.errors import CampaignError, NotConvergedError, PredictionError
from impactcell.records import Capture, Channel
from impactcell.web.texts.import_notes import page_note
from impactcell.web.texts.reasons import german_reason
from tests.taps import Tap

PROTOTYPE = Path(__file__).resolve().parents[3] / "config" / "cells" / "prototype.yaml"
SENSORS = {"force": Sensor(1e4, 0.4), "position": Sensor(1e4, 1.5e-6)}
COVARIATES = ("shot", "velocity_mm_per_min", "mass_kg", "direction")


def taps(viscous: bool = False) -> list[Tap]:
    rng = np.random.default_rng(1)
    return [
        Tap(
            velocity / 6e4, 0.2 * (1 + 0.01 * rng.normal()), mass_kg=mass, stroke_m=1.5e-3, direction=sign,
            stiffness=6.6e5, damping=430.0, **({} if viscous else {"effects": {}}),
        )
        for velocity in (2500, 3500, 4500, 5500)
        for mass in (18.9, 25.2)
        for sign in (1, -1)
    ]  # fmt: skip


def captures(made: list[Tap]) -> list[Capture]:
    rng = np.random.default_rng(2)
    return [tap.capture(rng, cycle=number) for number, tap in enumerate(made, 1)]


def campaign(directory: Path, shots: list[Capture], **changes: object) -> Path:
    whole = Campaign(Excitation.TAP, tuple(shots), stroke_m=1.5e-3, sensors=SENSORS, columns=COVARIATES)
    write(replace(whole, **changes), directory)  # type: ignore[arg-type]
    return directory


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_plant_is_fitted_and_every_shot_estimated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = taps()
    estimate(campaign(tmp_path / "c", captures(made)), None, tmp_path / "out.csv")
    found = rows(tmp_path / "out.csv")
    assert tuple(found[0]) == COLUMNS
    assert [row["shot"] for row in found] == [str(n) for n in range(1, len(made) + 1)]
    for column, most in (
        ("mu_s", 0.025),
        ("mu_s_force", 0.03),
        ("mu_s_distance", 0.05),
        ("mu_s_combined", 0.03),
    ):
        errors = [abs(float(row[column]) / tap.mu_s - 1.0) for row, tap in zip(found, made, strict=True)]
        assert np.mean(errors) < most, column
    assert all(abs(float(row["mu_k"]) / tap.mu_k - 1.0) < 2e-3 for row, tap in zip(found, made, strict=True))
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "plant fitted to 16 of 16 shots" in captured.err


def by_direction(asymmetry: float) -> list[Capture]:
    """Taps whose friction is larger along +1, by that share."""
    rng = np.random.default_rng(11)
    scatter = 1.0 + 0.01 * rng.standard_normal(12)
    signs = [1, -1] * 6
    return captures([
        Tap(0.06, 0.2 * (1.0 + asymmetry * sign) * factor, stroke_m=1.5e-3, direction=sign, effects={})
        for factor, sign in zip(scatter, signs, strict=True)
    ])  # fmt: skip


DIRECTION = re.compile(
    r"mu_k goes with direction: (\S+) ± (\S+) in 6 shots along \+1, (\S+) ± (\S+) in 6 shots along -1: .*"
)


def test_mu_k_that_goes_with_direction_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    estimate(campaign(tmp_path / "c", by_direction(0.05)), None, tmp_path / "o.csv")
    (note,) = [line for line in capsys.readouterr().err.splitlines() if "direction" in line]
    told = DIRECTION.fullmatch(note)
    assert told is not None
    forward, _, backward, _ = map(float, told.groups())
    assert forward == pytest.approx(0.76 * 0.2 * 1.05, rel=0.01)
    assert backward == pytest.approx(0.76 * 0.2 * 0.95, rel=0.01)
    language, german = page_note(note, "de")
    assert language == "de"
    assert german.startswith("µk hängt von der Richtung ab: 0,1")
    assert "in 6 Aufzeichnungen in Richtung +1, 0,1" in german
    assert "in 6 in Richtung -1: die Reibung ist richtungsabhängig" in german


def test_where_mu_k_scatters_as_much_nothing_is_said_of_direction(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    estimate(campaign(tmp_path / "c", by_direction(0.0)), None, tmp_path / "o.csv")
    assert "direction" not in capsys.readouterr().err


@pytest.mark.parametrize("factor", [1.0, 0.9])
def test_which_way_a_slide_went_is_its_direction(factor: float) -> None:
    """It has no direction of its own: nothing struck it."""
    there, back = (Channel(np.arange(4.0), sign * np.array([0.0, 1.0, 2.0, 2.5])) for sign in (1.0, -1.0))
    shots = tuple(Capture(n, math.nan, 1.0, None, back if n % 2 else there, direction=1) for n in range(1, 9))
    slides = Campaign(Excitation.FREE_SLIDE, shots)
    mu_k = {n: 0.2 * (factor if n % 2 else 1.0) + 1e-4 * n for n in range(1, 9)}
    assert bool(note_of_direction(slides, mu_k)) is (factor < 1.0)
    assert note_of_direction(slides, mu_k | dict.fromkeys((1, 3), math.nan)) == ""


def test_a_cells_model_is_used_and_rows_go_to_standard_output(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = [Tap(4000 / 6e4, stroke_m=1.5e-3), Tap(5500 / 6e4, 0.22, stroke_m=1.5e-3)]
    estimate(campaign(tmp_path / "c", captures(made)), PROTOTYPE, None)
    found = list(csv.DictReader(capsys.readouterr().out.splitlines()))
    for row, tap in zip(found, made, strict=True):
        assert float(row["mu_s"]) == pytest.approx(tap.mu_s, rel=0.06)
        assert float(row["mu_s_combined"]) == pytest.approx(tap.mu_s, rel=0.02)
        assert row["quality"] == "good"


def test_an_empty_mass_is_fitted(tmp_path: Path) -> None:
    made = taps()[:8]
    shots = [replace(shot, mass_kg=math.nan) if shot.cycle % 4 == 0 else shot for shot in captures(made)]
    estimate(campaign(tmp_path / "c", shots), None, tmp_path / "out.csv")
    for row, tap in zip(rows(tmp_path / "out.csv"), made, strict=True):
        assert float(row["mu_s_combined"]) == pytest.approx(tap.mu_s, rel=0.1)


def test_one_bad_shot_is_a_row_that_says_why(tmp_path: Path) -> None:
    shots = captures(taps())
    force = shots[3].force
    assert force is not None
    shots[3] = replace(shots[3], force=replace(force, values=np.minimum(force.values, 60.0)))
    estimate(campaign(tmp_path / "c", shots), None, tmp_path / "out.csv")
    found = rows(tmp_path / "out.csv")
    assert found[3]["quality"] == "bad"
    assert "clipped" in found[3]["reason"]
    assert found[3]["mu_s"] == ""
    assert all(row["quality"] != "bad" for row in found if row["shot"] != "4")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"velocity_m_s": 4500 / 6e4 / 6e4}, "check its velocity_mm_per_min (off by a factor of about 6e+4)"),
        ({"mass_kg": 12.6}, "check its mass_kg or force_n (off by a factor of about 1.5)"),
    ],
)
def test_a_shot_whose_setting_is_wrong_does_not_spoil_the_others(
    tmp_path: Path, change: dict[str, float], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    shots = captures(taps())
    shots[8] = replace(shots[8], **change)  # type: ignore[arg-type]  # of 4500 mm/min and 18.9 kg
    estimate(campaign(tmp_path / "c", shots), None, tmp_path / "out.csv")
    found = rows(tmp_path / "out.csv")
    assert [int(row["shot"]) for row in found] == list(range(1, 17))
    assert (found[8]["quality"], found[8]["mu_k_quality"], found[8]["mu_s"]) == ("bad", "bad", "")
    assert found[8]["reason"].endswith(told)
    assert all(row["quality"] == "good" for row in found if row["shot"] != "9")
    assert "Shot 9 is left out: " in capsys.readouterr().err


def test_free_slides_show_mu_k_only(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    times = np.arange(80) / 148.0
    moved = np.where(times < 0.3 / 2.0, 0.3 * times - times**2, 0.0225)
    shot = Capture(1, math.nan, 1.0, None, Channel(times, -moved + rng.normal(0, 1e-4, 80)))
    estimate(
        campaign(
            tmp_path / "c", [shot], excitation=Excitation.FREE_SLIDE, columns=("shot",),
            sensors={"position": Sensor(148.0, 1e-4)},
        ),
        None,
        tmp_path / "o.csv",
    )  # fmt: skip
    (row,) = rows(tmp_path / "o.csv")
    assert float(row["mu_k"]) == pytest.approx(2.0 / 9.81, abs=4.0 * float(row["mu_k_std"]))
    assert row["mu_s"] == ""
    assert (row["quality"], row["mu_k_quality"]) == ("bad", "good")
    assert row["reason"] == "a free slide shows mu_k only"


def viscous_slides(directory: Path, mass_kg: float, noise_m: float | None, c: float = 2.0) -> Path:
    """Slides of v' = -0.2 g - c v in closed form, to either side."""
    rng, braking, shots = np.random.default_rng(6), 0.2 * 9.81, []
    for number in range(1, 7):
        stop = math.log1p(c * 1.2 / braking) / c
        times = np.arange(0.0, stop + 0.05, 1e-3)
        moving = np.minimum(times, stop)
        moved = (1.2 + braking / c) / c * -np.expm1(-c * moving) - braking / c * moving
        values = (-1) ** number * moved + rng.normal(0.0, 2e-5, times.size)
        shots.append(Capture(number, math.nan, mass_kg, None, Channel(times, values)))
    sensors = {"position": Sensor(1e3, noise_m)}
    columns = ("shot", "mass_kg")
    return campaign(directory, shots, excitation=Excitation.FREE_SLIDE, columns=columns, sensors=sensors)


@pytest.mark.parametrize("noise_m", [2e-5, None])
def test_slides_that_constant_friction_misses_are_uncertain_with_their_gap(
    tmp_path: Path, noise_m: float | None
) -> None:
    """Their mu_k was `good`, and off by a hundred of its standard deviations."""
    estimate(viscous_slides(tmp_path / "c", 2.0, noise_m), None, tmp_path / "o.csv")
    for row in rows(tmp_path / "o.csv"):
        assert row["mu_k_quality"] == "uncertain"
        assert float(row["gap"]) > 5.0
        told = re.search(
            r"constant friction misses this slide: residuals by eighths of a slide are (\S+) times noise",
            row["reason"],
        )
        assert told is not None
        assert float(told[1]) > float(row["gap"])  # noise is averaged in them, a law is not
        assert row["reason"].endswith("; run `impactcell discrepancy`")
        assert abs(float(row["mu_k"]) - 0.2) < 2.0 * float(row["mu_k_std"])
        assert not set(german_reason(row["reason"]).split()) & {"the", "noise", "misses", "run", "shows"}


def test_what_slides_are_judged_by_is_told(tmp_path: Path) -> None:
    """A law that single samples hide: their residuals are those of noise, the means of eighths are not."""
    estimate(viscous_slides(tmp_path / "c", 2.0, 2e-5, c=0.002), None, tmp_path / "o.csv")
    found = rows(tmp_path / "o.csv")
    assert all(float(row["gap"]) < 1.1 for row in found)
    told = [
        re.search(r"misses .* slides?: .* of a slide are (\S+) times noise", row["reason"]) for row in found
    ]
    assert all(match is not None and float(match[1]) > 1.15 for match in told)


@pytest.mark.parametrize("stated_kg", [18.9, math.nan])
def test_what_a_cells_model_does_to_a_free_part_is_taken_off(
    tmp_path: Path, stated_kg: float, capsys: pytest.CaptureFixture[str]
) -> None:
    """The prototype has 85 N s/m, a part of 18.9 kg, and here a position that is known to 1 %."""
    settings = PROTOTYPE.read_text(encoding="utf-8").replace("../", f"{PROTOTYPE.parents[1]}/")
    settings = settings.replace("sensors:\n", "sensors:\n  position_scale_error_percent: 1.0\n")
    (tmp_path / "cell.yaml").write_text(settings, encoding="utf-8")
    slides = viscous_slides(tmp_path / "c", stated_kg, 2e-5, 85.0 / 18.9)
    estimate(slides, tmp_path / "cell.yaml", tmp_path / "o.csv")
    for row in rows(tmp_path / "o.csv"):
        assert row["mu_k_quality"] == "good"
        assert float(row["mu_k"]) == pytest.approx(0.2, abs=5e-4)
        assert float(row["mu_k_std"]) == pytest.approx(0.01 * 0.2, rel=0.05)
    told = "the mass of 6 slides is not stated: 18.9 kg, as the cell has it" in capsys.readouterr().err
    assert told == math.isnan(stated_kg)


def test_forces_of_a_model_are_left_out_of_slides_without_a_mass_and_that_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = PROTOTYPE.read_text(encoding="utf-8").replace("../", f"{PROTOTYPE.parents[1]}/")
    (tmp_path / "cell.yaml").write_text(settings.replace("part:\n  mass_kg: 18.9\n", ""), encoding="utf-8")
    estimate(viscous_slides(tmp_path / "c", math.nan, 2e-5), tmp_path / "cell.yaml", tmp_path / "o.csv")
    assert "viscous_friction of the cell's model is left out of 6 slides" in capsys.readouterr().err
    assert {row["mu_k_quality"] for row in rows(tmp_path / "o.csv")} == {"uncertain"}


def test_why_a_slide_shows_no_friction_is_in_its_row(tmp_path: Path) -> None:
    """It was "a free slide shows mu_k only", of one that shows none."""
    whole = read_campaign(viscous_slides(tmp_path / "c", 2.0, 2e-5))
    position = whole.shots[2].position
    assert position is not None
    short = replace(position, time_s=position.time_s[:5], values=position.values[:5])
    shots = [*whole.shots[:2], replace(whole.shots[2], position=short), *whole.shots[3:]]
    write(replace(whole, shots=tuple(shots)), tmp_path / "short")
    estimate(tmp_path / "short", None, tmp_path / "o.csv")
    row = rows(tmp_path / "o.csv")[2]
    assert (row["mu_k_quality"], row["gap"]) == ("bad", "")
    assert row["reason"].endswith("the position record has only 5 samples")


@pytest.mark.parametrize("share", [0.9, 0.4])
def test_where_all_forces_are_clipped_the_slides_show_mu_k(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], share: float
) -> None:
    made = taps()
    shots = []
    for shot in captures(made):
        assert shot.force is not None
        values = np.minimum(shot.force.values, share * shot.force.values.max())
        shots.append(replace(shot, force=replace(shot.force, values=values)))
    estimate(campaign(tmp_path / "c", shots), None, tmp_path / "out.csv")
    for row, tap in zip(rows(tmp_path / "out.csv"), made, strict=True):
        assert float(row["mu_k"]) == pytest.approx(tap.mu_k, rel=5e-3)
        assert abs(float(row["mu_k"]) - tap.mu_k) < 3.0 * float(row["mu_k_std"])
        assert (row["mu_s"], row["quality"], row["mu_k_quality"]) == ("", "bad", "uncertain")
        assert row["estimator"] == "none"
        assert re.search(r"force samples in a row stand at .* N: clipped", row["reason"])
        assert "abgeschnitten" in german_reason(row["reason"])
    (note,) = [line for line in capsys.readouterr().err.splitlines() if "no plant" in line]
    assert "by the slides: no tap of the campaign can be used; shot 1: " in note
    assert page_note(note, "de")[0] == "de"


def test_taps_that_no_plant_makes_show_mu_k_by_their_slides(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fit(*_: object) -> None:
        raise NotConvergedError("no k, b and mu_k/mu_s explain its taps")

    monkeypatch.setattr("impactcell.cli.estimate.fit_plant_and_onset", fit)
    made = taps()
    estimate(campaign(tmp_path / "c", captures(made)), None, tmp_path / "out.csv")
    for row, tap in zip(rows(tmp_path / "out.csv"), made, strict=True):
        assert float(row["mu_k"]) == pytest.approx(tap.mu_k, rel=5e-3)
        assert float(row["peak_force_n"]) > 0.0
        assert german_reason(row["reason"]) == "an diese Stöße ließ sich kein Modell anpassen"


def test_what_cannot_be_used_is_named(tmp_path: Path) -> None:
    with pytest.raises(CampaignError):
        estimate(tmp_path / "nowhere")
    shots = captures(taps()[:2])
    with pytest.raises(CampaignError, match="cannot be written"):
        estimate(campaign(tmp_path / "c", shots), PROTOTYPE, tmp_path / "no" / "out.csv")
    bare = [replace(shot, force=None) for shot in shots]
    with pytest.raises(PredictionError, match="no tap of the campaign can be used"):
        estimate(campaign(tmp_path / "d", bare, sensors={"position": SENSORS["position"]}))


@pytest.mark.slow
@pytest.mark.shared_data
@pytest.mark.parametrize(("name", "most"), [("no-effect", 0.01), ("one-effect", 0.03)])
def test_the_sample_campaigns(name: str, most: float, shared_data: Path, tmp_path: Path) -> None:
    directory = shared_data / "sample-campaigns" / name
    estimate(directory, None, tmp_path / "out.csv")
    truth = {
        shot["shot"]: shot
        for shot in json.loads(directory.with_name(f"{name}.truth.json").read_text())["shots"]
    }
    errors = [
        abs(float(row["mu_s"]) / truth[int(row["shot"])]["mu_s"] - 1) for row in rows(tmp_path / "out.csv")
    ]
    assert len(errors) == 60
    assert np.mean(errors) < most


def recorded_from(shift_s: float, pretrigger: int = 300) -> list[Capture]:
    """Give the captures with samples before contact, and times that count from `shift_s` before it."""
    rng = np.random.default_rng(8)

    def earlier(channel: Channel | None, noise: float, at: float) -> Channel:
        assert channel is not None
        before = channel.time_s[0] - np.arange(pretrigger, 1, -1) * 1e-4
        return Channel(
            np.concatenate([before, channel.time_s]) + shift_s,
            np.concatenate([at + rng.normal(0.0, noise, before.size), channel.values]),
        )

    return [
        replace(
            shot, force=earlier(shot.force, 0.4, 0.0), position=earlier(shot.position, 1.5e-6, shot.start_m)
        )
        for shot in captures(taps())
    ]


@pytest.mark.parametrize("shift_s", [0.0, 0.03])
def test_samples_before_contact_are_expected(
    tmp_path: Path, shift_s: float, capsys: pytest.CaptureFixture[str]
) -> None:
    shots = tuple(recorded_from(shift_s))
    write(
        Campaign(Excitation.TAP, shots, stroke_m=1.5e-3, sensors=SENSORS, columns=COVARIATES), tmp_path / "c"
    )
    estimate(tmp_path / "c", output=tmp_path / "out.csv")
    told = capsys.readouterr().err
    assert "pretrigger" in told
    assert ("First contact came 30" in told) == (shift_s > 0.0)
    with (tmp_path / "out.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(shots)
    for row, tap in zip(rows, taps(), strict=True):
        assert float(row["mu_k"]) == pytest.approx(tap.mu_k, rel=0.02)


@pytest.mark.parametrize(
    ("channel", "told"),
    [("position", r"unit of position_m, time_s or velocity_mm_per_min"), ("force", "unit of force_n")],
)
def test_a_unit_that_is_wrong_is_told(tmp_path: Path, channel: str, told: str) -> None:
    shots = tuple(
        replace(
            shot, **{channel: replace(getattr(shot, channel), values=1e3 * getattr(shot, channel).values)}
        )
        for shot in captures(taps())
    )
    write(
        Campaign(Excitation.TAP, shots, stroke_m=1.5e-3, sensors=SENSORS, columns=COVARIATES), tmp_path / "c"
    )
    with pytest.raises(CampaignError, match=f"^{re.escape(str(tmp_path / 'c'))}: .*{told}"):
        estimate(tmp_path / "c")


def test_traces_sampled_without_pause_or_stated_without_noise_are_no_traceback(tmp_path: Path) -> None:
    shots = captures(taps()[:2])
    quick = [
        replace(shot, force=replace(shot.force, time_s=1e-25 * shot.force.time_s))
        for shot in shots if shot.force is not None
    ]  # fmt: skip
    write(Campaign(Excitation.TAP, tuple(quick), 9.81, 1.5e-3, SENSORS, COVARIATES), tmp_path / "quick")
    with pytest.raises((CampaignError, PredictionError)):
        estimate(tmp_path / "quick")


@pytest.mark.slow
def test_rows_replace_a_file_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(
        Campaign(Excitation.TAP, tuple(captures(taps())), 9.81, 1.5e-3, SENSORS, COVARIATES), tmp_path / "c"
    )
    out = tmp_path / "out.csv"
    out.write_text("before", encoding="utf-8")

    def interrupted(_: object, file: TextIO) -> None:
        file.write("shot,mu_s")
        raise KeyboardInterrupt

    monkeypatch.setattr("impactcell.cli.estimate._write", interrupted)
    with pytest.raises(KeyboardInterrupt):
        estimate(tmp_path / "c", PROTOTYPE, out)
    assert out.read_text(encoding="utf-8") == "before"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["c", "out.csv"]


def pushed(velocity_mm_per_min: float, rest_s: float, stroke_m: float) -> list[Capture]:
    """Taps that differ in velocity, with a record that goes on after the part has come to rest."""
    rng, shots = np.random.default_rng(21), []
    for number, factor in enumerate((1.0, 1.3, 1.7, 2.0), 1):
        tap = Tap(factor * velocity_mm_per_min / 6e4, stroke_m=stroke_m, effects={})
        motion = tap.motion()
        time = np.arange(1, round((motion.end_s + rest_s) * 1e4)) * 1e-4
        force = motion.force_n(time) + rng.normal(0.0, 0.4, time.size)
        position = motion.position_m(time) + rng.normal(0.0, 1.5e-6, time.size)
        shots.append(
            Capture(
                number, tap.velocity_m_s, tap.mass_kg, Channel(time, force, 0.4),
                Channel(time, position, 1.5e-6), stroke_m=stroke_m,
            )
        )  # fmt: skip
    return shots


@pytest.mark.slow
@pytest.mark.parametrize(
    ("velocity", "rest_s", "stroke_m", "usable"),
    [(2000.0, 2.0, 1.5e-3, 4), (400.0, 0.05, 1.5e-3, 1)],
    ids=["a record that goes on for seconds", "a slow push, where friction outweighs momentum"],
)
def test_no_unit_is_doubted_where_none_is_wrong(
    velocity: float, rest_s: float, stroke_m: float, usable: int, tmp_path: Path
) -> None:
    shots = pushed(velocity, rest_s, stroke_m)
    estimate(campaign(tmp_path / "c", shots), output=tmp_path / "out.csv")
    told = rows(tmp_path / "out.csv")
    good = [row for row in told if row["quality"] == "good"]
    assert len(good) >= usable
    for row in good:
        assert float(row["mu_k"]) == pytest.approx(0.152, abs=4.0 * float(row["mu_k_std"]))
    assert not any("predictors" in row["reason"] for row in told)
