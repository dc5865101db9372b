"""What is settled about a cycle before anything is computed: what the module left out, batch, doubts."""

import math
from dataclasses import dataclass, replace
from typing import Final

from impactcell.records import (
    FORCE_SCALE_STD,
    MASS_STD,
    POSITION_SCALE_STD,
    VELOCITY_STD,
    BatchAnnouncement,
    Capture,
    Channel,
    FrictionEstimate,
    Quality,
    as_recorded,
)

PERIOD_GAIN = 0.05
"""Share of the latest time between cycles in their mean."""
_COEFFICIENTS: Final = ("mu_s", "mu_k", "by_force", "by_distance", "combined")
"""Those of an estimate, by whatever predictor."""


@dataclass(frozen=True, slots=True)
class CaptureDefaults:
    """What is known of a cell where its module says nothing.

    Attributes
    ----------
    mass_kg, stroke_m : float or None
        Taken where the module reports none.
    force_noise_std_n, position_noise_std_m : float
        Of the sensors.
    recorder_std : tuple of float
        Relative standard deviations of mass, velocity and the scales of force and position; 0 where exact.
    """

    mass_kg: float | None = None
    stroke_m: float | None = None
    force_noise_std_n: float = 0.4
    position_noise_std_m: float = 1.5e-6
    recorder_std: tuple[float, float, float, float] = (
        MASS_STD,
        VELOCITY_STD,
        FORCE_SCALE_STD,
        POSITION_SCALE_STD,
    )


@dataclass(frozen=True, slots=True)
class OperatorBatch:
    """A batch named by a person: holds until the module names another than it did then."""

    batch_id: str
    module_batch_id: str | None
    expected: bool


@dataclass(frozen=True, slots=True)
class BatchNaming:
    """What has been said of the batch so far: by a person, by the module, by announcements of the PLC."""

    by_operator: OperatorBatch | None = None
    by_module: str | None = None
    last_announcement: int = 0


@dataclass(frozen=True, slots=True)
class CycleBatch:
    """The batch of a cycle, whether its change was expected, and what has been said after it."""

    naming: BatchNaming
    batch_id: str | None
    expected: bool


def fill_defaults(defaults: CaptureDefaults, capture: Capture) -> Capture:
    """Fill in what the module does not report: mass, stroke, noise, and how well it knows them."""
    mass_kg, stroke_m = capture.mass_kg, capture.stroke_m
    if math.isnan(mass_kg) and defaults.mass_kg is not None:
        mass_kg = defaults.mass_kg
    if math.isinf(stroke_m) and defaults.stroke_m is not None:
        stroke_m = defaults.stroke_m
    return replace(
        as_recorded(capture, *defaults.recorder_std),
        mass_kg=mass_kg,
        stroke_m=stroke_m,
        force=with_noise(capture.force, defaults.force_noise_std_n),
        position=with_noise(capture.position, defaults.position_noise_std_m),
    )


def degrade_quality(friction: FrictionEstimate, faults: tuple[str, ...]) -> FrictionEstimate:
    """Make each coefficient of a capture with faults uncertain at best, and say why.

    One that is uncertain or bad already keeps its own reason.
    """
    if not faults:
        return friction
    doubt = {"quality": Quality.UNCERTAIN, "reason": "; ".join(faults)}
    coefficients = {name: getattr(friction, name) for name in _COEFFICIENTS}
    return replace(
        friction,
        **{
            name: replace(coefficient, **doubt)
            for name, coefficient in coefficients.items()
            if coefficient.quality is Quality.GOOD
        },
    )


def with_noise(channel: Channel | None, noise_std: float) -> Channel | None:
    """Say how noisy a channel is, unless its module does."""
    return (
        channel if channel is None or channel.noise_std is not None else replace(channel, noise_std=noise_std)
    )


def assign_batch(naming: BatchNaming, capture: Capture, announcement: BatchAnnouncement | None) -> CycleBatch:
    """Decide which batch a cycle belongs to, and whether its change was expected.

    The batch is what the module wrote down with the cycle itself. Only the newest announcement can be read.
    If several came during an outage, its sequence tells how many were missed: so many changes of the module's
    batch before `from_cycle` of the newest count as announced. Where the module shows none, what it showed
    before it started anew is forgotten: the next may have any number.
    """
    by_operator, batch_id, expected = naming.by_operator, capture.batch_id, False
    if by_operator is not None and by_operator.module_batch_id == capture.batch_id:
        batch_id, expected = by_operator.batch_id, by_operator.expected
        by_operator = replace(by_operator, expected=False)
    else:
        by_operator = None
    last_sequence = 0 if announcement is None else naming.last_announcement
    if announcement is not None and announcement.sequence != last_sequence:
        changed = naming.by_module is not None and capture.batch_id not in (None, naming.by_module)
        if capture.cycle >= announcement.from_cycle:
            expected, last_sequence = True, announcement.sequence
        elif changed and 0 < last_sequence < announcement.sequence - 1:
            expected, last_sequence = True, last_sequence + 1
    return CycleBatch(BatchNaming(by_operator, capture.batch_id, last_sequence), batch_id, expected)


def update_period(before_s: float, since: tuple[int, int], capture: Capture) -> float:
    """Follow the mean time between cycles, 0 before it is known; a pause counts as ten of them at most.

    `since` is number and time (ns) of the cycle before; time 0 where there was none.
    """
    cycles, elapsed_s = capture.cycle - since[0], (capture.time_ns - since[1]) * 1e-9
    if not since[1] or cycles <= 0 or elapsed_s <= 0.0:
        return before_s
    latest_s = elapsed_s / cycles
    if not before_s:
        return latest_s
    return before_s + PERIOD_GAIN * (min(latest_s, 10.0 * before_s) - before_s)
