"""Single batch steps: delays of the tracker's bank and of the classical charts at equal false alarms."""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from impactcell.tracking.wear_batch import TrackerSettings, run_length_bank
from impactcell.tracking.wear_batch.run_length_model import BankModel, Measurement
from tests.benchmarks import _charts, _streams
from tests.benchmarks.table import Table

BARS = {0.5: 1.35, 1.0: 1.25, 2.0: 1.2, 3.0: 1.2}
DESIGN = 100_000.0
KNOWN_CYCLES = 3000  # in control before the first step
APART = 120  # cycles in control between the places at which a step is tried
LONGEST = 1200  # cycles a step is given
PLACES = 25


@njit(error_model="numpy")  # not kept on disk: machine code there is known by the sources beside it only
def _follow(
    z: np.ndarray,
    first: int,
    bank: np.ndarray,
    count: int,
    outliers: np.ndarray,
    accepted: float,
    model: BankModel,
    limit: float,
    found: np.ndarray,
) -> tuple[int, int, float]:
    n = 0
    for k in range(len(z)):
        t = first + k
        measurement = Measurement(z[k], 1.0, 1.0, 0.0, float(t), 0.0)
        count, _, statistic, _ = run_length_bank.update(bank, count, model, measurement, outliers, accepted)
        if statistic > limit:
            accepted = float(t)
            found[n] = t
            n += 1
            if n == len(found):
                break
    return count, n, accepted


@dataclass
class Run:
    """The bank on a stream, as the tracker uses it, with the scale of the noise given."""

    bank: np.ndarray
    count: int
    model: BankModel
    outliers: np.ndarray
    accepted: float
    cycle: int

    @classmethod
    def start(cls, value: float) -> "Run":
        settings = TrackerSettings()
        prior = settings.outlier_probability
        first = run_length_bank.initial_bank(value, 1.0, settings.slope_std, 0, prior)
        model = BankModel(settings.hazard, settings.step_std**2, 0.0, 0.0, prior, settings.slope_std**2)
        return cls(run_length_bank.workspace(first), len(first), model, np.zeros(2), 0.0, 1)

    def moments(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean and covariance of the bank as it is now."""
        return run_length_bank.moments(run_length_bank.stored(self.bank, self.count))

    def copy(self) -> "Run":
        return Run(self.bank.copy(), self.count, self.model, self.outliers.copy(), self.accepted, self.cycle)

    def follow(self, z: np.ndarray, most: int = 1000) -> np.ndarray:
        """Take z in; give back the indices of the alarms and stop after the `most`-th."""
        found = np.zeros(most)
        self.count, n, self.accepted = _follow(
            z,
            self.cycle,
            self.bank,
            self.count,
            self.outliers,
            self.accepted,
            self.model,
            run_length_bank.threshold(DESIGN),
            found,
        )
        self.cycle += len(z)
        return found[:n]


def false_alarms(cycles: int, length: int, seed: int) -> int:
    """Count the bank's alarms in `cycles` cycles without a change or outlier, in streams of `length`."""
    total = 0
    for stream in range(cycles // length):
        z = np.random.default_rng([seed, stream]).normal(size=length)
        total += len(Run.start(z[0]).follow(z[1:]))
    return total


def bank_delays(streams: int, seed: int) -> dict[float, list[list[float]]]:
    """Delays by size, a list for each stream: steps are tried at many places of it, twice at each."""
    delays: dict[float, list[list[float]]] = {size: [] for size in BARS}
    for stream in range(streams):
        rng = np.random.default_rng([seed, stream])
        z = rng.normal(size=KNOWN_CYCLES)
        run = Run.start(z[0])
        run.follow(z[1:])
        own: dict[float, list[float]] = {size: [] for size in BARS}
        for _ in range(PLACES):
            for size in BARS:
                for sign in (-1.0, 1.0):
                    found = run.copy().follow(rng.normal(size=LONGEST) + sign * size, most=1)
                    own[size].append((found[0] if len(found) else run.cycle + LONGEST) - run.cycle + 1)
            run.follow(rng.normal(size=APART))
        for size in BARS:
            delays[size].append(own[size])
    return delays


def table(*, quick: bool) -> Table:
    cycles = 500_000 if quick else 3_000_000
    found = false_alarms(cycles, 50_000, seed=_streams.REPORTED + 11)
    # the bound belongs to the rate that was measured, at least what it was designed for
    arl = cycles / max(found, 1)
    low, high = cycles / (found + 2.0 * np.sqrt(found + 1.0)), cycles / max(found - 2.0 * np.sqrt(found), 0.5)
    charts = _charts.limits(arl)
    rows = [
        [
            "cycles between false alarms (design 100000)",
            "",
            f"{arl:.0f}",
            f"{low:.0f} .. {high:.0f}",
            *["same"] * 4,
        ]
    ]
    streams, runs = (10, 150) if quick else (40, 400)
    delays = bank_delays(streams, seed=_streams.REPORTED + 12)
    for size, bar in BARS.items():
        bound = _charts.optimal_delay(size, arl)
        # delays in one stream share its level: the streams are what is independent
        means = np.array([np.mean(own) for own in delays[size]]) / bound
        error = 1.96 * means.std(ddof=1) / math.sqrt(len(means))
        others = []
        for kind in range(len(charts)):
            few = 40 if kind == 0 else runs
            seen = _charts.delay(kind, charts[kind], size, few, seed=_streams.REPORTED + 13)
            others.append(f"{seen.mean() / bound:.2f}")
        rows.append(
            [
                f"delay / bound, step of {size:g} sd",
                f"<= {bar}",
                f"{means.mean():.3f}",
                f"± {error:.3f}",
                *others,
            ]
        )
    note = (
        f"{cycles} cycles in control in streams of 50000; {streams} streams with {2 * PLACES} steps of each "
        f"size after {KNOWN_CYCLES} cycles and more in control; the bank learns mean, wear and how many "
        "outliers there are, the charts are told mean and wear. "
        "Bound: matched CUSUM at the measured rate (Moustakides), by integral equation."
    )
    return Table(
        "Batch unknown: single steps", ["what", "bar", "measured", "95 %", *_charts.CHARTS], rows, note
    )
