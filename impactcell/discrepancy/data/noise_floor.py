"""Noise floor: what no model can explain, from the sensors and from replicate shots."""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data.prepared_campaign import Material
from impactcell.discrepancy.data.shots import CHANNELS, Index, Shot
from impactcell.errors import CampaignError
from impactcell.records import Samples

# Var of the third difference of white noise of unit variance: 1 + 9 + 9 + 1.
THIRD_DIFFERENCE = math.sqrt(20.0)
NORMAL_MAD = 1.482602218505602
DISAGREES = 30.0
FEWEST_FREE = 3
SMALLEST_SPREAD = 1e-9


@dataclass(frozen=True, slots=True)
class Floor:
    """Noise floor of a campaign.

    Attributes
    ----------
    noise_std : tuple of float
        Of force, position and actuator [N, m, m]; nan where a channel was not recorded.
    source : tuple of str
        `stated`, `estimated` or `none`, for each of them.
    notes : tuple of str
    """

    noise_std: tuple[float, float, float]
    source: tuple[str, str, str]
    notes: tuple[str, ...]


def sensors(material: Material) -> Floor:
    """Noise of each channel: as stated, else from third differences of neighbouring samples.

    Raises
    ------
    CampaignError
        A stated noise is wrong by a factor that only a wrong unit can explain, or a channel without
        noise is constant.
    """
    notes: list[str] = []
    stds: list[float] = []
    sources: list[str] = []
    for channel, name in enumerate(CHANNELS):
        if not any(len(shot.values[channel]) for shot in material.shots):
            stds.append(math.nan)
            sources.append("none")
            continue
        estimate = white_noise(material.shots, channel)
        stated = material.stated_noise[channel]
        if math.isnan(stated):
            if not estimate > 0.0:
                message = (
                    f"{name}: neither is its noise stated, nor do its samples show any; "
                    "state it in campaign.yaml"
                )
                raise CampaignError(message)
            notes.append(
                f"The noise of {name} is not stated; {estimate:.3g} was estimated from neighbouring samples, "
                "which is a lower bound where noise is correlated."
            )
            stds.append(estimate)
            sources.append("estimated")
            continue
        if estimate > DISAGREES * stated or 0.0 < estimate < stated / DISAGREES**1.5:
            message = (
                f"{name}: its noise is stated as {stated:.3g}, but neighbouring samples scatter by "
                f"{estimate:.3g}: "
                f"check the unit of sensors.{name} in campaign.yaml and of the column in traces"
            )
            raise CampaignError(message)
        stds.append(stated)
        sources.append("stated")
    return Floor((stds[0], stds[1], stds[2]), (sources[0], sources[1], sources[2]), tuple(notes))


def white_noise(shots: tuple[Shot, ...], channel: int) -> float:
    """Estimate the noise that differs from sample to sample by a robust third difference."""
    found: list[float] = []
    for shot in shots:
        values = shot.values[channel]
        if len(values) < 8:
            continue
        third = np.diff(values, 3)
        spread = float(np.median(np.abs(third))) * NORMAL_MAD
        if spread == 0.0:
            spread = float(third.std())
        found.append(spread / THIRD_DIFFERENCE)
    return float(np.median(found)) if found else math.nan


@dataclass(frozen=True, slots=True)
class Replicates:
    """Pure error of the friction factors.

    Attributes
    ----------
    spread : float
        Standard deviation of the logarithm of a factor about that of its replicates, slow drift, batches
        and dwell taken out; nan without replicates.
    free : int
        Degrees of freedom.
    """

    spread: float
    free: int


def replicate_spread(shots: tuple[Shot, ...], log_factor: Samples, batches: int) -> Replicates:
    """Spread of friction factors between shots of the same settings.

    Replicates still differ in when they were taken, in batch and in dwell; these act between shots and
    are no pure error, so that they are regressed out within the groups.

    Parameters
    ----------
    shots : tuple of Shot
    log_factor : ndarray, shape (n,)
    batches : int
    """
    group = np.array([shot.group for shot in shots])
    _, member = np.unique(group, return_inverse=True)
    size = np.bincount(member)
    inside = size[member] > 1
    if int(inside.sum() - np.unique(member[inside]).size) < FEWEST_FREE:
        return Replicates(math.nan, 0)
    columns = [np.array([shot.place / shot.shots for shot in shots])]
    columns += [np.array([float(shot.batch == batch) for shot in shots]) for batch in range(1, batches)]
    dwell = np.array([shot.covariates["dwell"] for shot in shots])
    if np.isfinite(dwell).all():
        columns.append(dwell)
    X = np.column_stack(columns)[inside]
    y = log_factor[inside]
    member = member[inside]
    X = X - _means(X, member)
    y = y - _means(y[:, None], member)[:, 0]
    coefficients, _, rank, _ = np.linalg.lstsq(X, y, rcond=1e-9)
    free = len(y) - np.unique(member).size - int(rank)
    if free < FEWEST_FREE:
        return Replicates(math.nan, 0)
    left = y - X @ coefficients
    return Replicates(max(math.sqrt(float(left @ left) / free), SMALLEST_SPREAD), free)


def _means(columns: Samples, member: Index) -> Samples:
    count = np.bincount(member)
    sums = np.zeros((len(count), columns.shape[1]))
    np.add.at(sums, member, columns)
    means: Samples = (sums / np.maximum(count, 1)[:, None])[member]
    return means
