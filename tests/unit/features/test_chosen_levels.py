"""Commands of chosen levels against coarse codes of what was measured, at random: each by how it is made."""

import math

import numpy as np
import pytest

from impactcell.features import drive_noise_std, is_command, samples_held, white_noise_std

SEEDS = range(40)


def held_for(rng: np.random.Generator, count: int) -> np.ndarray:
    """Samples for which each of so many levels is held: by a clock, not of whole samples too, or any."""
    clock = rng.choice([2.0, 3.0, 7.5, 20.0, 250.0])
    if rng.random() < 0.5:
        return np.diff(np.round(clock * np.arange(count + 1))).astype(int)
    return rng.integers(2, 60, count)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("count", [2, 3, 4, 5, 6, 8, 12])
def test_random_levels_are_a_command_however_evenly_they_are_spaced(seed: int, count: int) -> None:
    rng = np.random.default_rng([seed, count])
    spread = rng.choice([0.0, 0.03])
    levels = 10.0 * (np.arange(count) - 0.5 * (count - 1) + spread * rng.uniform(-1.0, 1.0, count))
    number = int(rng.integers(40, 300))
    command = np.repeat(levels[rng.integers(0, count, number)], held_for(rng, number))
    assert is_command(command)
    assert (drive_noise_std(command), samples_held(command)) == (0.0, 1.0)


@pytest.mark.parametrize("seed", SEEDS)
def test_levels_that_step_up_and_down_by_a_clock_are_a_command(seed: int) -> None:
    """A random walk never passes over a level: what tells it is when it steps."""
    rng = np.random.default_rng(seed)
    walk = [0]
    for step in rng.choice([-1, 1], 120):
        walk.append(walk[-1] + step if abs(walk[-1] + step) <= 2 else walk[-1] - step)
    clock = rng.uniform(12.0, 200.0)
    held = np.diff(np.round(clock * np.arange(len(walk) + 1))).astype(int)
    assert is_command(np.repeat(10.0 * np.array(walk), held))


@pytest.mark.parametrize("order", ["0 1 2 3 4", "4 3 2 1 0", "0 1 2 3 2 1 0"])
def test_a_staircase_of_equal_steps_is_a_command(order: str) -> None:
    assert is_command(np.repeat(5.0 * np.array(order.split(), dtype=float), 2000))


def measured(rng: np.random.Generator, size: int) -> tuple[np.ndarray, str]:
    """Something smooth that takes values from -1 to 1: slow or fast, in periods of 30 to 3000 samples."""
    time = np.arange(float(size))
    period = 10.0 ** rng.uniform(1.5, 3.5)
    kind = str(rng.choice(["sine", "sines", "bursts", "lagging"]))
    sine = np.sin(2.0 * math.pi * time / period + rng.uniform(0.0, 6.0))
    if kind == "sine":
        return sine, kind
    if kind == "sines":
        phases = rng.uniform(0.0, 6.0, 3)
        shares = zip((0.31, 0.57, 0.83), phases, strict=True)
        others = [np.sin(2.0 * math.pi * share * time / period + phase) for share, phase in shares]
        return 0.25 * (sine + sum(others)), kind
    if kind == "bursts":
        return sine * (np.mod(time, 6.0 * period) < period), kind
    # A drive of chosen levels that a motor follows with a lag: its code goes from one step to the next.
    hold = max(round(period), 60)
    chosen = np.repeat(rng.choice(np.linspace(-1.0, 1.0, 5), size // hold + 1), hold)[:size]
    lag = math.exp(-10.0 / hold)
    out = np.empty(size)
    state = 0.0
    for place, level in enumerate(chosen):
        state = lag * state + (1.0 - lag) * level
        out[place] = state
    return out, kind


@pytest.mark.parametrize("seed", range(200))
def test_a_coarse_code_is_no_command(seed: int) -> None:
    """Smooth or noisy, slow or fast, of three steps of its raster either way or of sixty."""
    rng = np.random.default_rng([5, seed])
    signal, _ = measured(rng, 8000)
    steps = 10.0 ** rng.uniform(math.log10(3.0), math.log10(60.0))
    noise = rng.choice([0.0, 0.03, 0.1, 0.3, 0.6, 1.0])
    exact = steps * signal + rng.uniform(-0.5, 0.5)
    code = 0.4 * np.round(exact + noise * rng.standard_normal(signal.size))
    assert not is_command(code)
    assert drive_noise_std(code) >= 0.8 * 0.4 * max(noise, 0.25)


def test_a_coarse_measured_drive_that_is_held_is_no_command() -> None:
    """A torque in tenths of a per cent that a bus renews every ten samples."""
    rng = np.random.default_rng(6)
    torque = 30.0 * np.sin(2.0 * math.pi * np.arange(800) / 90.0) + rng.normal(0.0, 0.5, 800)
    held = np.repeat(np.round(torque), 10)
    assert not is_command(held)
    assert drive_noise_std(held) > 0.8 * white_noise_std(np.round(torque))
