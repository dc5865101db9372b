"""Prediction of friction: equations (4)-(6), the waveform against its bound, coverage, and speed.

Every shot is made by the simulator's own plant (`simulator.plant`), never by `impactcell.physics`.
"""

import math
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from impactcell.features import extract
from impactcell.physics import TapInput
from impactcell.prediction import Model, calibrate, estimate, printed_predictor
from impactcell.prediction.calibration import fit_predictor
from impactcell.prediction.mass_interpolation import sliding_distance
from impactcell.prediction.waveform import fit
from impactcell.records import Capture, Channel, Quality, as_recorded, with_open_onset
from tests.benchmarks._prediction_shots import (
    FRICTIONS,
    MASS_KG,
    OF,
    PLANT,
    PRIOR,
    PRIOR_INFORMATION,
    RATIO,
    VELOCITIES_MM_PER_MIN,
    VISCOUS,
    B,
    K,
    Truth,
    information,
    motion,
    shot,
)
from tests.benchmarks._viscous_regression import by_decrement, by_least_squares
from tests.benchmarks.table import Table
from tests.posterior_intervals import friction_intervals


def table_of_coefficients() -> Table:
    velocities = np.linspace(0.05, 0.1, 17)
    tap = TapInput(0.1, MASS_KG, halts_at_separation=True)
    fitted, printed = fit_predictor(PLANT, tap, velocities, FRICTIONS), printed_predictor()
    mu, v = np.meshgrid(FRICTIONS, velocities)

    def force(predictor):  # type: ignore[no-untyped-def]
        return predictor.force.friction_n * mu + predictor.force.velocity_n_s_per_m * v

    error_f = np.abs(force(fitted) / force(printed) - 1.0)
    error_d = np.abs(
        sliding_distance(fitted.distance, mu, v) / sliding_distance(printed.distance, mu, v) - 1.0
    )
    return Table(
        "Equations (4) and (5) refitted to the reference plant, against the printed coefficients",
        ("curve", "bar", "largest difference", "mean"),
        [
            ("peak force (4)", "0.6 %", f"{100 * error_f.max():.2f} %", f"{100 * error_f.mean():.2f} %"),
            ("sliding distance (5)", "2 %", f"{100 * error_d.max():.2f} %", f"{100 * error_d.mean():.2f} %"),
        ],
        "mu_s 0.15-0.25, v 3000-6000 mm/min, 18.9 kg; refitted: F_p = "
        f"{fitted.force.friction_n:.1f} mu_s + {fitted.force.velocity_n_s_per_m / 6e4:.4f} v (N, mm/min).",
    )


def table_of_equations(shots: int) -> Table:
    rng = np.random.default_rng(34)
    tap = TapInput(0.1, MASS_KG, halts_at_separation=True)
    predictors = calibrate(PLANT, tap, [MASS_KG], np.linspace(0.05, 0.1, 17), FRICTIONS)
    model = Model("reference", PLANT, PRIOR, predictors)
    rows: list[tuple[float, ...]] = []
    pulls: list[tuple[float, ...]] = []
    for _ in range(shots):
        ratio = RATIO * (1.0 + 0.03 * rng.standard_normal())
        truth = Truth(rng.uniform(0.05, 0.1), rng.uniform(0.15, 0.25), ratio)
        friction = estimate(shot(truth, rng), model)
        coefficients = (friction.by_force, friction.by_distance, friction.combined, friction.mu_s)
        rows.append(tuple(abs(coefficient.value / truth.mu_s - 1.0) for coefficient in coefficients))
        pulls.append(
            tuple(
                abs(coefficient.value - truth.mu_s) < 1.96 * coefficient.std for coefficient in coefficients
            )
        )
    errors, inside = 100.0 * np.array(rows), 100.0 * np.array(pulls)
    names = ("peak force (4)", "sliding distance (5)", "combined (6)", "waveform")
    return Table(
        "Mean error of mu_s with sensor noise and 3 % scatter of mu_k/mu_s, v >= 3000 mm/min",
        ("predictor", "bar", "mean error", "interval (95 %)", "95th percentile", "within 1.96 std"),
        [
            (
                name,
                "3.6 %" if name.startswith("comb") else "",
                f"{errors[:, i].mean():.2f} %",
                f"± {1.96 * errors[:, i].std() / math.sqrt(shots):.2f} %",
                f"{np.percentile(errors[:, i], 95):.2f} %",
                f"{inside[:, i].mean():.0f} %",
            )
            for i, name in enumerate(names)
        ],
        f"{shots} shots of 18.9 kg, mu_s 0.15-0.25, 3000-6000 mm/min, 10 kHz, 0.4 N, 1.5 µm. The 3 % scatter "
        "of mu_k/mu_s alone is a mean error of 2.4 %: at these velocities a tap shows mu_k.",
    )


