"""Shewhart, EWMA, CUSUM and GLR inside the stream of wear, batches and outliers.

They are told what the tracker has to find out: the wear, the level of each batch before the step and when
it began. Values are clipped for all but Shewhart, which sees nothing but large ones. Thresholds come from
streams without a change, so that false alarms are as frequent as ours.
"""

from dataclasses import dataclass, field

import numpy as np

from impactcell.numerics.jit import compiled
from tests.benchmarks import _charts, _streams

CLIP = 3.0
BRACKETS = ((10.0, 25.0), (0.8, 1.1), (6.5, 9.0), (7.0, 9.0))  # thresholds between which the right ones lie
CYCLES = 1_500_000  # without a change, to set a threshold by


@compiled
def ewma(z: np.ndarray) -> np.ndarray:
    """Follow z by an EWMA that starts at its first value."""
    out = np.empty(len(z))
    level = z[0]
    for t in range(len(z)):
        level += 0.1 * (z[t] - level)
        out[t] = level
    return out


@dataclass
class Chart:
    """What one chart found: delays by size, how many steps it missed, false alarms in how many cycles."""

    kind: int
    limit: float
    seen: dict[float, list[float]] = field(default_factory=dict)
    false: int = 0
    cycles: int = 0

    def ratio(self, size: float, bound: float) -> str:
        found = np.array(self.seen[size])
        found = found[np.isfinite(found)]
        return f"{found.mean() / bound:.2f}" if len(found) else "never"

    def lost(self, size: float) -> str:
        found = np.array(self.seen[size])
        return f"{100.0 * (~np.isfinite(found)).mean():.1f} %"


def delays(streams: list[_streams.Stream], arl: float) -> list[Chart]:
    """Run all charts over the streams at thresholds for `arl` cycles between false alarms."""
    charts = [Chart(kind, _limit(kind, arl)) for kind in range(len(_charts.CHARTS))]
    for truth in streams:
        wearless = truth.values - _streams.SLOPE * np.arange(len(truth.values))
        offset = np.concatenate([[0.0], np.cumsum(truth.steps)])
        begins = np.concatenate([[0], truth.changes, [len(wearless)]])
        for i, step in enumerate(truth.steps):
            begin, change, end = begins[i], begins[i + 1], begins[i + 2]
            if len(wearless) - change < 500:
                continue
            for chart in charts:
                z = _seen(chart.kind, wearless[begin:end] - offset[i])
                at, false = _first(z, int(change - begin), chart.kind, chart.limit)
                chart.false += false
                chart.cycles += int(change - begin)
                chart.seen.setdefault(abs(float(step)), []).append(at)
    return charts


def _first(z: np.ndarray, change: int, kind: int, limit: float) -> tuple[float, int]:
    """Delay of the first alarm from `change` on, and false alarms before; after each the chart starts anew"""
    begin = false = 0
    while True:
        t = _charts.detect(z[begin:], change - begin, kind, limit)
        if t >= 0:
            return (float(t - (change - begin) + 1) if begin + t < len(z) else np.inf), false
        begin += -t
        false += 1


def _seen(kind: int, z: np.ndarray) -> np.ndarray:
    return z if kind == 0 else np.clip(z, -CLIP, CLIP)


def _limit(kind: int, arl: float) -> float:
    """Threshold at a mean time between false alarms: log-linear between two that are simulated."""
    found = []
    for limit in BRACKETS[kind]:
        rng = np.random.default_rng([_streams.REPORTED, 77, kind])
        alarms = cycles = 0
        while cycles < CYCLES:
            z = rng.normal(size=100_000)
            odd = rng.random(len(z)) < _streams.OUTLIERS
            z[odd] += _streams.OUTLIER_STD * rng.normal(size=int(odd.sum()))
            t = _charts.detect(_seen(kind, z), len(z), kind, limit)
            alarms += t < 0
            cycles += -t if t < 0 else len(z)
        found.append((limit, np.log(cycles / max(alarms, 1))))
    (a, la), (b, lb) = found
    return float(a + (np.log(arl) - la) * (b - a) / (lb - la))
