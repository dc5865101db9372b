"""A model that cannot predict is said to be one, in words: head line and report, English and German."""

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from impactcell.api.machine_findings import write_machine_findings
from impactcell.campaign import Campaign, Coordinate, Excitation, write
from impactcell.cli.estimate import estimate
from impactcell.discrepancy.data import prepare
from impactcell.discrepancy.machine import BaseModel, NumberPrior, investigate_machine
from impactcell.discrepancy.machine.fits.record_checks import check_blocks
from impactcell.discrepancy.report import sentences
from impactcell.errors import CampaignError
from impactcell.german.findings import german_headline
from impactcell.german.open_loop import german_open_loop_sentence, open_loop_sentence
from impactcell.records import Capture, Channel
from impactcell.web.texts.import_faults import page_fault

PENDULUM = BaseModel(
    coordinate=Coordinate.ROTATION,
    inertia=NumberPrior(0.02),
    gravity_torque=NumberPrior(0.55, math.inf),
)


def swings(rates: list[float], lasting_s: float) -> Campaign:
    """Free swings of viscously damped pendulums in closed form, one a rate of its swing [rad/s]."""
    rng = np.random.default_rng(4)
    time = np.arange(0.0, lasting_s, 0.01)
    shots = []
    for number, rate in enumerate(rates, 1):
        angle = 0.1 * np.exp(-0.1 * time) * np.cos(rate * time) + rng.normal(0.0, 1e-4, time.size)
        shots.append(Capture(number, math.nan, math.nan, None, Channel(time, angle, 1e-4)))
    return Campaign(Excitation.FREE_SLIDE, tuple(shots), coordinate=Coordinate.ROTATION)


@pytest.mark.slow
def test_logs_that_are_not_of_one_machine_are_asked_after(tmp_path: Path) -> None:
    campaign = swings([3.0, 9.0, 3.2, 8.0], 8.0)
    finding = investigate_machine(campaign, PENDULUM)
    errors = finding.simulated
    assert errors[-1].fit_percent < 0.0
    times = f"{1.0 - errors[-1].fit_percent / 100.0:.3g}"
    write_machine_findings(finding, campaign, tmp_path / "found", "four logs")
    result = json.loads((tmp_path / "found" / "result.json").read_text(encoding="utf-8"))
    assert result["headline"].endswith(
        f"does not follow the held-out position: it errs {times} times as much as a constant. "
        "See whether all records are of one machine in one state, or whether the model lacks something, as "
        "its damping."
    )
    pages = [
        (tmp_path / "found" / name).read_text(encoding="utf-8") for name in ("report.html", "report.de.html")
    ]
    assert "does not follow the held-out position" in pages[0]
    assert f"nicht (Position): es irrt {times.replace('.', ',')}-mal so viel wie eine Konstante." in pages[1]
    assert "ob alle Messungen von einer Maschine" in pages[1]
    assert "ob alle Messungen von einer Maschine" in german_headline(result)


@pytest.mark.parametrize(("fit", "says"), [(-476.0, "5.76"), (20.0, "0.8"), (60.0, ""), (math.nan, "")])
def test_what_is_said_goes_by_how_far_it_is_from_a_constant(fit: float, says: str) -> None:
    english, german = open_loop_sentence("position", fit, "shots"), german_open_loop_sentence("Position", fit)
    assert bool(english) is bool(german) is bool(says)
    assert says in english
    assert says.replace(".", ",") in german
    assert ("See whether all shots" in english) is ("Zu prüfen ist" in german) is (fit < 0.0)


def test_taps_are_told_the_same_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sentences, "_conclusion", lambda _: "Missing: it.")
    for fit, said in ((90.0, "Missing: it."), (30.0, "it errs 0.7 times as much as a constant.")):
        simulation = SimpleNamespace(channel="position", after=SimpleNamespace(fit_percent=fit))
        prepared = SimpleNamespace(excitation=SimpleNamespace(unit="shots"))
        found: Any = SimpleNamespace(simulation=simulation, prepared=prepared, law=None)
        assert sentences.headline(found).endswith(said)


