"""Single batch steps: delays of the tracker's bank and of the classical charts at equal false alarms."""

import numpy as np

from impactcell.compiled import compiled
from impactcell.tracking import TrackerSettings, bank
from tests.benchmarks import _charts
from tests.benchmarks.table import Table

BARS = {0.5: 1.35, 1.0: 1.25, 2.0: 1.2, 3.0: 1.2}
KNOWN_CYCLES = 3000  # in control before the step


@compiled
def alarms(
    z: np.ndarray, table: np.ndarray, count: int, design: np.ndarray, limit: float, out: np.ndarray
) -> int:
    """Take all of z into the bank in place; write the indices of its alarms to `out`, their number back."""
    reading = np.zeros(6)
    reading[1], reading[2] = 1.0, 1.0
    accepted, found = table[0, 1], 0
    for t in range(1, len(z)):
        reading[0], reading[4] = z[t], t
        count, _, statistic = bank.run_cycle(table, count, design, reading, accepted)
        if statistic > limit:
            accepted = t
            out[found] = t
            found += 1
            if found == len(out):
                break
    return found


def start(value: float) -> tuple[np.ndarray, int, np.ndarray]:
    settings = TrackerSettings()
    design = bank.design(settings.hazard, settings.step_std**2, 0.0, 0.0, settings.outlier_probability)
    table = np.zeros((bank.ROWS, bank.WIDTH))
    first = bank.seed(value, 1.0, settings.slope_std, 0, settings.outlier_probability)
    table[: len(first)] = first
    return table, len(first), design


def false_alarms(limit: float, cycles: int, length: int, seed: int, outliers: float = 0.0) -> int:
    """Count the bank's alarms in `cycles` cycles without a change, in streams of `length`."""
    total = 0
    for run in range(cycles // length):
        rng = np.random.default_rng([seed, run])
        z = rng.normal(size=length)
        odd = rng.random(length) < outliers
        z[odd] += 10.0 * rng.normal(size=int(odd.sum()))
        table, count, design = start(z[0])
        total += alarms(z, table, count, design, limit, np.zeros(1000))
    return total


def bank_delays(limit: float, shift: float, runs: int, seed: int) -> np.ndarray:
    delays = []
    for run in range(runs):
        rng = np.random.default_rng([seed, run])
        z = rng.normal(size=KNOWN_CYCLES + 800)
        z[KNOWN_CYCLES:] += shift if run % 2 else -shift
        table, count, design = start(z[0])
        out = np.zeros(8)
        n = alarms(z, table, count, design, limit, out)
        after = out[:n][out[:n] >= KNOWN_CYCLES]
        if len(after) == n:
            delays.append((after[0] if n else len(z)) - KNOWN_CYCLES + 1)
    return np.array(delays)


def table(*, quick: bool) -> Table:
    limit = bank.threshold(100_000.0)
    cycles = 500_000 if quick else 2_000_000
    found = false_alarms(limit, cycles, 50_000, seed=11)
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
    runs = 150 if quick else 400
    for shift, bar in BARS.items():
        bound = _charts.optimal_delay(shift, arl)
        own = bank_delays(limit, shift, runs, seed=12)
        error = 1.96 * own.std() / np.sqrt(len(own)) / bound
        others = []
        for kind in range(len(charts)):
            few = 40 if kind == 0 else runs
            seen = _charts.delay(kind, charts[kind], shift, few, seed=13)
            others.append(f"{seen.mean() / bound:.2f}")
        ratio = own.mean() / bound
        rows.append(
            [f"delay / bound, step of {shift:g} sd", f"<= {bar}", f"{ratio:.3f}", f"± {error:.3f}", *others]
        )
    note = (
        f"{cycles} cycles in control in streams of 50000, {runs} steps after "
        f"{KNOWN_CYCLES} cycles in control; the bank learns mean and wear, the charts are told them. "
        "Bound: matched CUSUM at the measured rate (Moustakides), by integral equation."
    )
    return Table(
        "Batch unknown: single steps", ["what", "bar", "measured", "95 %", *_charts.CHARTS], rows, note
    )
