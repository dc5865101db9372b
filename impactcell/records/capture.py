"""What a module measured in one cycle."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from impactcell.records.correlated_noise import CorrelatedNoise

Samples = NDArray[np.float64]

FIRST_CONTACT_S = 1e-9
"""Time [s] up to which a sample is taken at first contact itself: modules give times in whole ns."""
AT_THE_HALT_S = 1e-9
"""A sample of the force this near to the actuator's halt [s] is of before or after it by rounding alone."""
ONSET_STD = 0.5
"""Standard deviation of first contact about t = 0, in sampling steps, where a recorder sees it in samples: it
may lie anywhere within one, and where a soft contact shows is off by as much again."""
MASS_STD, VELOCITY_STD, FORCE_SCALE_STD = 0.01, 0.005, 0.01
"""Relative standard deviations of a mass as it was weighed, a velocity as it was commanded, and a force
sensor's scale. A tap shows them better than so; taken as exact, 0.1 % of either bends mu_s by up to 18 %."""
POSITION_SCALE_STD = 0.003
"""The same of a position sensor's scale, which mu_k follows. Our choice: laser triangulators are linear to
0.1-0.5 % of the way, and an error anywhere within 0.5 % has this standard deviation."""
STEPS_LOOKED_AT = 50
"""Samples whose median distance is the sampling step."""


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """Samples of one sensor during one cycle.

    Attributes
    ----------
    time_s : ndarray, shape (n,)
        Strictly increasing, 0 at first contact (at the first sample where there is no contact).
        Sampling need not be uniform: a campaign may have gaps.
    values : ndarray, shape (n,)
        SI units of the quantity.
    noise_std : float or None
        Standard deviation of the sensor's white noise, None where it is not known.
    full_scale : tuple of float or None
        Smallest and largest value the channel can show; a sample at either end is saturated.
    resolution : float or None
        Value of one step of the sensor's integer code; None where values are not such multiples.
    summed_up : bool
        A position that is the sum of a recorded speed, whose noise adds up in it.
    speed_noise_std : float or None
        Standard deviation of that speed's white noise; None where it is not known.
    zero_std : float
        Standard deviation of its zero, where that was taken from the record; 0 where it is as recorded.
    shared_noise : CorrelatedNoise or None
        Of which neighbouring samples share a part, where that showed at rest; `noise_std` is of all.
    """

    time_s: Samples
    values: Samples
    noise_std: float | None = None
    full_scale: tuple[float, float] | None = None
    resolution: float | None = None
    summed_up: bool = False
    speed_noise_std: float | None = None
    zero_std: float = 0.0
    shared_noise: CorrelatedNoise | None = None


def since_contact(time_s: Samples) -> slice:
    """Give the samples that lie after first contact, t = 0, of ascending times.

    At first contact the force jumps from 0 to b v: a sample at that very moment may show either, and a model
    cannot be held to it.
    """
    return slice(int(np.searchsorted(time_s, FIRST_CONTACT_S, "right")), None)


def uniform_times(start_s: float, rate_hz: float, count: int) -> Samples:
    """Give sample times `start_s + i / rate_hz` of a channel without gaps: the same bits wherever made."""
    return start_s + np.arange(count) / rate_hz


@dataclass(frozen=True, slots=True, eq=False)
class Capture:
    """One cycle as measured: an actuator taps a part, it slides and stops.

    `force` is the contact force, positive in compression; `position` and `actuator` are positive along
    the +1 axis, so that a tap with `direction` -1 moves negative. A channel that was not recorded is None.

    Attributes
    ----------
    cycle : int
        The module's cycle number, or the shot number of a campaign.
    time_ns : int
        The cycle's own time, nanoseconds since 1970-01-01 UTC; 0 where it is not known.
    velocity_m_s : float
        Commanded actuator velocity, positive; nan for an excitation without an actuator.
    mass_kg : float
        Mass of the part; nan where it is not known.
    direction : int
        +1 or -1.
    stroke_m : float
        Travel of the actuator from first contact, after which it halts; inf if it never does.
    batch_id : str or None
        Material batch as the PLC names it; None where it says nothing.
    dwell_s : float
        Time the part had been at rest before the tap; nan where it is not known.
    start_m : float
        Position on the table at which the part lay.
    session : int
        Changes when the module has restarted and counts its cycles anew.
    covariates : mapping
        Any further numeric or text column of a campaign.
    summary : Summary or None
        The module's own figures for this cycle, where it reports them.
    onset_std_s : float
        Standard deviation of the moment of first contact about t = 0 [s]; 0 where the recorder tells it.
    mass_std, velocity_std, force_scale_std, position_scale_std : float
        Relative standard deviations of `mass_kg`, `velocity_m_s` and of the scales of force and position; 0
        where exact.
    """

    cycle: int
    velocity_m_s: float
    mass_kg: float
    force: Channel | None
    position: Channel | None
    actuator: Channel | None = None
    direction: int = 1
    stroke_m: float = float("inf")
    time_ns: int = 0
    batch_id: str | None = None
    dwell_s: float = float("nan")
    start_m: float = 0.0
    session: int = 0
    covariates: Mapping[str, float | str] = field(default_factory=dict)
    summary: "Summary | None" = None
    onset_std_s: float = 0.0
    mass_std: float = 0.0
    velocity_std: float = 0.0
    force_scale_std: float = 0.0
    position_scale_std: float = 0.0

    @property
    def halt_s(self) -> float:
        """When the actuator halts after its stroke [s]; inf or nan where nothing says so."""
        return self.stroke_m / self.velocity_m_s if self.velocity_m_s else math.inf


@dataclass(frozen=True, slots=True)
class Summary:
    """The module's own figures: peak force over all contacts, distance slid since the last of them.

    nan where it does not have one, and for a standard deviation that it does not tell.
    """

    peak_force_n: float
    sliding_distance_m: float
    peak_force_std_n: float = float("nan")
    sliding_distance_std_m: float = float("nan")


def sampling_step_s(capture: Capture) -> float:
    """Give the sampling step of the force, of another channel where there is none; 0 of no samples."""
    channels = (capture.force, capture.position, capture.actuator)
    times = next((one.time_s for one in channels if one is not None and len(one.time_s) > 1), None)
    return 0.0 if times is None else float(np.median(np.diff(times[:STEPS_LOOKED_AT])))


def with_open_onset(capture: Capture) -> Capture:
    """Say that first contact is known to a sampling step, as of a recorder that sees it in its samples."""
    std_s = ONSET_STD * sampling_step_s(capture)
    return capture if capture.onset_std_s >= std_s else replace(capture, onset_std_s=std_s)


def as_recorded(
    capture: Capture,
    mass_std: float = MASS_STD,
    velocity_std: float = VELOCITY_STD,
    force_scale_std: float = FORCE_SCALE_STD,
    position_scale_std: float = POSITION_SCALE_STD,
) -> Capture:
    """Say what nobody knows exactly of a measured tap: first contact, mass, velocity, the sensors' scales.

    The standard deviations are relative; what the capture says itself is kept where it is more.
    """
    opened = with_open_onset(capture)
    return replace(
        opened,
        mass_std=max(opened.mass_std, mass_std),
        velocity_std=max(opened.velocity_std, velocity_std),
        force_scale_std=max(opened.force_scale_std, force_scale_std),
        position_scale_std=max(opened.position_scale_std, position_scale_std),
    )
