"""Agreement of the plant with the simulator's own, written apart, over all effects."""

import math

import numpy as np

from impactcell.physics import Plant, TapInput, simulate_tap
from impactcell.physics.effects import LIBRARY
from simulator import plant as simulated
from simulator import plant_integrator
from tests.benchmarks._scipy_tap import B, K
from tests.benchmarks.physics import COLUMNS
from tests.benchmarks.table import Table

TIGHT = {"RELATIVE_TOLERANCE": 1e-12, "LONGEST_CONTACT_STEP_S": 1e-4, "LONGEST_SLIDE_STEP_S": 1e-3}
"""Settings of the simulator's integrator, of which it is a reference here."""


def _set_integrator(settings: dict[str, float]) -> None:
    for name, value in settings.items():
        setattr(plant_integrator, name, value)


def agreement(*, quick: bool) -> Table:
    """Random parameters, each effect alone and mixtures, against the simulator's own integrator."""
    rng = np.random.default_rng(2026)
    identifiers = sorted(LIBRARY)
    cases = [[name] for name in identifiers for _ in range(1 if quick else 8)]
    cases += [
        sorted(rng.choice(identifiers, rng.integers(2, 5), replace=False).tolist())
        for _ in range(10 if quick else 200)
    ]
    kept = {name: getattr(plant_integrator, name) for name in TIGHT}
    _set_integrator(TIGHT)
    force, distance, skipped = [], [], 0
    try:
        for names in cases:
            made = {}
            for name in names:
                given = {}
                for p in LIBRARY[name].parameters:
                    value = p.typical * math.exp(0.5 * rng.normal())
                    value = -value if p.lower < 0.0 and rng.random() < 0.5 else value
                    value = min(max(value, p.lower), p.upper)
                    given[p.name] = [value] if p.per_batch else value
                made[name] = given
            mu = rng.uniform(0.12, 0.3)
            plant = {
                "stiffness_n_per_m": K * math.exp(0.2 * rng.normal()),
                "damping_n_s_per_m": B * math.exp(0.4 * rng.normal()),
                "mu_s": mu,
                "mu_k": mu * rng.uniform(0.65, 1.0),
                "effects": made,
            }
            tap = {
                "velocity_m_s": rng.uniform(0.01, 0.1),
                "mass_kg": rng.uniform(5.0, 40.0),
                "stroke_m": rng.uniform(4e-4, 1.5e-3),
                "direction": int(rng.choice([-1, 1])),
                "start_m": rng.uniform(-0.01, 0.01),
                "dwell_s": rng.uniform(0.01, 1000.0),
                "batch": int(rng.integers(0, 2)),
            }
            ours = simulate_tap(Plant(**plant), TapInput(**tap))
            theirs = simulated.simulate_tap(simulated.Plant(**plant), simulated.TapInput(**tap))
            if "force_sensor_lag" not in names:
                force.append(abs(ours.peak_force_n / theirs.sensed(theirs.peak_force_n) - 1.0))
            if math.isnan(theirs.sliding_distance_m) or ("presliding_compliance" in names and len(names) > 1):
                skipped += 1
            else:
                distance.append(abs(ours.sliding_distance_m / theirs.sliding_distance_m - 1.0))
    finally:
        _set_integrator(kept)
    rows = [
        (name, "1e-6", f"{max(some):.1e} at most", f"median {np.median(some):.1e}, {len(some)} taps")
        for name, some in (("peak force, relative", force), ("sliding distance, relative", distance))
    ]
    return Table(
        "Agreement with the simulator's integrator over all effects, random parameters",
        COLUMNS,
        rows,
        "Each effect alone and mixtures of 2-4; the other integrator at rtol 1e-12 in steps of 1 ms at most. "
        f"{skipped} taps without a sliding distance, or ringing in elastic stick under a load, "
        "count for the force only.",
    )


def tables(*, quick: bool = False) -> list[Table]:
    """Every table of this topic."""
    return [agreement(quick=quick)]
