"""A raster that is coarser than a channel's noise: what rounding makes of a residual is known, and no gap.

A part that begins to move stays on the raster's step on which it lay. Where it lay in the middle of one, as
behind a reference run, all shots show the same there, up to half a step off every model, the true one too.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from impactcell.discrepancy.data.prepared_shots import CHANNELS, PreparedShot, ShotSet
from impactcell.features import white_noise_std
from impactcell.numerics.raster import raster_of
from impactcell.records import Samples

FINE_STEPS = 2.0
"""Steps of a raster over the noise [1] up to which rounding is as good as white: it is off by less than a
four hundredth of a step in the mean, q / pi exp(-2 pi² (s / q)²)."""
UNSEEN_NOISE = 0.1
"""Noise over a step [1] that is none: a scatter that is known to 6 % tells no tenth of a step."""
NEAR_STEPS = 3
"""Steps to either side over which noise is reckoned with: beyond them it is less than a step's half."""


@dataclass(frozen=True, slots=True)
class CoarseRaster:
    """Raster of a channel, and the noise that was there before its values were rounded, in the unit of these.

    Attributes
    ----------
    step, noise_std : float
    """

    step: float
    noise_std: float


def coarse_rasters(shots: Sequence[PreparedShot]) -> tuple[CoarseRaster | None, ...]:
    """Give each channel's raster; None where there is none, or noise hides it."""
    return tuple(_of_channel([shot.values[channel] for shot in shots]) for channel in range(len(CHANNELS)))


def _of_channel(records: Sequence[Samples]) -> CoarseRaster | None:
    steps = [raster_of(values) for values in records if len(values)]
    found = [step for step in steps if step is not None]
    if 2 * len(found) <= len(steps):
        return None
    step = float(np.median(found))
    noise = float(np.nanmedian([white_noise_std(values) for values in records if len(values)]))
    before = float(np.sqrt(max(noise**2 - step**2 / 12.0, 0.0)))
    if before < UNSEEN_NOISE * step:
        return CoarseRaster(step, 0.0)
    return CoarseRaster(step, before) if step > FINE_STEPS * before else None


def beside_rasters(shots: ShotSet, residual: Samples, rasters: Sequence[CoarseRaster | None]) -> Samples:
    """Give whitened residuals against what the sensors would show of the model, rounded as they are.

    A reading x lies on the raster. Of a prediction p its sensor shows E Q(p + n) in the mean, with Q the
    rounding and n the noise before it; so x - E Q(p + n) = E Q(x - p + n): the residual, rounded as well.
    Shots whose samples are told from one another by a whitener stay as they are.
    """
    if shots.items[0].whitener.size or not any(rasters):
        return residual
    measured = shots.unwhiten(residual)
    for channel, raster in enumerate(rasters):
        if raster is not None:
            inside = shots.channel == channel
            measured[inside] = _rounded(measured[inside], raster)
    return shots.whiten(measured)


def _rounded(values: Samples, raster: CoarseRaster) -> Samples:
    """E Q(values + n), exact to the noise beyond `NEAR_STEPS`."""
    whole = np.rint(values / raster.step)
    if not raster.noise_std > 0.0:
        return raster.step * whole
    beyond = values / raster.step - whole
    edges = np.arange(NEAR_STEPS)[:, None] + 0.5
    width = raster.noise_std / raster.step
    share = (ndtr((beyond - edges) / width) - ndtr((-beyond - edges) / width)).sum(0)
    rounded: Samples = raster.step * (whole + share)
    return rounded
