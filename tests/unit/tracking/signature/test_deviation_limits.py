"""From where on T² and SPE make a cycle deviant by themselves, against another library's distributions."""

import math

import pytest
from scipy import stats

from impactcell.tracking.signature.deviation_test import FALSE_ALARM_SHARES, DeviationTest, limits

CYCLES, EVERY = 80, 100_000.0


def told(spe_freedom: int) -> DeviationTest:
    return DeviationTest(0.5, 2.0, 3.0, spe_freedom, 1.2, "spe", math.nan, math.nan, math.nan)


def test_at_its_limit_each_has_used_its_share_of_the_false_alarms() -> None:
    t_squared, spe = limits(told(12), CYCLES, EVERY)
    in_f = t_squared * (CYCLES - 3) / (3 * (CYCLES - 1))
    assert stats.f.sf(in_f, 3, CYCLES - 3) == pytest.approx(FALSE_ALARM_SHARES[0] / EVERY, rel=1e-6)
    assert stats.chi2.sf(spe / 1.2, 12) == pytest.approx(FALSE_ALARM_SHARES[1] / EVERY, rel=1e-9)


def test_without_freedom_there_is_no_limit() -> None:
    assert all(math.isnan(limit) for limit in limits(told(0), 4, EVERY))
