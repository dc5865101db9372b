"""Cells that learn their model from 30 taps of their own, and taps in which the part is met again.

    python -m tests.benchmarks._first_cells

The taps are the simulator's own plant's, of parts and contacts that the fit is told nothing of.
"""

import math
from dataclasses import replace

import numpy as np

from impactcell import cell as core
from impactcell.cell import CellDesign
from impactcell.errors import PhysicsError, PredictionError
from impactcell.features import Features, extract, required
from impactcell.features.contact import contact_spells
from impactcell.physics import Plant
from impactcell.prediction import Model, Prior
from impactcell.prediction.joint_plant_fit import fit_plant
from impactcell.prediction.waveform import fit
from impactcell.records import PositioningState
from impactcell.service.factory import cell_design
from impactcell.settings import read_cell
from tests.benchmarks.table import Table
from tests.integration.processes import CONFIG
from tests.taps import Tap

SEEDS = 640_000
CELLS, FIRST_TAPS, CYCLES = 100, 30, 150
TAPS = 3000
GRAVITY = 9.81
USUAL, SLOW = (2000, 3000, 4000, 5000, 6000), (1000, 1500, 2000, 3000, 4000)  # mm/min


def drawn_cell(rng: np.random.Generator, masses: tuple[float, float], stroke_m: float) -> Tap:
    return Tap(
        mu_s=rng.uniform(0.17, 0.23),
        ratio=rng.uniform(0.7, 0.85),
        mass_kg=rng.uniform(*masses),
        stroke_m=stroke_m,
        stiffness=6.5e5 * math.exp(0.3 * rng.normal()),
        damping=465.0 * math.exp(0.2 * rng.normal()),
        effects={},
    )


def tapped(
    cell: Tap, rng: np.random.Generator, velocity: float, scatters: tuple[float, float], number: int
) -> Features:
    """One tap; friction and mu_k/mu_s scatter from tap to tap."""
    tap = replace(
        cell,
        velocity_m_s=velocity / 6e4,
        mu_s=cell.mu_s * math.exp(scatters[0] * rng.normal()),
        ratio=cell.ratio * math.exp(scatters[1] * rng.normal()),
    )
    return extract(tap.capture(rng, cycle=number))


def first_taps(
    cell: Tap, rng: np.random.Generator, velocities: tuple[int, ...]
) -> tuple[list[Features], tuple[float, float]]:
    scatters = float(rng.choice([0.0, 0.01, 0.03])), float(rng.choice([0.0, 0.01]))
    numbers = range(1, FIRST_TAPS + 1)
    return [tapped(cell, rng, velocities[n % len(velocities)], scatters, n) for n in numbers], scatters


def level_pulls(design: CellDesign, seed: int) -> tuple[float, float] | None:
    """How far the level is off after 150 cycles: in its own standard deviations, and with what is shared."""
    rng = np.random.default_rng(SEEDS + seed)
    cell = drawn_cell(rng, (8.0, 20.0), 1.5e-3)
    taps, scatters = first_taps(cell, rng, USUAL)
    model = fit_plant(taps, GRAVITY).model
    if model.prior.ratio_std > 0.05:  # `model fit` asks for slower taps
        return None
    design, velocity = replace(design, model=model), float(rng.choice([2500, 4000, 6000]))
    state = core.initial_state(design)
    for cycle in range(1, CYCLES + 1):
        capture = tapped(cell, rng, velocity, scatters, cycle).capture
        stepped = core.step(design, state, capture, PositioningState(), None, ())
        state = stepped.state
    wear = stepped.snapshot.wear
    off = wear.level - cell.mu_s
    return off / max(wear.level_std, 1e-300), off / math.hypot(wear.level_std, wear.level_common_std)


def campaign(seed: int) -> tuple[bool, float]:
    """Whether slow taps, many of which are met again, have a plant, and how far its mu_k/mu_s is off."""
    rng = np.random.default_rng(SEEDS + 10_000 + seed)
    cell = drawn_cell(rng, (5.0, 12.0), rng.uniform(5e-4, 2.5e-3))
    taps, _ = first_taps(cell, rng, SLOW)
    try:
        model = fit_plant(taps, GRAVITY).model
    except (PredictionError, PhysicsError):
        return False, math.nan
    return True, (model.ratio - cell.ratio) / model.prior.ratio_std


