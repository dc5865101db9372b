"""Where contact begins, whatever share of a record it takes."""

import numpy as np
import pytest

from impactcell.campaign.contacts import baseline_of, contact_onsets, pulse_sign

STEP_S = 1e-4


@pytest.mark.parametrize("contact_share", [0.2, 0.5, 0.65])
@pytest.mark.parametrize("offset_n", [0.0, -3.0])
def test_a_contact_that_takes_most_of_a_record_does_not_hide_its_beginning(
    contact_share: float, offset_n: float
) -> None:
    """A slow tap of a heavy part was taken to begin 2.7 ms late: its rise was taken for noise."""
    rng = np.random.default_rng(4)
    count, before = 1000, 200
    force = offset_n + rng.normal(0.0, 0.4, count)
    length = round(contact_share * count)
    force[before : before + length] += 15.0 + 140.0 * np.sin(np.pi * np.arange(length) / length)
    baseline = baseline_of(force)
    assert baseline.offset == pytest.approx(offset_n, abs=0.15)
    assert 0.3 < baseline.noise_std < 1.2
    assert contact_onsets(STEP_S * np.arange(count), force, baseline) == [before]


def test_hum_and_creep_before_contact_are_no_contact() -> None:
    time = STEP_S * np.arange(1000)
    rng = np.random.default_rng(5)
    for idle in (4.0 * np.sin(2.0 * np.pi * 50.0 * time), 4.0 * time / time[-1]):
        force = idle + rng.normal(0.0, 0.2, time.size)
        force[400:600] += 200.0 * np.sin(np.pi * np.arange(200) / 200.0)
        (onset,) = contact_onsets(time, force, baseline_of(force))
        assert 400 <= onset < 415


def test_a_force_in_coarse_steps_rests_on_one_of_them() -> None:
    force = np.round(np.maximum(0.0, 60.0 * np.sin(np.linspace(-3.0, 3.0, 900))) / 2.5) * 2.5
    baseline = baseline_of(force)
    assert baseline.offset == 0.0
    assert baseline.noise_std == 0.0


@pytest.mark.parametrize("spikes", [(250,), (250, 251), (30, 31, 250)])
@pytest.mark.parametrize("height_n", [1e4, -1e4, 1e8])
def test_a_spike_moves_no_onset(spikes: tuple[int, ...], height_n: float) -> None:
    """A hundredth of the spike was the threshold: contact began up to 2 ms late."""
    rng = np.random.default_rng(6)
    time, force = STEP_S * np.arange(1000), rng.normal(0.0, 0.4, 1000)
    force[200:500] += 15.0 + 140.0 * np.sin(np.pi * np.arange(300) / 300)
    force[list(spikes)] = height_n
    assert pulse_sign(force) == 1
    assert contact_onsets(time, force, baseline_of(force)) == [200]
