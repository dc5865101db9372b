"""A command of a few evenly spaced levels has no noise, and what the base model lacks shows behind it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from impactcell.discrepancy.machine import TermChoice, investigate_machine
from impactcell.discrepancy.machine.records.uniform_records import uniform_records
from impactcell.records import Samples
from tests.discrepancy.stick_slip import SLIDE, VISCOUS_N_S_PER_M, slides

pytestmark = pytest.mark.slow

LACKING = replace(SLIDE, terms=(TermChoice("coulomb_friction"),))


def chosen(rng: np.random.Generator) -> Callable[[Samples], Samples]:
    """One of five levels 4 N apart, anew every 0.4 s."""
    drawn = 4.0 * rng.integers(-2, 3, 100)
    return lambda time: drawn[np.floor(time / 0.4 + 1e-9).astype(int)].astype(float)


def test_what_is_hidden_behind_even_levels_is_named() -> None:
    finding = investigate_machine(slides(chosen, (0.0, 1e-5), count=4), LACKING)
    assert finding.established == ("viscous_friction",)
    assert [record.noise[1] for record in finding.records] == [0.0] * 4
    [note] = [note for note in finding.notes if "taken for a command" in note]
    assert note.startswith("The force is held from one update to the next in 4 of 4 records")
    [friction] = [term for term in finding.final.terms if term.choice.name == "viscous_friction"]
    [column] = friction.columns
    assert finding.final.value(column) == pytest.approx(VISCOUS_N_S_PER_M, rel=0.02)


def test_a_stated_noise_of_a_command_is_all_that_it_has() -> None:
    campaign = slides(chosen, (0.0, 1e-5), count=2)
    stated = []
    for shot in campaign.shots:
        assert shot.force is not None
        stated.append(replace(shot, force=replace(shot.force, noise_std=1e-3, resolution=4.0)))
    records = uniform_records(replace(campaign, shots=tuple(stated)), LACKING)
    assert [record.noise[1] for record in records] == pytest.approx([1e-3] * 2)