def slow_tap(seed: int) -> tuple[bool, str, tuple[float, float]]:
    """Whether a tap was met again, what became of its estimate, and how far mu_s and mu_k are off."""
    rng = np.random.default_rng(SEEDS + 20_000 + seed)
    cell = drawn_cell(rng, (5.0, 12.0), rng.uniform(5e-4, 2.5e-3))
    plant = Plant(cell.stiffness, cell.damping, 0.2, 0.2 * cell.ratio)
    model = Model("known", plant, Prior(0.003 * cell.stiffness, 0.005 * cell.damping, 0.01 * cell.ratio))
    tap = replace(
        cell,
        velocity_m_s=rng.uniform(1000, 3000) / 6e4,
        ratio=cell.ratio * math.exp(0.01 * rng.normal()),
        stiffness=cell.stiffness * math.exp(0.003 * rng.normal()),
        damping=cell.damping * math.exp(0.005 * rng.normal()),
    )
    features = extract(tap.capture(rng))
    is_met = len(contact_spells(required(features.force))) > 1
    if isinstance(features.slide, PredictionError | PhysicsError):
        return is_met, "slide too short", (math.nan, math.nan)
    try:
        found = fit(features, model)
    except PredictionError:
        return is_met, "unlike the model", (math.nan, math.nan)
    pulls = (found.mu_s - tap.mu_s) / found.mu_s_std, (found.mu_k - tap.mu_k) / found.mu_k_std
    return is_met, "estimated", pulls


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values), axis=0)))


def tables() -> list[Table]:
    design = cell_design(read_cell(CONFIG / "cells" / "prototype.yaml"))
    found = [level_pulls(design, seed) for seed in range(CELLS)]
    pulls = np.array([one for one in found if one is not None])
    inside = (np.abs(pulls) < 1.96).sum(axis=0)
    levels = Table(
        "The level of a cell whose model is of its own first taps",
        ("what", "its own band", "with what all cycles share"),
        [
            ("off, RMS in standard deviations", f"{rms(pulls[:, 0]):.3g}", f"{rms(pulls[:, 1]):.2f}"),
            ("off, largest", f"{np.abs(pulls[:, 0]).max():.3g}", f"{np.abs(pulls[:, 1]).max():.2f}"),
            ("inside 95 %", f"{inside[0]} of {len(pulls)}", f"{inside[1]} of {len(pulls)}"),
        ],
        f"{CELLS} cells, {len(found) - len(pulls)} of them asked for slower taps.",
    )
    fits = [campaign(seed) for seed in range(CELLS)]
    known = np.array([pull for is_fitted, pull in fits if is_fitted])
    rows = [("campaigns of slow taps", str(CELLS), f"{CELLS - len(known)} refused", f"{rms(known):.2f}", "-")]
    slow = [slow_tap(seed) for seed in range(TAPS)]
    for is_met, name in ((True, "slow taps that are met again"), (False, "slow taps that are not")):
        kind = [one for one in slow if one[0] is is_met]
        pulls = np.array([one[2] for one in kind if one[1] == "estimated"])
        missed = ", ".join(
            f"{sum(one[1] == why for one in kind)} {why}" for why in ("slide too short", "unlike the model")
        )
        off = f"{rms(pulls[:, 0]):.2f}; {rms(pulls[:, 1]):.2f}"
        rows.append((name, str(len(kind)), missed, off, str(int((np.abs(pulls) > 4.0).any(axis=1).sum()))))
    again = Table(
        "Slow taps",
        ("what", "how many", "without an answer", "off, RMS in std (ratio; or mu_s; mu_k)", "beyond 4 std"),
        rows,
    )
    return [levels, again]


def main() -> None:
    for table in tables():
        print(table.markdown())


if __name__ == "__main__":
    main()