@pytest.mark.parametrize(("rates", "lasting_s"), [([3.0, 3.0], 4.0), ([5.2], 3.0)])
def test_records_too_short_to_hold_anything_out_are_refused(rates: list[float], lasting_s: float) -> None:
    with pytest.raises(CampaignError, match=r"too short .*--test.* `block_s`"):
        investigate_machine(swings(rates, lasting_s), PENDULUM)


def test_records_too_short_for_thirds_are_refused_before_any_work() -> None:
    """No third of a record is a block where it has no more than two."""
    refused: Any = SimpleNamespace(
        held=None, block_s=499.0, records=[SimpleNamespace(time_s=np.arange(0.0, 600.0))]
    )
    with pytest.raises(CampaignError, match=r"too short for blocks of 499 s, .*--test.* `block_s`"):
        check_blocks(refused)


def test_what_turns_is_asked_for_a_base_model() -> None:
    """Radians a second are no share of gravity: no unit is wrong where a base model is missing."""
    with pytest.raises(CampaignError, match=r"give a base model \(--base"):
        prepare(swings([3.0] * 6, 8.0))


def test_a_run_down_of_what_turns_is_no_slide(tmp_path: Path) -> None:
    """At 2 rad/s² it seemed to be a part on a surface of mu_k = 0.204, and that was good."""
    time = np.arange(0.0, 2.0, 1e-3)
    rng = np.random.default_rng(3)
    shots = tuple(
        Capture(number, math.nan, 0.02, None, Channel(time, angle + rng.normal(0.0, 1e-4, time.size), 1e-4))
        for number, speed in enumerate(np.linspace(3.0, 4.0, 12), 1)
        for until in [np.minimum(time, speed / 2.0)]
        for angle in [speed * until - until**2]
    )
    given = Campaign(Excitation.FREE_SLIDE, shots, coordinate=Coordinate.ROTATION)
    with pytest.raises(CampaignError, match=r"what turns .* \(--base"):
        prepare(given)
    write(given, tmp_path / "wheel")
    with pytest.raises(CampaignError, match=r"wheel: what turns .* \(--base") as refused:
        estimate(tmp_path / "wheel")
    language, said = page_fault(str(refused.value), "de")
    assert (language, "Grundmodell" in said) == ("de", True)


@pytest.mark.slow
@pytest.mark.parametrize("gravity", [0.55, 0.0])
def test_a_swing_that_ends_where_it_began_is_no_presliding(gravity: float) -> None:
    """Nor where the base model has no gravity: that is what is asked after, and nobody strikes a pendulum."""
    time = np.arange(0.0, 24.0 * math.pi, 0.01)
    rng = np.random.default_rng(7)
    angle = 0.1 * np.exp(-0.002 * time) * np.cos(3.0 * time) + rng.normal(0.0, 1e-4, time.size)
    shot = Capture(1, math.nan, math.nan, None, Channel(time, angle, 1e-4))
    campaign = Campaign(Excitation.FREE_SLIDE, (shot,), coordinate=Coordinate.ROTATION)
    base = BaseModel(
        coordinate=Coordinate.ROTATION, inertia=NumberPrior(0.02), gravity_torque=NumberPrior(gravity)
    )
    finding = investigate_machine(campaign, base)
    assert not any("presliding" in note for note in finding.notes)
    if not gravity:
        assert (finding.verdict, finding.established) == ("tied", ("restoring_force",))
        assert any("gravity_torque_n_m is free in the base model" in note for note in finding.notes)


def test_a_motion_within_the_noise_of_its_position_is_refused_with_the_way_out() -> None:
    time = np.arange(0.0, 20.0, 0.005)
    noisy = 0.1 * np.cos(3.0 * time) + np.random.default_rng(8).normal(0.0, 0.05, time.size)
    shot = Capture(1, math.nan, math.nan, None, Channel(time, noisy, None))
    campaign = Campaign(Excitation.FREE_SLIDE, (shot,), coordinate=Coordinate.ROTATION)
    with pytest.raises(
        CampaignError, match=r"nowhere does the part move faster .* record a larger or faster"
    ):
        investigate_machine(campaign, PENDULUM)
