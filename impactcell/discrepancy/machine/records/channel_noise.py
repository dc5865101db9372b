"""Noise of the channels of a record: as it is stated, else as neighbouring samples show it."""

import math

import numpy as np

from impactcell.features import drive_noise_std, is_command, noise_std, samples_held, white_noise_std
from impactcell.records import Channel, Samples


def position_noise(position: Channel, clean: Samples) -> tuple[float, bool]:
    """Noise of a position, or of the speed that it was summed up from, and whether it is stated.

    A mean of two speeds has a third difference of weights 1/2, -1, 0, 1 and -1/2: an eighth of the variance
    that it would have of white noise.
    """
    if position.summed_up:
        if position.speed_noise_std is not None:
            return position.speed_noise_std, True
        step_s = np.diff(position.time_s)
        # Decimals were lost where the position was largest: by so much are speeds of one raster off it.
        rounded_at = float(np.abs(clean).max() / step_s.min())
        middles = position.time_s[:-1] + 0.5 * step_s
        return math.sqrt(8.0) * white_noise_std(np.diff(clean) / step_s + rounded_at, middles), False
    if position.noise_std is not None:
        return noise_std(position), True
    return white_noise_std(clean, position.time_s), False


def force_noise(force: Channel, clean: Samples) -> tuple[float, float]:
    """Noise of one sample of a force, and samples of its channel that one value makes where it is held.

    Levels that were chosen are no raster.
    """
    held = samples_held(clean)
    if force.noise_std is None:
        return drive_noise_std(clean, force.time_s), held
    return (force.noise_std if is_command(clean) else noise_std(force) * math.sqrt(held)), held
