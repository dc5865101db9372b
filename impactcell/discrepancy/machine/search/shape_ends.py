"""Shapes of terms that came to an end of what is looked for, in words."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from impactcell.campaign import Coordinate
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.search.selection import END_OF_RANGE, SelectionStep
from impactcell.discrepancy.machine.terms.law_terms import term_of
from impactcell.physics.effect_names import in_words


def with_ends_named(
    steps: Sequence[SelectionStep], shapes: Mapping[str, Sequence[float]], coordinate: Coordinate
) -> list[SelectionStep]:
    """Say of each step that ended at the end of a shape's range of which term, and at which value.

    Parameters
    ----------
    steps : sequence of SelectionStep
    shapes : mapping
        Values that are tried of each term's shape, by the term's name.
    coordinate : Coordinate
    """
    return [
        replace(step, reason=_nearest(step.trials[0].term, shapes, coordinate))
        if step.reason == END_OF_RANGE
        else step
        for step in steps
    ]


def _nearest(term: ChosenTerm, shapes: Mapping[str, Sequence[float]], coordinate: Coordinate) -> str:
    shape = term_of(term.choice).shape
    assert shape is not None  # noqa: S101 - it came to an end of its values
    unit = "rad" if coordinate is Coordinate.ROTATION else "m"
    if shape.covariate == "speed":
        unit += "/s"
    end = "smallest" if term.shape <= min(shapes[term.choice.name]) else "largest"
    value = f"{in_words(shape.name)} of {term.shape:.3g} {unit}"
    return f"{in_words(term.choice.name)} comes nearest, at a {value}, the {end} that is looked for"
