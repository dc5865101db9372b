"""An encoder off its centre: scipy's integrator swings the pendulum, the angle is bent afterwards."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from impactcell.api.machine_findings import write_machine_findings
from impactcell.campaign import Excitation
from impactcell.discrepancy.machine import (
    ECCENTRICITY,
    MachineFinding,
    NumberPrior,
    Response,
    investigate_machine,
    simulate_held_out,
)
from impactcell.discrepancy.report import (
    german_machine_sentences,
    german_sentences,
    machine_result,
    machine_sentences,
)
from impactcell.errors import SettingsError
from impactcell.records import Capture, Channel
from impactcell.settings.base_model import base_model_text, read_base_model
from tests.discrepancy.test_base_model import NOISE, PENDULUM, base_of, pendulum, swings
from tests.discrepancy.test_machine_laws import pendulum as pushed

pytestmark = pytest.mark.slow

COSINE, SINE = 2.0e-3, -1.2e-3
"""Of the encoder [rad]."""
FREE = PENDULUM + "  position_eccentricity: {std: 0.005}\n"
SLIDE = """\
format: 1
coordinate: translation
excitation: free
mass_kg: 1
nuisances: {position_eccentricity: {std: 0.1}}
"""


def bent(shots: tuple[Capture, ...], cosine: float, sine: float) -> tuple[Capture, ...]:
    """What the encoder reads of the same swings."""
    read = []
    for shot in shots:
        assert shot.position is not None
        angle = shot.position.values
        values = angle + cosine * np.cos(angle) + sine * np.sin(angle)
        read.append(replace(shot, position=Channel(shot.position.time_s, values, NOISE)))
    return tuple(read)


def amplitudes(finding: MachineFinding) -> list[tuple[float, float, float]]:
    """Each amplitude between the ends of its interval."""
    fit = finding.final.fit
    places = [fit.columns.index((ECCENTRICITY, 0.0, number)) for number in range(2)]
    return [tuple(float(part[place]) for part in (fit.low, fit.coefficients, fit.high)) for place in places]  # type: ignore[misc]


@pytest.mark.parametrize(("drag", "times"), [(2e-5, 1.0), (1.5e-4, 4.0)])
def test_a_drag_is_named_though_the_encoder_explains_more(drag: float, times: float, tmp_path: Path) -> None:
    """Both are missing, and either holds beside the other: it was `unknown` but for the encoder."""
    read = bent(swings(drag), times * COSINE, times * SINE)
    finding = investigate_machine(pendulum(read), base_of(tmp_path, PENDULUM))
    assert finding.established == ("quadratic_drag",)
    assert finding.fall.after < finding.fall.before
    [note] = [note for note in finding.notes if note.startswith("An encoder")]
    told = re.search(r"turns (\S+) mrad off its centre would explain \d+ % of what remains", note)
    assert told is not None
    assert float(told[1]) == pytest.approx(1e3 * times * math.hypot(COSINE, SINE), rel=0.05)


def test_an_encoder_off_its_centre_is_told_from_the_machine(tmp_path: Path) -> None:
    finding = investigate_machine(pendulum(bent(swings(4e-4), COSINE, SINE)), base_of(tmp_path, FREE))
    assert finding.established == ("quadratic_drag",)
    assert finding.fall.after < 1.3
    for (low, value, high), true in zip(amplitudes(finding), (COSINE, SINE), strict=True):
        assert value == pytest.approx(true, rel=0.05)
        assert abs(value - true) < high - low  # twice what 95 % are within
    blind = investigate_machine(pendulum(bent(swings(4e-4), COSINE, SINE)), base_of(tmp_path, PENDULUM))
    assert blind.fall.after > 10.0
    knows, not_knows = (simulate_held_out(one, one.final).rmse for one in (finding, blind))
    assert knows < 0.5 * not_knows
    document = json.loads(json.dumps(machine_result.machine_document(finding)))
    told = document["nominal"]["position_eccentricity_cosine"]
    assert told["value"] == pytest.approx(COSINE, rel=0.05)
    assert told["ci95"][0] < told["value"] < told["ci95"][1]


def test_an_encoder_in_its_centre_is_not_called_off_it(tmp_path: Path) -> None:
    finding = investigate_machine(pendulum(swings(4e-4)), base_of(tmp_path, FREE))
    assert finding.established == ("quadratic_drag",)
    for low, value, high in amplitudes(finding):
        assert low < 0.0 < high
        assert abs(value) < 3e-4


def test_nothing_of_the_machine_is_named_that_the_encoder_explains_as_well(tmp_path: Path) -> None:
    """All that is missing is the encoder's; friction by direction would do nearly as well."""
    campaign = pendulum(bent(swings(0.0), COSINE, SINE))
    finding = investigate_machine(campaign, base_of(tmp_path, PENDULUM))
    assert finding.verdict == "unknown"
    assert finding.steps[0].trials[0].term.choice.name == "directional_viscous_friction"
    reason = finding.steps[0].reason
    told = re.fullmatch(
        r"an encoder that turns (\S+) mrad off its centre would explain (\d+) % of it", reason
    )
    assert told, reason
    assert float(told[1]) == pytest.approx(1e3 * math.hypot(COSINE, SINE), rel=0.05)
    assert int(told[2]) >= 95
    assert any("position_eccentricity among the nuisances" in note for note in finding.notes)
    assert german_sentences.reason(reason)[0] == "de"
    known = investigate_machine(campaign, base_of(tmp_path, FREE))
    assert (known.verdict, known.established) == ("no_gap", ())


