"""Campaigns: same bytes for the same seed, read by the product's own reader, with the truth beside them."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from impactcell.campaign import Excitation, read
from impactcell.errors import CampaignError, SettingsError
from simulator.__main__ import main
from simulator.campaign import make
from simulator.campaign_files import write
from simulator.campaign_scenario import CampaignScenario
from simulator.scenario_file import load

SMALL: dict[str, Any] = {
    "format": 1,
    "velocities_mm_per_min": [3000.0, 6000.0],
    "masses_kg": [18.9],
    "replicates": 1,
    "batches": ["A", "B"],
    "sensors": {
        "force": {"rate_hz": 10000, "noise_std": 0.4},
        "position": {"rate_hz": 2000, "noise_std": 1.5e-6},
    },
}
EXAMPLE = Path(__file__).parents[3] / "config" / "sim" / "campaign.yaml"


def scenario(**changed: Any) -> CampaignScenario:
    return CampaignScenario.model_validate(SMALL | changed)


def on_disk(directory: Path, **changed: Any) -> Path:
    file = directory / "scenario.yaml"
    file.write_text(yaml.safe_dump(SMALL | changed))
    return file


def content(directory: Path) -> dict[str, bytes]:
    return {
        str(file.relative_to(directory)): file.read_bytes() for file in directory.rglob("*") if file.is_file()
    }


def test_the_example_is_as_it_says() -> None:
    example = load(EXAMPLE, CampaignScenario)
    assert len(make(example.model_copy(update={"shots": None, "replicates": 1}))[1]) == 30
    documented = set(CampaignScenario.model_fields) - {"shots"}
    assert documented <= set(yaml.safe_load(EXAMPLE.read_text()))


def test_same_seed_same_bytes(tmp_path: Path) -> None:
    first, second, third = (tmp_path / name / "c" for name in ("one", "two", "three"))
    for directory, seed in ((first, 4), (second, 4), (third, 5)):
        directory.parent.mkdir()
        write(scenario(seed=seed), directory)
    assert content(first.parent) == content(second.parent)
    assert content(first) != content(third)


def test_reads_back_with_unequal_rates(tmp_path: Path) -> None:
    truth = json.loads(write(scenario(), tmp_path / "c").read_text())
    campaign = read(tmp_path / "c")
    assert campaign.excitation is Excitation.TAP
    assert len(campaign.shots) == 4 == len(truth["shots"])
    assert [shot.batch_id for shot in campaign.shots] == ["A", "A", "B", "B"]
    for shot, told in zip(campaign.shots, truth["shots"], strict=True):
        assert shot.force is not None
        assert shot.position is not None
        np.testing.assert_allclose(np.diff(shot.position.time_s), 5e-4, atol=1e-9)
        assert shot.force.values.max() == pytest.approx(told["peak_force_n"], abs=2.0)
        moved = shot.position.values[-5:].mean() * shot.direction
        assert moved == pytest.approx(told["displacement_m"], abs=3e-6)
        assert told["mu_k"] == pytest.approx(told["mu_s"] * 0.76)


def test_noise_is_what_it_says(tmp_path: Path) -> None:
    _, shots = make(scenario(seed=3))
    residuals = np.concatenate(
        [shot.channels["force"][1] - shot.motion.force_n(shot.channels["force"][0]) for shot in shots]
    )
    assert residuals.std() == pytest.approx(0.4, rel=0.05)
    _, shots = make(scenario(seed=3, noise={"colour": "coloured", "correlation_time_s": 5e-4}))
    residuals = np.concatenate(
        [shot.channels["force"][1] - shot.motion.force_n(shot.channels["force"][0]) for shot in shots]
    )
    assert residuals.std() == pytest.approx(0.4, rel=0.1)
    lag = np.corrcoef(residuals[1:], residuals[:-1])[0, 1]
    assert lag == pytest.approx(np.exp(-1.0 / (10000 * 5e-4)), abs=0.05)


def test_hidden_effects_and_their_strengths(tmp_path: Path) -> None:
    file = on_disk(tmp_path, strengths={"quadratic_drag": {"drag_coefficient_n_s2_per_m2": 111.0}})
    arguments = ["campaign", str(file), "-o", str(tmp_path / "c")]
    assert main([*arguments, "--hide", "quadratic_drag", "--hide", "surface_tilt"]) == 0
    truth = json.loads((tmp_path / "c.truth.json").read_text())
    assert truth["effect"] == "quadratic_drag+surface_tilt"
    assert truth["effects"]["quadratic_drag"] == {"drag_coefficient_n_s2_per_m2": 111.0}
    assert list(truth["effects"]["surface_tilt"]) == ["tilt_rad"]


def test_no_viscous_friction_unless_hidden() -> None:
    base, _ = make(scenario())
    assert base.effects == {}
    base, _ = make(scenario(hide=["viscous_friction"]))
    assert list(base.effects) == ["viscous_friction"]


def test_free_slide_and_driven(tmp_path: Path) -> None:
    position = {"position": {"rate_hz": 1000, "noise_std": 1e-5}}
    write(scenario(excitation="free_slide", sensors=position), tmp_path / "slide")
    slide = read(tmp_path / "slide")
    assert slide.excitation is Excitation.FREE_SLIDE
    assert slide.shots[0].force is None
    force = {"force": {"rate_hz": 1000, "noise_std": 0.1}}
    driven = scenario(excitation="driven", sensors=position | force, drive={"duration_s": 1.5}, replicates=2)
    write(driven, tmp_path / "driven")
    record = read(tmp_path / "driven")
    assert record.excitation is Excitation.DRIVEN
    assert len(record.shots) == 2
    shot = record.shots[0]
    assert shot.force is not None
    assert shot.position is not None
    assert shot.force.time_s[-1] == pytest.approx(1.5)
    assert np.ptp(shot.position.values) > 1e-3
    assert shot.force.values.min() < 0.0 < shot.force.values.max()


def test_a_lagging_or_late_sensor_shows_another_drive() -> None:
    rate, lag, late = 1000.0, 0.02, 0.005
    sensors = {name: {"rate_hz": rate, "noise_std": 0.0} for name in ("force", "position")}
    same = {"excitation": "driven", "sensors": sensors, "drive": {"duration_s": 1.0}, "shots": 1}
    same |= {"strengths": {"force_sensor_lag": {"time_constant_s": lag}, "channel_skew": {"delay_s": late}}}
    time, force = make(scenario(**same))[1][0].channels["force"]
    _, lagged = make(scenario(**same, hide=["force_sensor_lag"]))[1][0].channels["force"]
    _, delayed = make(scenario(**same, hide=["channel_skew"]))[1][0].channels["force"]
    # tau G' + G = F, in the middle of the record by central differences; and G(t) = F(t - delay).
    np.testing.assert_allclose(lag * np.gradient(lagged, time)[1:-1] + lagged[1:-1], force[1:-1], atol=0.05)
    np.testing.assert_allclose(delayed[5:], force[:-5], atol=1e-9)


def test_gaps_resolution_unstated_noise_and_mass(tmp_path: Path) -> None:
    sensors = {
        "force": {"rate_hz": 10000, "noise_std": 0.4, "gap_share": 0.2},
        "position": {"rate_hz": 10000, "noise_std": 1.5e-6, "resolution": 5e-7},
    }
    changed = {"sensors": sensors, "noise": {"stated": False}, "mass_stated": False, "starts_m": [0.0, 0.01]}
    write(scenario(**changed), tmp_path / "c")
    campaign = read(tmp_path / "c")
    shot = campaign.shots[0]
    assert campaign.sensors["force"].noise_std is None
    assert np.isnan(shot.mass_kg)
    assert shot.force is not None
    assert shot.position is not None
    assert np.diff(shot.force.time_s).max() > 0.005
    steps = shot.position.values / 5e-7
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-3)
    assert {shot.start_m for shot in campaign.shots} == {0.0, 0.01}


def test_number_of_shots_and_jitter() -> None:
    _, shots = make(scenario(shots=7, velocity_jitter=0.1))
    assert len(shots) == 7
    assert len({shot.plan.velocity for shot in shots}) == 7


def test_the_directory_in_which_one_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, here = on_disk(tmp_path, shots=1), tmp_path / "here"
    (here / "below").mkdir(parents=True)
    place = here.stat().st_ino
    for directory in (here, here / "below"):  # `..` has `below` in it by then
        monkeypatch.chdir(directory)
        assert main(["campaign", str(file), "-o", "."]) == (2 if directory == here else 0)
    assert sorted(part.name for part in here.iterdir()) == ["below", "below.truth.json"]
    assert sorted(part.name for part in (here / "below").iterdir()) == [
        "campaign.yaml",
        "shots.csv",
        "traces",
    ]
    assert here.stat().st_ino == place
    assert len(read(Path()).shots) == 1, "a shell that stands there sees them"
    assert main(["campaign", str(file), "-o", ".."]) == 2
    assert main(["campaign", str(file), "-o", "/"]) == 2


@pytest.mark.parametrize("told", ["velocity", "mass"])
def test_scatter_of_what_is_told_keeps_it_above_zero(told: str, tmp_path: Path) -> None:
    changed = {"told": {f"{told}_scatter": 0.9}, "shots": 12, "friction_scatter": 0.6, "ratio_scatter": 0.6}
    truth = json.loads(write(scenario(**changed), tmp_path / "c").read_text())
    for shot in truth["shots"]:
        assert min(shot["velocity_over_told"], shot["mass_kg"], shot["mu_s"], shot["mu_k"]) > 0.0
    over = [shot.plan for shot in make(scenario(**changed))[1]]
    assert min(getattr(plan, f"{told}_over_told") for plan in over) < 0.5


def test_what_never_came_to_zero_is_drawn_as_ever() -> None:
    """As it always was for this seed: 1 + error + scatter z, of a generator of its own."""
    told = {"velocity_error": 0.01, "velocity_scatter": 0.003, "mass_error": -0.02, "mass_scatter": 0.01}
    _, shots = make(scenario(told=told, seed=9))
    random = np.random.default_rng(np.random.SeedSequence(9).spawn(4)[3])
    for shot in shots:
        velocity, mass = random.standard_normal(2)
        assert shot.plan.velocity_over_told == 1.0 + 0.01 + 0.003 * velocity
        assert shot.plan.mass_over_told == 1.0 - 0.02 + 0.01 * mass


def test_never_overwrites(tmp_path: Path) -> None:
    write(scenario(), tmp_path / "c")
    with pytest.raises(CampaignError, match="exists already"):
        write(scenario(), tmp_path / "c")
    assert main(["campaign", str(on_disk(tmp_path)), "-o", str(tmp_path / "c")]) == 2


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"hide": ["wind"]}, "hide: unknown effect 'wind'"),
        ({"hide": ["surface_tilt", "surface_tilt"]}, "hidden once at most"),
        ({"strengths": {"surface_tilt": {"angle": 1.0}}}, "surface_tilt has no parameter 'angle'"),
        ({"masses_kg": []}, "masses_kg: needs at least one entry"),
        ({"masses_kg": [-1.0]}, "masses_kg[0]: "),
        ({"velocity": 3}, "unknown key 'velocity'"),
        ({"excitation": "push"}, "excitation: "),
        ({"format": 2}, "format: "),
        ({"dwell_s": [150.0, 1.0]}, "dwell_s: has to be [low, high], and 150 is above 1"),
        ({"dwell_s": [150.0]}, "'dwell_s[1]' is missing"),
        ({"drive": {"band_hz": [6.0, 0.7]}}, "drive.band_hz: has to be [low, high], and 6 is above 0.7"),
        ({"sensors": {}}, "sensors: a campaign of excitation tap records force or position"),
        (
            {"excitation": "driven", "sensors": {"position": {"rate_hz": 1.0, "noise_std": 0.0}}},
            "force and position",
        ),
    ],
)
def test_faults_are_told_with_file_line_and_key(
    tmp_path: Path, changed: dict[str, Any], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = on_disk(tmp_path, **changed)
    with pytest.raises(SettingsError) as caught:
        load(file, CampaignScenario)
    assert message in str(caught.value)
    assert str(caught.value).startswith(f"{file}:")
    assert main(["campaign", str(file), "-o", str(tmp_path / "c")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "c").exists()


def test_a_part_that_never_stops_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = on_disk(tmp_path, directions=[1], strengths={"surface_tilt": {"tilt_rad": -0.5}})
    assert main(["campaign", str(file), "-o", str(tmp_path / "c"), "--hide", "surface_tilt"]) == 1
    assert "still slides" in capsys.readouterr().err
    assert not (tmp_path / "c").exists()


def test_quiet_and_verbose(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(on_disk(tmp_path, shots=1))
    assert main(["campaign", file, "-o", str(tmp_path / "a"), "-q"]) == 0
    assert capsys.readouterr().out == ""
    assert main(["campaign", file, "-o", str(tmp_path / "b"), "-v"]) == 0
    assert "hidden: nothing" in capsys.readouterr().out


def test_unknown_effect_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = on_disk(tmp_path)
    assert main(["campaign", str(file), "-o", str(tmp_path / "c"), "--hide", "wind"]) == 2
    assert "unknown effect 'wind'" in capsys.readouterr().err