def table_of_velocities(shots_a_velocity: int) -> Table:
    """Error of each predictor by velocity, down to where a tap shows mu_s itself."""
    rng = np.random.default_rng(35)
    tap = TapInput(0.1, MASS_KG, halts_at_separation=True)
    predictors = calibrate(PLANT, tap, [MASS_KG], np.linspace(2000 / 6e4, 0.1, 17), FRICTIONS)
    model = Model("reference", PLANT, PRIOR, predictors)
    rows = []
    for velocity in (2000, 3000, 4000, 5000, 6000):
        errors = []
        for _ in range(shots_a_velocity):
            ratio = RATIO * (1.0 + 0.03 * rng.standard_normal())
            truth = Truth(velocity / 6e4, rng.uniform(0.15, 0.25), ratio)
            friction = estimate(shot(truth, rng), model)
            coefficients = (friction.by_force, friction.by_distance, friction.combined, friction.mu_s)
            errors.append([abs(coefficient.value / truth.mu_s - 1.0) for coefficient in coefficients])
        mean = 100.0 * np.mean(errors, axis=0)
        half = 196.0 * np.std(errors, axis=0) / math.sqrt(shots_a_velocity)
        rows.append(
            (f"{velocity} mm/min", *(f"{m:.2f} ± {h:.2f} %" for m, h in zip(mean, half, strict=True)))
        )
    return Table(
        "Mean error of mu_s by velocity, with sensor noise and 3 % scatter of mu_k/mu_s",
        ("velocity", "peak force (4)", "sliding distance (5)", "combined (6)", "waveform"),
        rows,
        f"{shots_a_velocity} shots a velocity, 18.9 kg, mu_s 0.15-0.25, 10 kHz, 0.4 N, 1.5 µm; coefficients "
        "of (4) and (5) calibrated over 2000-6000 mm/min. ±: 95 % interval of the mean.",
    )


TOLD_WRONG = (
    "standard deviation of the error", "Good", "RMS error", "median std told", "within 1.96 std",
    "largest / std",
)  # fmt: skip
"""Columns of the two tables that follow."""


def table_of_what_was_told(shots: int) -> Table:
    """Mass, velocity or the force's scale off by a little, the same in no two taps."""

    def told(seen: Capture, wrong: str, factor: float) -> Capture:
        return replace(
            seen,
            mass_kg=seen.mass_kg * (factor if wrong == "mass" else 1.0),
            velocity_m_s=seen.velocity_m_s * (factor if wrong == "velocity" else 1.0),
            force=_scaled(seen.force, factor if wrong == "force" else 1.0),
        )

    rows = []
    for wrong, error in [
        ("nothing", 0.0),
        *((wrong, error) for wrong in ("mass", "velocity", "force") for error in (1e-3, 3e-3, 1e-2)),
    ]:
        what = "nothing wrong" if wrong == "nothing" else f"{wrong}, {100 * error:g} %"
        found = _errors(shots, 37, error, partial(told, wrong=wrong), with_open_onset, "mu_s")
        rows += [(f"{what}, {name}", *_of_good(of_shots, shots)) for name, of_shots in found.items()]
    return Table(
        "mu_s where mass, velocity or the scale of the force is told a little wrong",
        TOLD_WRONG,
        rows,
        f"{shots} shots a row at 100 kHz, 18.9 kg, mu_s 0.15-0.25, 2000-6000 mm/min, first contact anywhere "
        "within a step and fitted; waveform estimates with status Good. Cells take taps as measured.",
    )


def table_of_position_scale(shots: int) -> Table:
    """Scale of the position off by a little, the same in no two taps: mu_k follows it."""
    rows = []
    exact = partial(as_recorded, position_scale_std=0.0)
    for error in (0.0, 1e-3, 3e-3, 1e-2):
        found = _errors(
            shots,
            38,
            error,
            lambda seen, factor: replace(seen, position=_scaled(seen.position, factor)),
            exact,
            "mu_k",
        )
        rows += [(f"{100 * error:g} %, {name}", *_of_good(taps, shots)) for name, taps in found.items()]
    return Table(
        "mu_k where the scale of the position is told a little wrong",
        TOLD_WRONG,
        rows,
        f"{shots} shots a row, as above.",
    )


