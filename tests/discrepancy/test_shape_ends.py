"""A shape that came to an end of what is looked for is told with its term, its value and its end."""

import numpy as np
import pytest

from impactcell.campaign import Coordinate
from impactcell.discrepancy.machine import ChosenTerm, MachineFinding, TermChoice, investigate_machine
from impactcell.discrepancy.machine.regression.trials import Trial
from impactcell.discrepancy.machine.search.selection import END_OF_RANGE, SelectionStep
from impactcell.discrepancy.machine.search.shape_ends import with_ends_named
from impactcell.discrepancy.report import german_machine_sentences, german_sentences, machine_sentences
from tests.discrepancy.test_moves_between_places import AXIS, axis

GRIDS = {"periodic_force": (0.04, 0.25), "stribeck_friction": (0.02, 0.3)}


def step(name: str, shape: float, reason: str) -> SelectionStep:
    """What a selection saw, the term in front."""
    nothing = np.zeros(3)
    trial = Trial(ChosenTerm(TermChoice(name), shape), nothing, nothing, at_end=True)
    return SelectionStep((trial,), {}, 0.0, 0.0, None, (), reason)


@pytest.mark.parametrize(
    ("name", "shape", "coordinate", "english", "german"),
    [
        ("periodic_force", 0.04, Coordinate.TRANSLATION,
         "periodic force comes nearest, at a period of 0.04 m, the smallest that is looked for",
         "„Periodische Kraft“ kommt am nächsten, mit 0,04 m (Periode), dem kleinsten Wert, der gesucht wird"),
        ("stribeck_friction", 0.3, Coordinate.ROTATION,
         ("Stribeck friction comes nearest, at a Stribeck velocity of 0.3 rad/s, the largest that is looked "
         "for"),
         ("„Stribeck-Reibung“ kommt am nächsten, mit 0,3 rad/s (Stribeck-Geschwindigkeit), dem größten Wert, "
         "der gesucht wird")),
    ],
)  # fmt: skip
def test_which_term_and_which_end_it_was(
    name: str, shape: float, coordinate: Coordinate, english: str, german: str
) -> None:
    other = step(name, shape, "no term closes a fifth of the gap")
    named, same = with_ends_named([step(name, shape, END_OF_RANGE), other], GRIDS, coordinate)
    assert named.reason == english
    assert same is other
    language, said = german_sentences.reason(english)
    assert (language, german_sentences.written(said)) == ("de", german)


def cogging() -> MachineFinding:
    """An axis that cogs a little more than 24 times in its stroke."""
    return investigate_machine(axis(lambda q, _: 0.5 * np.sin(2.0 * np.pi * q / 0.0206)), AXIS)


@pytest.mark.slow
def test_cogging_that_is_finer_than_what_is_looked_for_is_told_as_such() -> None:
    finding = cogging()
    assert finding.established == ()
    period = finding.steps[0].trials[0].term.shape
    told = f"periodic force comes nearest, at a period of {period:.3g} m, the smallest that is looked for"
    assert told in machine_sentences.headline(finding)
    assert "„Periodische Kraft“ kommt am nächsten" in german_machine_sentences.headline(finding)
