"""The one protocol of what makes a part move: tap, free slide or driven, each in a file of its own.

Everything in which the workflow differs from one excitation to another is asked of these objects; no other
module tells them apart.
"""

import math
from abc import ABC, abstractmethod
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
from scipy.stats import rankdata

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.data.cell_limits import CellLimits
from impactcell.discrepancy.data.phases import Trajectory
from impactcell.discrepancy.data.prepared_shots import IndexArray, PreparedShot, ShotSet
from impactcell.discrepancy.data.unit_checks import PlausibleRatio
from impactcell.records import Capture, Channel, Samples

HELD_OUT_SHARE = 0.25
"""Share of the shots that is held out: a quarter tests the result, three quarters fit it. Own choice."""
MIN_TRAINING = 9
"""Shots or blocks that a test of a step needs: mirrored as a whole, n of them reach p = 2^(1 - n) at best,
and half of the error of a step is 0.005."""
MIN_HELD_OUT = 5
"""Held-out shots or blocks that can say a gap falls: with the signs of n at random p is 2^-n at best."""
DIVISIONS, MOST_ALIKE = 400, 20
"""Divisions that are drawn, and of how many of them one has held-out shots that are alike enough [1]: of
these the first is taken, so that it is left to chance which."""

NO_DRIVE = np.empty((2, 0))
"""Drive of a part that is not driven."""


Setting = tuple[str, tuple[PreparedShot, ...]]
"""What a next experiment could take, in words and as shots, of which it takes equally many."""