def _scaled(channel: Channel | None, factor: float) -> Channel:
    assert channel is not None
    return replace(channel, values=channel.values * factor)


def _errors(
    shots: int,
    seed: int,
    error: float,
    told: Callable[..., Capture],
    exact: Callable[[Capture], Capture],
    which: str,
) -> dict[str, list[tuple[float, float]]]:
    """Relative errors and standard deviations of a coefficient of taps that are told a little wrong.

    `told(seen, factor=...)` is what is told of a tap, `exact` how it is taken where that counts as exact.
    """
    model = Model("reference", PLANT, PRIOR, ())
    rng = np.random.default_rng(seed)
    found: dict[str, list[tuple[float, float]]] = {"as measured": [], "taken as exact": []}
    for _ in range(shots):
        ratio = RATIO * (1.0 + 0.03 * rng.standard_normal())
        truth = Truth(rng.uniform(2000, 6000) / 6e4, rng.uniform(0.15, 0.25), ratio)
        seen = shot(truth, rng, force_hz=100e3, late_s=1e-5 * rng.uniform())
        seen = told(seen, factor=1.0 + error * rng.standard_normal())
        for name, given in (("as measured", as_recorded(seen)), ("taken as exact", exact(seen))):
            got = getattr(estimate(given, model), which)
            if got.quality is Quality.GOOD:
                true = getattr(truth, which)
                found[name].append((got.value / true - 1.0, got.std / true))
    return found


def _of_good(of_shots: list[tuple[float, float]], shots: int) -> tuple[str, ...]:
    """Columns on errors and standard deviations of estimates with status Good."""
    if not of_shots:
        return (f"0 of {shots}", "-", "-", "-", "-")
    errors, stds = np.array(of_shots).T
    return (
        f"{len(errors)} of {shots}",
        f"{100 * np.sqrt(np.mean(errors**2)):.2f} %",
        f"{100 * np.median(stds):.2f} %",
        f"{100 * np.mean(np.abs(errors) < 1.96 * stds):.0f} %",
        f"{np.max(np.abs(errors) / stds):.1f}",
    )


def table_of_contact(shots: int) -> Table:
    """Contact anywhere within a sampling step of force before t = 0: as cells take it, and taken at t = 0."""
    model = Model("reference", PLANT, PRIOR, ())
    rows = []
    for rate_hz in (10e3, 100e3, 1e6):
        rng = np.random.default_rng(36)
        found: dict[str, list[tuple[float, float]]] = {"fitted": [], "taken at t = 0": []}
        for _ in range(shots):
            ratio = RATIO * (1.0 + 0.03 * rng.standard_normal())
            truth = Truth(rng.uniform(2000, 6000) / 6e4, rng.uniform(0.15, 0.25), ratio)
            capture = shot(truth, rng, force_hz=rate_hz, late_s=rng.uniform() / rate_hz)
            for name, given in (("fitted", as_recorded(capture)), ("taken at t = 0", capture)):
                mu_s = estimate(given, model).mu_s
                if mu_s.quality is Quality.GOOD:
                    found[name].append((mu_s.value / truth.mu_s - 1.0, mu_s.std / truth.mu_s))
        rows += [
            (f"{1e-3 * rate_hz:g} kHz, {name}", *_of_good(of_shots, shots))
            for name, of_shots in found.items()
        ]
    return Table(
        "mu_s where contact lies anywhere within a sampling step of force before t = 0",
        ("force, contact", "Good", "RMS error", "median std told", "within 1.96 std", "largest / std"),
        rows,
        f"{shots} shots a rate, 18.9 kg, mu_s 0.15-0.25, 2000-6000 mm/min, 0.4 N, 1.5 µm, positions at "
        "10 kHz; waveform estimates with status Good. Cells fit contact.",
    )


def averaged_bound(of_shots: list[tuple[float, np.ndarray]], groups: int) -> np.ndarray:
    """Mean over groups of like mu_k of the inverse of the group's mean information, prior included."""
    ordered = np.array([matrix for _, matrix in sorted(of_shots, key=lambda pair: pair[0])])
    inverses = [
        len(group) * np.linalg.inv(group.mean(axis=0) + PRIOR_INFORMATION)
        for group in np.array_split(ordered, groups)
    ]
    return np.sum(inverses, axis=0) / len(ordered)


