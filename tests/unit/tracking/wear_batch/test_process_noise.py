"""When random walks are looked for: a service has its cells do so one after the other."""

from dataclasses import replace

import numpy as np
import pytest

from impactcell.serialization import pack
from impactcell.tracking import wear_batch
from impactcell.tracking.wear_batch import FrictionObservation, TrackerSettings, initial_state
from impactcell.tracking.wear_batch import noise_identification as identification

STD = 0.002
AT_ONCE = TrackerSettings(commissioning_cycles=60)
LATER = replace(AT_ONCE, commissioning_delay=7)


def states(settings: TrackerSettings, cycles: int) -> list[bytes]:
    """What is kept after each cycle of friction that only scatters."""
    draw, state, after = np.random.default_rng(4), initial_state(), []
    for cycle in range(cycles):
        mu_s = 0.2 + STD * draw.normal()
        state = wear_batch.update(
            settings, state, FrictionObservation(cycle, mu_s, STD, (cycle + 1) * 10**9, "A")
        ).state
        after.append(pack(state))
    return after


@pytest.mark.parametrize(("settings", "expected"), [(AT_ONCE, [50, 60]), (LATER, [57, 67])])
def test_a_delay_moves_what_takes_long_and_the_end(
    settings: TrackerSettings, expected: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    looked_at: list[int] = []
    plain = identification.identify_random_walks

    def watched(
        settings: TrackerSettings,
        record: identification.CommissioningRecord,
        noise: identification.noise_scale.NoiseScale,
    ) -> identification.RandomWalks:
        looked_at.append(len(record.rows))
        return plain(settings, record, noise)

    monkeypatch.setattr(identification, "identify_random_walks", watched)
    states(settings, 80)
    assert looked_at == expected


def test_where_friction_only_scatters_a_delay_changes_nothing_before_the_end() -> None:
    assert states(AT_ONCE, 59) == states(LATER, 59)
