"""What a campaign directory holds, in SI units."""

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field

from impactcell.records import Capture

CHANNELS = {"force": "force_n", "position": "position_m", "actuator": "actuator_m"}
"""Column of a trace for each sensor."""


class Coordinate(enum.StrEnum):
    """What moves: a place along a line, or an angle about an axis."""

    TRANSLATION = "translation"
    ROTATION = "rotation"


COLUMNS: Mapping[Coordinate, Mapping[str, str]] = {
    Coordinate.TRANSLATION: {
        **CHANNELS,
        "mass": "mass_kg",
        "start": "start_m",
        "force_noise": "noise_std_n",
        "position_noise": "noise_std_m",
        "actuator_noise": "noise_std_m",
        "speed_noise": "noise_std_m_per_s",
    },
    Coordinate.ROTATION: {
        "force": "torque_n_m",
        "position": "angle_rad",
        "actuator": "actuator_rad",
        "mass": "inertia_kg_m2",
        "start": "start_rad",
        "force_noise": "noise_std_n_m",
        "position_noise": "noise_std_rad",
        "actuator_noise": "noise_std_rad",
        "speed_noise": "noise_std_rad_per_s",
    },
}
"""Names of columns and keys in a campaign: where the coordinate is an angle, a force is a torque [N m],
a place an angle [rad] and a mass an inertia [kg m²]."""


class Excitation(enum.StrEnum):
    """What makes the part move."""

    TAP = "tap"
    FREE_SLIDE = "free_slide"
    DRIVEN = "driven"


@dataclass(frozen=True, slots=True)
class Sensor:
    """What `campaign.yaml` says of one sensor; None where it says nothing.

    Attributes
    ----------
    rate_hz : float or None
        Nominal sampling rate; the traces' own times are what counts.
    noise_std : float or None
        Standard deviation of the white noise, N or m.
    summed_up : bool
        A position that is the sum of a recorded speed.
    speed_noise_std : float or None
        Standard deviation of that speed's white noise, m/s.
    """

    rate_hz: float | None = None
    noise_std: float | None = None
    summed_up: bool = False
    speed_noise_std: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Campaign:
    """A set of shots taken under one excitation.

    Attributes
    ----------
    excitation : Excitation
    gravity_m_s2 : float
    stroke_m : float
        Travel of the actuator from first contact; inf where it halts as it loses contact, or there is none.
    sensors : mapping
        `force`, `position` and `actuator`, those that were recorded.
    shots : tuple of Capture
        In the order of `shots.csv`, which is the order in which they were taken.
    columns : tuple of str
        Columns of `shots.csv`, so that what was not recorded is told from what was.
    coordinate : Coordinate
        Where it is a rotation, forces are torques [N m], places angles [rad] and masses inertias [kg m²].
    """

    excitation: Excitation
    shots: tuple[Capture, ...]
    gravity_m_s2: float = 9.81
    stroke_m: float = float("inf")
    sensors: Mapping[str, Sensor] = field(default_factory=dict)
    columns: tuple[str, ...] = ("shot",)
    coordinate: Coordinate = Coordinate.TRANSLATION