def table_of_waveform(shots_a_velocity: int) -> list[Table]:
    rng = np.random.default_rng(3)
    model = Model("reference", PLANT, PRIOR)
    squares: dict[str, list[list[float]]] = {name: [] for name in OF}
    bounds: dict[str, list[list[float]]] = {name: [] for name in OF}
    loose: dict[str, list[list[float]]] = {name: [] for name in OF}
    inside: dict[str, list[bool]] = {name: [] for name in OF}
    ready: dict[str, list[bool]] = {name: [] for name in OF}
    for velocity in VELOCITIES_MM_PER_MIN:
        errors: dict[str, list[float]] = {name: [] for name in OF}
        variances: dict[str, list[float]] = {name: [] for name in OF}
        of_shots: list[tuple[float, np.ndarray]] = []
        for _ in range(shots_a_velocity):
            truth = Truth(
                velocity / 6e4,
                rng.uniform(0.15, 0.25),
                RATIO * math.exp(0.03 * rng.standard_normal()),
                K * math.exp(0.01 * rng.standard_normal()),
                B * math.exp(0.02 * rng.standard_normal()),
            )
            waveform = fit(extract(shot(truth, rng)), model)
            matrix = information(truth)
            of_shots.append((truth.mu_k, matrix))
            covariance = np.linalg.inv(matrix + PRIOR_INFORMATION)
            intervals = dict(zip(("mu_s", "mu_k"), friction_intervals(waveform), strict=True))
            for name, of in OF.items():
                value, true = getattr(waveform, name), getattr(truth, name)
                errors[name].append(math.log(value / true) ** 2)
                variances[name].append(float(of @ covariance @ of))
                inside[name].append(intervals[name][0] <= true <= intervals[name][1])
                ready[name].append(abs(value - true) <= 1.96 * getattr(waveform, name + "_std"))
        averaged = [averaged_bound(of_shots, groups) for groups in (max(shots_a_velocity // 10, 1), 1)]
        for name, of in OF.items():
            squares[name].append(errors[name])
            bounds[name].append(variances[name])
            loose[name].append([float(of @ covariance @ of) for covariance in averaged])
        print(f"  waveform at {velocity} mm/min", file=sys.stderr, flush=True)
    rows = []
    for name in OF:
        error, bound = np.array(squares[name]), np.array(bounds[name])
        for velocity, e, own_bound, looser in zip(
            [*map(str, VELOCITIES_MM_PER_MIN), "all"],
            [*error, error.ravel()],
            [*bound, bound.ravel()],
            [*loose[name], np.mean(loose[name], axis=0).tolist()],
            strict=True,
        ):
            ratio = math.sqrt(e.mean() / own_bound.mean())
            half = ratio * 1.96 * e.std() / e.mean() / 2.0 / math.sqrt(len(e))
            rows.append(
                (
                    f"{name}, {velocity} mm/min", "1.2", f"{ratio:.3f}", f"± {half:.3f}",
                    f"{100 * math.sqrt(e.mean()):.3g} %", f"{100 * math.sqrt(own_bound.mean()):.3g} %",
                    *(f"{math.sqrt(e.mean() / other):.2f}" for other in looser),
                )
            )  # fmt: skip
    count = shots_a_velocity * len(VELOCITIES_MM_PER_MIN)
    against_bound = Table(
        "Waveform estimate against the Bayesian Cramér-Rao bound",
        ("what", "bar", "RMSE / bound", "interval", "RMSE", "bound", "RMSE / (b)", "RMSE / (c)"),
        rows,
        f"{shots_a_velocity} shots a velocity, 18.9 kg, mu_s 0.15-0.25; mu_k/mu_s, k and b drawn from the "
        "priors of the estimator (3, 1, 2 %). Bound: inverse of the Fisher information (differences of the "
        "simulator's plant) plus prior information, of each shot, then averaged: not a strict bound, ratios "
        "a little below 1 occur. (b) averages the information over shots of like mu_k before inverting, (c) "
        "over all shots of a velocity (van Trees): strict, but loose where shots that show mu_s well and "
        "shots that do not are mixed.",
    )
    coverage = Table(
        "Coverage of the waveform's 95 % intervals",
        ("what", "bar", "credible interval", "value ± 1.96 std", "interval"),
        [
            (
                name, "92-97 %",
                f"{100 * np.mean(inside[name]):.1f} %", f"{100 * np.mean(ready[name]):.1f} %",
                f"± {196 * math.sqrt(0.95 * 0.05 / count):.1f} %",
            )
            for name in OF
        ],
        f"The same {count} shots; every fit converged.",
    )  # fmt: skip
    return [against_bound, coverage]


def table_of_fixed_ratio(shots: int) -> Table:
    rng = np.random.default_rng(33)
    model = Model("reference", PLANT, replace(PRIOR, ratio_std=1e-6))
    errors = []
    for _ in range(shots):
        truth = Truth(
            rng.uniform(2000, 6000) / 6e4,
            rng.uniform(0.15, 0.25),
            RATIO,
            K * math.exp(0.01 * rng.standard_normal()),
            B * math.exp(0.02 * rng.standard_normal()),
        )
        errors.append(abs(fit(extract(shot(truth, rng)), model).mu_s / truth.mu_s - 1.0))
    return Table(
        "Waveform with mu_k/mu_s fixed, as in the paper",
        ("what", "bar", "measured", "largest"),
        [("mean error of mu_s", "0.3 %", f"{100 * np.mean(errors):.4f} %", f"{100 * max(errors):.3f} %")],
        f"{shots} shots, 2000-6000 mm/min, k and b drawn from their priors.",
    )


def table_of_time(repeats: int) -> Table:
    rng = np.random.default_rng(5)
    rows = []
    model = Model("reference", PLANT, PRIOR)
    for velocity in (2000, 4500, 6000):
        truth = Truth(velocity / 6e4, 0.2, RATIO)
        moved = motion(truth)
        capture = shot(truth, rng, 20_000 / (moved.separation_s + 2e-3), 4_000 / (moved.stop_s + 2e-2))
        assert capture.force is not None
        assert capture.position is not None
        sizes = f"{len(capture.force.values)} + {len(capture.position.values)}"
        fit(extract(capture), model)
        took, whole = [], []
        for _ in range(repeats):
            start, cpu = time.perf_counter(), time.process_time()
            fit(extract(capture), model)
            took.append(time.process_time() - cpu)
            whole.append(time.perf_counter() - start)
        rows.append(
            (
                f"{velocity} mm/min, {sizes} samples", "5 ms", f"{1e3 * np.median(took):.2f} ms",
                f"{1e3 * min(took):.2f} ms", f"{1e3 * np.median(whole):.2f} ms",
            )
        )  # fmt: skip
    return Table(
        "Waveform estimate of one capture on one core",
        ("capture", "bar", "median", "least", "median, wall clock"),
        rows,
        f"Force and position samples; processor time of {repeats} runs: reading the slide, fitting on both "
        "sides of the kink where it is near (4500 mm/min), and the gap of all samples included.",
    )


def table_of_viscous_friction(campaigns: int) -> Table:
    rng = np.random.default_rng(10)
    errors: dict[str, list[float]] = {"least squares": [], "decrement": []}
    stds: dict[str, list[float]] = {"least squares": [], "decrement": []}
    for _ in range(campaigns):
        captures = [
            shot(Truth(velocity / 6e4, 0.2 * (1.0 + 0.012 * rng.standard_normal()), RATIO), rng)
            for velocity in (3000, 4000, 5000, 6000)
            for _ in range(6)
        ]
        for name, method in (("least squares", by_least_squares), ("decrement", by_decrement)):
            regression = method(captures)
            errors[name].append(regression.coefficient_n_s_per_m - VISCOUS)
            stds[name].append(regression.std)
    return Table(
        "k_v together with mu_k over many shots",
        ("method", "mean error", "RMSE", "stated std", "of k_v"),
        [
            (
                name,
                f"{np.mean(error):+.3f} N s/m",
                f"{np.sqrt(np.mean(np.square(error))):.3f} N s/m",
                f"{np.mean(stds[name]):.3f} N s/m",
                f"{100 * np.sqrt(np.mean(np.square(error))) / VISCOUS:.2f} %",
            )
            for name, error in errors.items()
        ],
        f"{campaigns} campaigns of 24 shots, 3000-6000 mm/min, k_v = {VISCOUS:g} N s/m, friction scatter "
        "1.2 %. Decrement: from displacements over equal intervals, after the paper's reference [10].",
    )


def tables(quick: bool = False) -> list[Table]:
    return [
        table_of_coefficients(),
        table_of_equations(60 if quick else 400),
        table_of_velocities(20 if quick else 100),
        table_of_contact(30 if quick else 200),
        table_of_what_was_told(30 if quick else 200),
        table_of_position_scale(30 if quick else 200),
        *table_of_waveform(30 if quick else 200),
        table_of_fixed_ratio(40 if quick else 200),
        table_of_viscous_friction(5 if quick else 30),
        table_of_time(20 if quick else 100),
    ]
