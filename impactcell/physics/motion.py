"""What comes out of taps: events, outputs, and samples at any times."""

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from impactcell.errors import NoBreakawayError, NoSeparationError
from impactcell.records import Samples


class TapEventKind(enum.Enum):
    """What joins two smooth phases."""

    BREAKAWAY = "breakaway"
    CONTACT = "contact"
    SEPARATION = "separation"
    STOP = "stop"
    HALT = "halt"


@dataclass(frozen=True, slots=True)
class TapEvent:
    """Something that happened at a time located inside a step."""

    kind: TapEventKind
    time_s: float


class ChannelSamples(NamedTuple):
    """Channels at the times asked for.

    Force is positive in compression; the others count along +1, from where the part lay.
    """

    force_n: Samples
    position_m: Samples
    actuator_m: Samples
    velocity_m_s: Samples


Sampler = Callable[[Samples], ChannelSamples]


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """One tap from first contact at time 0 to rest.

    Attributes
    ----------
    events : tuple of TapEvent
        In order of time; no more than the first 4096.
    peak_force_n : float
        Maximum of the contact force over all contacts, as the force sensor reports it.
    displacement_m : float
        From first contact to rest, positive along the tap.
    stop_s : float
        When the part came to rest for good; 0 if it never moved.
    first_breakaway_s, last_separation_s, distance_after_separation_m : float
        nan where there was none; the properties raise instead.
    sampler : callable
        Samples at ascending or any other times.
    """

    events: tuple[TapEvent, ...]
    peak_force_n: float
    displacement_m: float
    stop_s: float
    first_breakaway_s: float
    last_separation_s: float
    distance_after_separation_m: float
    sampler: Sampler

    @property
    def breakaway_s(self) -> float:
        """When the part first moved; raises `NoBreakawayError` if it never did."""
        if math.isnan(self.first_breakaway_s):
            raise NoBreakawayError(
                f"static friction held the part throughout; the force reached {self.peak_force_n:.6g} N. "
                "Tap faster or with a longer stroke"
            )
        return self.first_breakaway_s

    @property
    def separation_s(self) -> float:
        """When the part last left the actuator; raises `NoSeparationError` if it never did."""
        if math.isnan(self.last_separation_s):
            raise NoSeparationError(
                "the part came to rest against the actuator and never left it. "
                "Tap faster or with a longer stroke"
            )
        return self.last_separation_s

    @property
    def sliding_distance_m(self) -> float:
        """From the last loss of contact to rest, positive along the tap.

        Raises
        ------
        NoBreakawayError
            The part never moved.
        NoSeparationError
            It moved, but never left the actuator.
        """
        if self.breakaway_s <= self.separation_s:
            return self.distance_after_separation_m
        raise NoSeparationError("the part never left the actuator after it had moved")

    def sample(self, time_s: ArrayLike) -> ChannelSamples:
        """Channels at `time_s`, shape (n,), in any order; 0 is first contact, before it all is at rest."""
        return self.sampler(np.atleast_1d(np.asarray(time_s, dtype=np.float64)))


@dataclass(frozen=True, slots=True, eq=False)
class Traces:
    """Samples of every tap, end to end; empty where a channel was not asked for.

    Attributes
    ----------
    force_n, position_m, actuator_m, velocity_m_s : ndarray
        Shape (samples,), or (q, samples) for derivatives.
    """

    force_n: Samples
    position_m: Samples
    actuator_m: Samples
    velocity_m_s: Samples


@dataclass(frozen=True, slots=True, eq=False)
class TapOutputs:
    """Outputs of every tap, each of shape (n,); nan where a tap has no such output.

    Attributes
    ----------
    peak_force_n : as the sensor shows it, over all contacts
    displacement_m : first contact to rest, along the tap
    sliding_distance_m, separation_s : from, and time of, the last loss of contact
    breakaway_s, stop_s : times
    at_rest : bool; False for a part that was still moving at the end of the allowed time
    """

    peak_force_n: Samples
    displacement_m: Samples
    sliding_distance_m: Samples
    breakaway_s: Samples
    separation_s: Samples
    stop_s: Samples
    at_rest: Samples
