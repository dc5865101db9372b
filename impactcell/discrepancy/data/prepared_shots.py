"""Shots as the workflow works on them: covariates, samples of all channels in one row, replicate groups."""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from impactcell.records import Samples

if TYPE_CHECKING:
    from impactcell.discrepancy.data.excitation import ExcitationStrategy

CHANNELS = ("force", "position", "actuator")
"""Names of the channels, in the order of all arrays of channels."""
# Their numbers.
FORCE, POSITION, ACTUATOR = range(3)

OWN_COVARIATES = ("shot", "velocity", "mass", "direction", "batch", "dwell", "start", "time", "initial_speed")
"""Covariates that every shot or block has; any other is a further column of `shots.csv`."""
MOTION_COVARIATES = ("speed", "position", "indentation", "indentation_rate", "gap", "time", "force")
"""Numbers of the motion that a law may be a function of, by the names that it has for them."""

IndexArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class PreparedShot:
    """One shot, or one block of a driven record.

    Attributes
    ----------
    number : int
        As `shots.csv` numbers the shot; blocks are counted from 1 over all records.
    record, records : int
        Its record in file order, from 1, and how many there are: a shot is one, blocks share theirs.
    batch : int
        Number of the batch in order of appearance.
    group : int
        Shots with the same settings share a group: replicates.
    times : tuple of ndarray
        Sample times of force, position and actuator; empty where a channel was not recorded.
    values : tuple of ndarray
        Samples of the same channels.
    drive : ndarray, shape (2, n)
        Times and values of the driving force; shape (2, 0) unless the part is driven.
    covariates : dict of str to float
        Everything of `shots.csv` that is a number or was made one: `shot` is the record, `batch` its number,
        `dwell` the base-10 logarithm of the dwell in seconds, at least that of `MIN_DWELL_S`.
    whitener : ndarray, shape (n, n)
        Makes residuals of a driven block independent and of unit variance; shape (0, 0) elsewhere.
    sampling_step_s : float
        Of the force, of another channel where there is none.
    onset_is_open : bool
        Whether first contact may lie anywhere within a sampling step of t = 0.
    velocity_is_open, mass_is_open : bool
        Whether velocity and mass are told as measured ones, which are a little off.
    """

    number: int
    record: int
    records: int
    velocity_m_s: float
    mass_kg: float
    direction: int
    batch: int
    dwell_s: float
    start_m: float
    group: int
    times: tuple[Samples, Samples, Samples]
    values: tuple[Samples, Samples, Samples]
    drive: Samples
    covariates: dict[str, float]
    whitener: Samples = field(default_factory=lambda: np.empty((0, 0)))
    sampling_step_s: float = 0.0
    onset_is_open: bool = False
    velocity_is_open: bool = False
    mass_is_open: bool = False

    @property
    def onset_step_s(self) -> float:
        """How far first contact may lie from t = 0 [s]."""
        return self.sampling_step_s if self.onset_is_open else 0.0

    @property
    def columns(self) -> tuple[tuple[str, float], ...]:
        """Further columns of `shots.csv` that are numbers, by name."""
        return tuple((name, value) for name, value in self.covariates.items() if name not in OWN_COVARIATES)

    @property
    def size(self) -> int:
        """Number of samples over all channels."""
        return sum(len(channel) for channel in self.values)


@dataclass(frozen=True, slots=True, eq=False)
class ShotSet:
    """A set of shots laid out for fits: samples shot after shot, channel after channel.

    Attributes
    ----------
    noise_std : tuple of float
        Standard deviation of each channel's noise [N, m, m]; nan where a channel was not recorded.
    values, weights : ndarray, shape (N,)
        Samples, and one over the noise's standard deviation.
    channel : ndarray, shape (N,)
        Which of `CHANNELS` a sample belongs to.
    bounds : ndarray, shape (n + 1,)
        Shot i owns samples `bounds[i]` to `bounds[i + 1]`.
    """

    excitation: "ExcitationStrategy"
    gravity_m_s2: float
    stroke_m: float
    items: tuple[PreparedShot, ...]
    noise_std: tuple[float, float, float]
    values: Samples
    weights: Samples
    channel: IndexArray
    bounds: IndexArray

    def __len__(self) -> int:
        return len(self.items)

    def samples_of(self, shot: int) -> slice:
        """Select the samples of one shot."""
        return slice(int(self.bounds[shot]), int(self.bounds[shot + 1]))

    def whiten(self, change: Samples) -> Samples:
        """Scale residuals, shape (N,), so that they are independent and of unit variance."""
        if not self.items[0].whitener.size:
            scaled: Samples = change * self.weights
            return scaled
        return np.concatenate(
            [shot.whitener @ change[self.samples_of(i)] for i, shot in enumerate(self.items)]
        )

    def unwhiten(self, residual: Samples) -> Samples:
        """Scale residuals back: measured minus predicted [N, m, m]."""
        if not self.items[0].whitener.size:
            scaled: Samples = residual / self.weights
            return scaled
        return np.concatenate(
            [
                np.linalg.solve(shot.whitener, residual[self.samples_of(i)])
                for i, shot in enumerate(self.items)
            ]
        )

    @property
    def visited_m(self) -> tuple[float, float]:
        """Lowest and highest position on the table that was measured [m]; (0, 0) where none was."""
        along = [shot.start_m + shot.values[1] for shot in self.items if len(shot.values[1])]
        if not along:
            return 0.0, 0.0
        return min(float(one.min()) for one in along), max(float(one.max()) for one in along)

    @property
    def times(self) -> Samples:
        """Time of every sample, shape (N,)."""
        return np.concatenate([np.concatenate(shot.times) for shot in self.items])

    def select(self, places: IndexArray) -> "ShotSet":
        """Return the same set with only some of its shots, in the order given."""
        return concatenate_shots(
            self.excitation,
            self.gravity_m_s2,
            self.stroke_m,
            tuple(self.items[int(place)] for place in places),
            self.noise_std,
        )


def concatenate_shots(
    excitation: "ExcitationStrategy",
    gravity_m_s2: float,
    stroke_m: float,
    items: tuple[PreparedShot, ...],
    noise_std: tuple[float, float, float],
) -> ShotSet:
    """Put the samples of many shots in one row."""
    values = np.concatenate([np.concatenate(shot.values) for shot in items])
    channel = np.concatenate(
        [np.repeat(np.arange(3), [len(samples) for samples in shot.values]) for shot in items]
    )
    weights = 1.0 / np.asarray(noise_std)[channel]
    bounds = np.concatenate([[0], np.cumsum([shot.size for shot in items])]).astype(np.int64)
    return ShotSet(excitation, gravity_m_s2, stroke_m, items, noise_std, values, weights, channel, bounds)


def decimate(shots: ShotSet, max_samples: int) -> ShotSet:
    """Keep every k-th sample, so that no channel of a shot has more than about `max_samples`.

    Fits and scores cost what they read; a search among many models can do with fewer samples than the
    comparison of the last few.
    """
    longest = max(len(channel) for shot in shots.items for channel in shot.values)
    step = max(longest // max_samples, 1)
    if step == 1:
        return shots
    items = tuple(
        replace(
            shot,
            times=(shot.times[0][::step], shot.times[1][::step], shot.times[2][::step]),
            values=(shot.values[0][::step], shot.values[1][::step], shot.values[2][::step]),
        )
        for shot in shots.items
    )
    return concatenate_shots(shots.excitation, shots.gravity_m_s2, shots.stroke_m, items, shots.noise_std)