def test_no_law_of_the_machine_is_made_of_what_the_encoder_may_be(tmp_path: Path) -> None:
    """Without the nuisance a force over speed squared would do about as well; that is told, not proposed."""
    finding = investigate_machine(pendulum(bent(swings(4e-4), COSINE, 0.0)), base_of(tmp_path, PENDULUM))
    assert finding.law is None
    assert "position_eccentricity" in finding.law_refused


def test_a_law_of_the_machine_is_found_beside_what_the_encoder_may_be(tmp_path: Path) -> None:
    """A place that pushes, read by an encoder off its centre that the base model does not have."""
    campaign = pendulum(bent(pushed(1e-3).shots, COSINE, SINE))
    finding = investigate_machine(campaign, base_of(tmp_path, PENDULUM))
    law = finding.law
    assert law is not None, finding.law_refused
    assert law.place == "law_of_force_over_position"
    assert law.fall.after < 1.3
    assert law.simulated is not None
    without, with_it = (error.rmse for error in law.simulated)
    assert with_it < 10.0 * NOISE < without
    assert without <= simulate_held_out(finding, finding.final).rmse
    for number, truth in enumerate((COSINE, SINE)):
        # Intervals are those at the law's form as it was found; where its bump lies is not in them.
        place = law.model.fit.columns.index((ECCENTRICITY, 0.0, number))
        assert law.model.fit.coefficients[place] == pytest.approx(truth, rel=0.05)
    assert any("law is of what is left beside it" in note for note in finding.notes)
    assert machine_result.machine_document(finding)["law"]["beside"] == [
        "an encoder that turns off its centre"
    ]
    said = f"which takes it to {law.fall.before:.2f}, s(q) with "
    assert said in machine_sentences.headline(finding)
    assert f"bringt sie auf {law.fall.before:.2f}".replace(".", ",") in german_machine_sentences.headline(
        finding
    )
    write_machine_findings(finding, campaign, tmp_path / "found", "campaign")
    again, _ = read_base_model(tmp_path / "found" / f"{law.place}.yaml")
    assert again.position_eccentricity == NumberPrior(0.0, math.inf)
    assert again.terms[-1] == law.choice
    extended, _ = read_base_model(tmp_path / "found" / "model.extended.yaml")
    assert extended.position_eccentricity.is_held


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (FREE.replace("{std: 0.005}", "{value: 0.001, std: 0.005}"), "write {std: ...}"),
        (SLIDE, "belongs to a rotation"),
    ],
)
def test_an_eccentricity_that_cannot_be_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(SettingsError, match=said):
        base_of(tmp_path, text)


def test_it_is_written_as_it_was_read(tmp_path: Path) -> None:
    base = base_of(tmp_path, FREE)
    assert base_of(tmp_path, base_model_text(base, Excitation.FREE_SLIDE, {})) == base
    assert base.position_eccentricity.std == 0.005
    assert base.response is Response.POSITION
