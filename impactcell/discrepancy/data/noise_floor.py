"""Noise floor: what no model can explain, from the sensors and from replicate shots."""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.data.prepared_campaign import PreparedCampaign
from impactcell.discrepancy.data.prepared_shots import CHANNELS, IndexArray, PreparedShot
from impactcell.errors import CampaignError
from impactcell.features import NoiseAtRest, white_noise_std
from impactcell.features.noise_at_rest import TOLD_IN
from impactcell.records import Samples

NOISE_UNIT_FACTOR = 30.0
"""Ratio of estimated and stated noise which only a wrong unit can explain."""
COLUMN_DEGREE = 3
"""Degree of the polynomial of a further column that is no pure error: a bend and its turn. Own choice."""
MIN_DEGREES_OF_FREEDOM = 3
"""Fewer degrees of freedom give no spread of replicates: it would be uncertain by half."""
MIN_REPLICATE_SPREAD = 1e-9
"""Smallest spread of replicates, so that equal factors divide nothing by zero."""
DOUBTED_FACTOR = 1.5
"""Ratio of estimated and stated noise beyond which what is stated is doubted, and told."""


@dataclass(frozen=True, slots=True)
class NoiseFloor:
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


def sensor_noise(prepared: PreparedCampaign) -> NoiseFloor:
    """Noise of each channel: as stated, else of samples at rest, or from third differences of neighbours.

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
        if not any(len(shot.values[channel]) for shot in prepared.shots):
            stds.append(math.nan)
            sources.append("none")
            continue
        estimate = white_noise(prepared.shots, channel)
        stated = prepared.stated_noise[channel]
        if math.isnan(stated):
            if not estimate > 0.0:
                message = (
                    f"{name}: neither is its noise stated, nor do its samples show any; "
                    "state it in campaign.yaml"
                )
                raise CampaignError(message)
            resting = prepared.noise_at_rest.get(name)
            stds.append(resting.std if resting else estimate)
            notes.append(_of_samples(channel, stds[-1], resting))
            sources.append("estimated")
            continue
        if estimate > NOISE_UNIT_FACTOR * stated or 0.0 < estimate < stated / NOISE_UNIT_FACTOR**1.5:
            message = (
                f"{name}: its noise is stated as {stated:.3g}, but neighbouring samples scatter by "
                f"{estimate:.3g}: "
                f"check the unit of sensors.{name} in campaign.yaml and of the column in traces"
            )
            raise CampaignError(message)
        if estimate > DOUBTED_FACTOR * stated:
            notes.append(_doubted(channel, stated, estimate))
        stds.append(stated)
        sources.append("stated")
    return NoiseFloor((stds[0], stds[1], stds[2]), (sources[0], sources[1], sources[2]), tuple(notes))


def _doubted(channel: int, stated: float, estimate: float) -> str:
    """Say that samples scatter by more than the noise that is stated of them."""
    name = CHANNELS[channel]
    scale, unit, key = TOLD_IN[name]
    return (
        f"The noise of {name} is stated as {scale * stated:.3g} {unit}, and neighbouring samples scatter by "
        f"{scale * estimate:.3g} {unit}: gaps are told in what is stated, and so are too large; "
        f"check {key} of sensors: {name} in campaign.yaml."
    )


def _of_samples(channel: int, std: float, resting: NoiseAtRest | None) -> str:
    """Say where the noise of a channel comes from that is not stated."""
    name = CHANNELS[channel]
    if resting is not None:
        return resting.told(name)
    scale, unit, _ = TOLD_IN[name]
    return (
        f"The noise of {name} is not stated; {scale * std:.3g} {unit} was estimated from neighbouring "
        "samples, which is a lower bound where noise is correlated."
    )


def white_noise(shots: tuple[PreparedShot, ...], channel: int) -> float:
    """Estimate the noise that differs from sample to sample by a robust third difference."""
    estimates: list[float] = []
    for shot in shots:
        values = shot.values[channel]
        if len(values) < 8:
            continue
        estimates.append(white_noise_std(values))
    return float(np.median(estimates)) if estimates else math.nan


@dataclass(frozen=True, slots=True)
class ReplicateSpread:
    """Pure error of the friction factors.

    Attributes
    ----------
    spread : float
        Standard deviation of the logarithm of a factor about that of its replicates, slow drift, batches
        and dwell taken out; nan without replicates.
    degrees_of_freedom : int
        Degrees of freedom.
    """

    spread: float
    degrees_of_freedom: int


def replicate_spread(shots: tuple[PreparedShot, ...], log_factor: Samples, batches: int) -> ReplicateSpread:
    """Spread of friction factors between shots of the same settings.

    Replicates still differ in when they were taken, in batch, in dwell and in further columns of `shots.csv`;
    these act between shots and are no pure error, so that they are regressed out within the groups, the
    further columns by a polynomial of degree COLUMN_DEGREE.

    Parameters
    ----------
    shots : tuple of PreparedShot
    log_factor : ndarray, shape (n,)
    batches : int
    """
    group = np.array([shot.group for shot in shots])
    _, member = np.unique(group, return_inverse=True)
    size = np.bincount(member)
    inside = size[member] > 1
    if int(inside.sum() - np.unique(member[inside]).size) < MIN_DEGREES_OF_FREEDOM:
        return ReplicateSpread(math.nan, 0)
    columns = [np.array([shot.record / shot.records for shot in shots])]
    columns += [np.array([float(shot.batch == batch) for shot in shots]) for batch in range(1, batches)]
    dwell = np.array([shot.covariates["dwell"] for shot in shots])
    if np.isfinite(dwell).all():
        columns.append(dwell)
    for name, _ in shots[0].columns:
        column = np.array([shot.covariates.get(name, math.nan) for shot in shots])
        if np.isfinite(column).all() and np.ptp(column) > 0.0:
            centred = 2.0 * (column - column.min()) / np.ptp(column) - 1.0
            columns += [centred**degree for degree in range(1, COLUMN_DEGREE + 1)]
    X = np.column_stack(columns)[inside]
    y = log_factor[inside]
    member = member[inside]
    X = X - _group_means(X, member)
    y = y - _group_means(y[:, None], member)[:, 0]
    coefficients, _, rank, _ = np.linalg.lstsq(X, y, rcond=1e-9)
    degrees_of_freedom = len(y) - np.unique(member).size - int(rank)
    if degrees_of_freedom < MIN_DEGREES_OF_FREEDOM:
        return ReplicateSpread(math.nan, 0)
    residual = y - X @ coefficients
    return ReplicateSpread(
        max(math.sqrt(float(residual @ residual) / degrees_of_freedom), MIN_REPLICATE_SPREAD),
        degrees_of_freedom,
    )


def _group_means(columns: Samples, member: IndexArray) -> Samples:
    count = np.bincount(member)
    sums = np.zeros((len(count), columns.shape[1]))
    np.add.at(sums, member, columns)
    means: Samples = (sums / np.maximum(count, 1)[:, None])[member]
    return means