class ExcitationStrategy(ABC):
    """What the workflow has to know of one excitation; the defaults are those of independent shots.

    Attributes
    ----------
    excitation : Excitation
        Its word in `campaign.yaml`.
    unit : str
        What the unit of every test is called.
    free_plant_parameters : tuple of str
        Parameters of the nominal plant that such shots can tell anything of.
    shot_parameters : tuple of str
        What every shot has of its own beside an unknown mass; the friction factor comes first.
    has_contact : bool
        An actuator touches the part, and the record shows it.
    has_replicates : bool
        Shots of the same settings are replicates.
    mass_is_visible : bool
        Motion depends on the mass; in a free slide it cancels.
    floor_is_certain : bool
        What is above the floor is a gap even where the noise is only estimated.
    tests_between_shots : bool
        There are enough independent shots to look for what acts between them.
    selects_blocks : bool
        Shots whose events hinge on noise are left out.
    guess_shares : tuple of float
        Shares of a record from which the shot's first state is guessed; each is one start of a fit.
    state_comes_first : bool
        The first state is fitted before the friction factor: a wrong one makes other events.
    """

    excitation: ClassVar[Excitation]
    unit: ClassVar[str] = "shots"
    free_plant_parameters: ClassVar[tuple[str, ...]]
    shot_parameters: ClassVar[tuple[str, ...]] = ("log_factor", "speed_m_s", "shift_m")
    has_contact: ClassVar[bool] = False
    has_replicates: ClassVar[bool] = False
    mass_is_visible: ClassVar[bool] = True
    floor_is_certain: ClassVar[bool] = False
    tests_between_shots: ClassVar[bool] = True
    selects_blocks: ClassVar[bool] = False
    guess_shares: ClassVar[tuple[float, ...]] = (1.0,)
    state_comes_first: ClassVar[bool] = False

    def cut(self, campaign: Campaign, notes: list[str]) -> list[tuple[Capture, int]]:
        """Shots of a campaign, each with the number of its record from 1; `notes` gains what was assumed."""
        del notes
        return [(capture, number) for number, capture in enumerate(campaign.shots, 1)]

    @abstractmethod
    def predicted_channels(self, capture: Capture) -> tuple[Channel | None, Channel | None, Channel | None]:
        """Force, position and actuator as far as the model is to predict them."""

    def drive(self, capture: Capture) -> Samples:
        """Return times and values of the measured drive, shape (2, n)."""
        del capture
        return NO_DRIVE

    def adjust_covariates(self, covariates: dict[str, float]) -> dict[str, float]:
        """Covariates of a shot as the map is to see them."""
        return covariates

    def record_of(self, shot: PreparedShot) -> int:
        """Record within which a covariate has to vary to be of use; 0 where shots are independent."""
        del shot
        return 0

    def missing_information(self, shots: Sequence[PreparedShot]) -> list[str]:
        """Name what the data lack, and what that costs."""
        del shots
        return []

    def with_unstated_masses(self, shots: list[PreparedShot]) -> list[PreparedShot]:
        """Shots with a mass where neither they state it nor a fit can find it."""
        return shots

    @abstractmethod
    def unit_ratios(self, shot: PreparedShot, gravity_m_s2: float) -> Mapping[PlausibleRatio, float]:
        """Ratios that are about one unless a column has the wrong unit."""

    def split(self, shots: Sequence[PreparedShot], seed: int) -> tuple[IndexArray, IndexArray]:
        """Divide the shots into training and held-out ones: their indices, each in file order.

        A quarter is held out, spread over the settings: of one that has replicates a quarter of them, as near
        as that can be, and of the shots that are alone in theirs a quarter too, so that the model is also
        asked where it was not fitted. Of many such divisions it is one whose held-out shots are like those
        of their settings in whatever else differs (rerandomisation, Morgan & Rubin 2012), the energy of a
        tap among it: what only hard taps show must be in both parts.
        """
        rng = np.random.default_rng([seed, 1])
        settings = [_setting(shot) for shot in shots]
        divisions = [_draw_held_out(settings, rng) for _ in range(DIVISIONS)]
        features = _features(shots, settings)
        distance = np.array([np.sum(features[held].mean(0) ** 2) for held in divisions])
        nearest = np.argsort(distance, kind="stable")[: DIVISIONS // MOST_ALIKE]
        held_out = divisions[int(nearest.min())]
        return np.setdiff1d(np.arange(len(shots)), held_out), held_out

    def reduce(
        self, items: tuple[PreparedShot, ...], every: tuple[PreparedShot, ...], gravity_m_s2: float,
        position_noise_m: float,
    ) -> tuple[PreparedShot, ...]:  # fmt: skip
        """Shots as a fit reads them; `every` are all shots of the campaign."""
        del every, gravity_m_s2, position_noise_m
        return items

    @abstractmethod
    def plant_guesses(self, shots: Sequence[PreparedShot], gravity_m_s2: float) -> list[dict[str, float]]:
        """Values of the free plant parameters at which fits of the nominal model start."""

    def initial_mass(self, shots: Sequence[PreparedShot]) -> Samples:
        """Mass of every shot [kg], shape (n,): as stated, else the median of those that are."""
        mass = np.array([shot.mass_kg for shot in shots])
        stated = mass[np.isfinite(mass)]
        return np.where(np.isfinite(mass), mass, float(np.median(stated)) if len(stated) else 1.0)

    def initial_state(self, shot: PreparedShot, share: float) -> tuple[float, float]:
        """First speed along the shot [m/s] and first position [m], by a parabola through a share of it."""
        time, position = shot.times[1], shot.values[1]
        count = min(len(time), max(6, round(share * len(time))))
        _, slope, level = np.polyfit(time[:count], position[:count], 2)
        return slope * shot.direction, level

    @abstractmethod
    def sample_phases(self, shots: ShotSet, trajectory: Trajectory) -> IndexArray:
        """Phase of every sample, shape (N,), an index into `PHASES`."""

    def misfit_level(self, misfit_per_sample: Samples, sizes: IndexArray) -> float:
        """Mean squared residual of a set of shots from that of every shot."""
        return float(np.average(misfit_per_sample, weights=sizes))

    def settings_within_reach(
        self, shots: Sequence[PreparedShot], masses_kg: Samples, batches: Sequence[str], limits: CellLimits
    ) -> list[Setting]:
        """List settings that a next experiment could take; none by default.

        Masses are those of the shots, fitted where they are not stated; batches are named in order.
        """
        del shots, masses_kg, batches, limits
        return []


_Struck = tuple[float, float]
"""Velocity and direction of a shot: each is held out in its share."""


def _setting(shot: PreparedShot) -> _Struck:
    velocity = shot.velocity_m_s if math.isfinite(shot.velocity_m_s) else 0.0
    return (velocity, float(shot.direction))


def _draw_held_out(settings: Sequence[_Struck], rng: np.random.Generator) -> IndexArray:
    """Draw held-out shots, a quarter of each setting."""
    n = len(settings)
    order = rng.permutation(n)
    # Round after round one shot of every setting, at evenly spread shares of it: the quarter with the
    # smallest shares is a quarter of each.
    rank = np.empty(n, dtype=np.int64)
    drawn: Counter[_Struck] = Counter()
    for index in order.tolist():
        rank[index] = drawn[settings[index]]
        drawn[settings[index]] += 1
    share = (rank + rng.random(n)) / np.array([drawn[setting] for setting in settings])
    wanted = max(round(HELD_OUT_SHARE * n), min(MIN_HELD_OUT, n - MIN_TRAINING), 1)
    return np.sort(np.lexsort((order, share))[:wanted])


def _features(shots: Sequence[PreparedShot], settings: Sequence[_Struck]) -> Samples:
    """List how shots differ from those of their setting, of variance 1, shape (n, features).

    Places in the order of each covariate and of the energy of a tap, and whether that is of the largest
    quarter. Shots that are alone in their setting are held against each other.
    """
    names = sorted({name for shot in shots for name in shot.covariates})
    columns = [np.array([shot.covariates.get(name, math.nan) for shot in shots]) for name in names]
    columns.append(np.array([shot.mass_kg * shot.velocity_m_s**2 for shot in shots]))
    columns = [rankdata(np.nan_to_num(column)) for column in columns]
    columns.append((columns[-1] > (1.0 - HELD_OUT_SHARE) * len(shots)).astype(np.float64))
    deviation = np.array(columns).T
    places = defaultdict[_Struck | None, list[int]](list)
    for place, setting in enumerate(settings):
        places[setting if settings.count(setting) > 1 else None].append(place)
    for alike in places.values():
        deviation[alike] -= deviation[alike].mean(0)
    size = deviation.std(0)
    features: Samples = deviation[:, size > 0.0] / size[size > 0.0]
    return features
