"""A term whose shape comes nearest at an end of its range is not taken by what records need either."""

import numpy as np

from impactcell.discrepancy.machine import TermChoice
from impactcell.discrepancy.machine.regression.trials import ChosenTerm, Trial
from impactcell.discrepancy.machine.search.selection import END_OF_RANGE, SelectionStep, _beside_smooth_force

WAVE = TermChoice("periodic_force")
GAINS = np.ones(8)


def test_a_period_within_the_range_does_not_hide_that_the_longest_one_does_best() -> None:
    longest = Trial(ChosenTerm(WAVE, 0.2), GAINS, 0.1 * GAINS, at_end=True)
    within = Trial(ChosenTerm(WAVE, 0.1), 0.9 * GAINS, 0.1 * GAINS, at_end=False)
    needs = {"periodic_force": 50.0, "force_over_position": 10.0}
    step = SelectionStep((longest,), {}, 8.0, 8.0, None, (), END_OF_RANGE, needs=needs)
    free = {"force_over_position": 10.0}
    told = _beside_smooth_force(step, within, free)
    assert told.accepted is None
    assert told.reason == END_OF_RANGE
    alone = SelectionStep((within,), {}, 8.0, 8.0, None, (), "", needs=needs)
    assert _beside_smooth_force(alone, within, free).accepted is within
