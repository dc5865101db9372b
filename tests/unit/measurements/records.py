"""Records of taps as a data logger writes them: pretrigger, offsets, German headers, any clock."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from impactcell.measurements import MeasuredColumn, Table
from tests.taps import Tap

RATE_HZ = 10_000.0
PRETRIGGER_S = 0.03
FORCE_OFFSET_N = 3.0
PLACE_M = 0.012


def taps(
    velocities: Sequence[float] = (2500, 3500, 4500), masses: Sequence[float] = (18.9, 25.2)
) -> list[Tap]:
    return [
        Tap(velocity / 6e4, 0.2, mass_kg=mass, stroke_m=1.5e-3, direction=sign, effects={})
        for velocity in velocities
        for mass in masses
        for sign in (1, -1)
    ]


def sampled(
    tap: Tap, rng: np.random.Generator, tail_s: float = 0.03
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time from the begin of the record, contact force, position on the table; contact anywhere in a step."""
    motion = tap.motion()
    onset = PRETRIGGER_S + rng.uniform(0.0, 1.0) / RATE_HZ
    time = np.arange(0.0, onset + motion.end_s + tail_s, 1.0 / RATE_HZ)
    since = time - onset
    force = np.where(since > 0.0, motion.force_n(np.maximum(since, 0.0)), 0.0)
    position = np.where(since > 0.0, motion.position_m(np.maximum(since, 0.0)), 0.0)
    return (
        time,
        force + rng.normal(0.0, 0.4, time.size),
        PLACE_M + position + rng.normal(0.0, 1.5e-6, time.size),
    )


def recorded(name: str, columns: Sequence[np.ndarray]) -> Table:
    """Give the table of a file that has time [s], force [N] and position [m]."""
    names = (("Time", "s"), ("Force", "N"), ("Position", "m"))
    return Table(name, tuple(MeasuredColumn(*of, values) for of, values in zip(names, columns, strict=True)))


def write_logger_file(path: Path, tap: Tap, rng: np.random.Generator) -> None:
    """One shot as German text: compression negative, milliseconds, micrometres."""
    time, force, position = sampled(tap, rng)
    head = f"Messung 7\nMasse: {tap.mass_kg} kg\nVorschub: {tap.velocity_m_s * 6e4:.10g} mm/min\n\n"
    rows = ["Zeit [ms];Kraft [N];Weg [µm]"]
    rows += [
        f"{1e3 * t:.4f};{-f - FORCE_OFFSET_N:.5f};{1e6 * x:.4f}"
        for t, f, x in zip(time, force, position, strict=True)
    ]
    path.write_bytes((head + "\n".join(rows)).replace(".", ",").replace("\n", "\r\n").encode("cp1252"))
