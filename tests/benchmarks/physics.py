"""One tap: speed beside scipy, accuracy, the paper's coefficients, smoothness."""

import time
from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares

from impactcell.physics import Ensemble, Plant, TapInput, simulate_tap
from impactcell.physics.effects import LIBRARY
from tests.benchmarks._scipy_tap import K_V, MASS, RATIO, SAMPLES, B, K, scipy_tap
from tests.benchmarks.table import Table
from tests.modified_euler import simulate_modified_euler

COLUMNS = ("what", "bar", "measured", "interval")
MM_PER_MIN = 1.0 / 60000.0
METHODS = ("RK45", "DOP853", "LSODA")  # of solve_ivp
ERRORS = (2e-5, 1e-9)  # of force and position, relative: RK45 has the one at rtol 1e-6, we have the other


def reference_plant(mu_s: float, ratio: float = RATIO) -> Plant:
    """Return the plant that reproduces the paper's coefficients."""
    viscous = {"viscous_friction": {"viscous_coefficient_n_s_per_m": K_V}}
    return Plant(K, B, mu_s, ratio * mu_s, effects=viscous)


def seconds(run: Callable[[], object], repeats: int) -> tuple[float, float, float]:
    """Least, 25 % and 75 % quantile of the time of one call."""
    taken = []
    for _ in range(repeats):
        begin = time.perf_counter()
        run()
        taken.append(time.perf_counter() - begin)
    return min(taken), float(np.quantile(taken, 0.25)), float(np.quantile(taken, 0.75))


def error(samples: np.ndarray, exact: np.ndarray) -> float:
    """Largest error of force and position samples, shape (2, n), each over the largest of its channel."""
    return float((np.abs(samples - exact).max(axis=1) / np.abs(exact).max(axis=1)).max())


def loosest_tolerance(method: str, speed_m_s: float, exact: np.ndarray, allowed: float) -> float:
    """Loosest rtol, in steps of half a decade, at which a method has no larger error than is allowed."""
    for exponent in np.arange(3.0, 13.0, 0.5):
        rtol = float(10.0**-exponent)
        if error(scipy_tap(0.2, speed_m_s, rtol, method=method)[2], exact) <= allowed:
            return rtol
    raise RuntimeError(f"{method} does not come to a relative error of {allowed:g}")


def speed(*, quick: bool) -> Table:
    """One tap with 1200 samples of force and position, beside scipy, in turns within one run."""
    v = 4500.0 * MM_PER_MIN
    tap, plant = TapInput(v, MASS, halts_at_separation=True), reference_plant(0.2)
    names, times = ["viscous_friction"], [SAMPLES]
    ensemble = Ensemble([tap], names, force_time_s=times, position_time_s=times)
    many = Ensemble([tap] * 60, names, force_time_s=times * 60, position_time_s=times * 60)
    theta = ensemble.parameters(plant)
    exact = scipy_tap(0.2, v, 1e-13, method="DOP853", max_step=1e-4)[2]
    public, alone, batch = (
        "`simulate_tap(...).sample(...)`, figures and all four channels",
        "one tap by `Ensemble.traces`",
        "a tap of 60 at once by `Ensemble.traces`",
    )
    runs: dict[str, tuple[Callable[[], object], int, int]] = {
        public: (lambda: simulate_tap(plant, tap).sample(SAMPLES), 20, 1),
        alone: (lambda: ensemble.traces(theta), 50, 1),
        batch: (lambda: many.traces(theta), 5, 60),
    }
    peers: dict[float, list[str]] = {allowed: [] for allowed in ERRORS}
    for allowed, names_of_peers in peers.items():
        for method in METHODS:
            rtol = loosest_tolerance(method, v, exact, allowed)
            name = f"solve_ivp with events, {method} at rtol {rtol:.0e}, error at most {allowed:g}"
            names_of_peers.append(name)
            runs[name] = (lambda m=method, r=rtol: scipy_tap(0.2, v, r, method=m), 3, 1)
    for run, _, _ in runs.values():
        run()
    rounds = 5 if quick else 20
    taken: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, (run, repeats, taps) in runs.items():
            taken[name].append(seconds(run, repeats)[0] / taps)

    def micro(name: str) -> tuple[str, str]:
        some = taken[name]
        return f"{np.median(some) * 1e6:.1f} µs", f"{min(some) * 1e6:.1f}-{max(some) * 1e6:.1f}"

    rows = []
    rows.extend((name, "", *micro(name)) for of_error in peers.values() for name in of_error)
    for name, bar in ((public, "20 x"), (alone, ""), (batch, "40 x")):
        rows.append((f"{name}: time", "", *micro(name)))
        for allowed, of_error in peers.items():
            best = min(of_error, key=lambda peer: float(np.median(taken[peer])))
            each = np.array(taken[best]) / np.array(taken[name])
            what = f"{name}: faster than the best solve_ivp with an error of {allowed:g}"
            rows.append((what, bar, f"{np.median(each):.1f} x", f"{each.min():.0f}-{each.max():.0f}"))
    traces, sampled = ensemble.traces(theta), simulate_tap(plant, tap).sample(SAMPLES)
    for name, force, position in (
        ("`Ensemble.traces`", traces.force_n, traces.position_m),
        ("`simulate_tap(...).sample(...)`", sampled.force_n, sampled.position_m),
    ):
        reached = error(np.vstack([np.ravel(force), np.ravel(position)]), exact)
        rows.append((f"error of {name}", f"{min(ERRORS):g}", f"{reached:.1e}", ""))
    return Table(
        "One tap, 1200 samples of force and of position",
        COLUMNS,
        rows,
        "18.9 kg, 4500 mm/min, mu_s 0.2, reference plant; least of repeats in each of "
        f"{rounds} rounds in which all take turns, median and range over the rounds. Each solve_ivp "
        "has the loosest rtol, in half decades, with errors of force and position no larger than said, over "
        "their largest; the fastest is the peer. Errors are against DOP853 at rtol 1e-13 in steps of 0.1 ms.",
    )


def coefficients(*, quick: bool) -> Table:
    """Fit the forms of (4) and (5) to the reference plant as the paper fitted them to its own model."""
    rows = []
    for low, high, plant in (
        (3000.0, 6000.0, (6.5e5, 465.0, 0.76, 85.0)),
        (2000.0, 6000.0, (7.0e5, 625.0, 0.70, 97.0)),
    ):
        mu, v = np.meshgrid(
            np.linspace(0.15, 0.25, 6 if quick else 11), np.linspace(low, high, 7 if quick else 13)
        )
        mu, v = mu.ravel(), v.ravel()
        taps = [TapInput(one * MM_PER_MIN, MASS, halts_at_separation=True) for one in v]
        ensemble = Ensemble(taps, ["viscous_friction"])
        k, b, ratio, k_v = plant
        theta = np.column_stack(
            [np.full(mu.size, k), np.full(mu.size, b), mu, ratio * mu, np.full(mu.size, k_v)]
        )
        figures = ensemble.outputs(theta)
        force, distance = figures.peak_force_n, figures.sliding_distance_m * 1e6
        printed_force = 146.2 * mu + 0.0529 * v
        printed_distance = 0.00041 * v**1.8997 + 0.07379 * v**1.6428 * (0.3415 - mu) ** 2
        linear = np.linalg.lstsq(np.column_stack([mu, v]), force, rcond=None)[0]

        def form(c: np.ndarray, mu: np.ndarray = mu, v: np.ndarray = v) -> np.ndarray:
            u = v / 4000.0
            return c[0] * u ** c[1] + c[2] * u ** c[3] * (c[4] - mu) ** 2

        start = np.array([0.00041 * 4000.0**1.8997, 1.8997, 0.07379 * 4000.0**1.6428, 1.6428, 0.3415])
        fitted = least_squares(
            lambda c, form=form, distance=distance: form(c) / distance - 1.0, start, x_scale=np.abs(start)
        ).x
        own_force = linear[0] * mu + linear[1] * v
        span = f"{low:.0f}-{high:.0f} mm/min"
        bars = ("0.6 %", "2 %") if low == 3000.0 else ("", "")
        for name, bar, curve, printed, data, made in (
            (
                "F_p",
                bars[0],
                own_force,
                printed_force,
                force,
                f"F_p = {linear[0]:.1f} mu + {linear[1]:.4f} v",
            ),
            (
                "d",
                bars[1],
                form(fitted),
                printed_distance,
                distance,
                (
                    f"d = {fitted[0] / 4000.0 ** fitted[1]:.3g} v^{fitted[1]:.4f} + "
                    f"{fitted[2] / 4000.0 ** fitted[3]:.3g} v^{fitted[3]:.4f} ({fitted[4]:.4f} - mu)²"
                ),
            ),
        ):
            for what, some in (("refitted curve", curve), ("plant itself", data)):
                miss = np.abs(some / printed - 1.0) * 100.0
                rows.append(
                    (
                        f"{name}, {what} against the printed one, {span}",
                        bar,
                        f"{miss.max():.2f} % at most",
                        f"mean {miss.mean():.2f} %",
                    )
                )
            rows.append(
                (f"{name} refitted, {span}", "", made, f"form fits to {np.abs(curve / data - 1.0).max():.2%}")
            )
    return Table(
        "Coefficients of (4) and (5) from the reference plant against the printed ones, mu_s 0.15-0.25",
        COLUMNS,
        rows,
        "v in mm/min, F_p in N, d in µm, 18.9 kg. Both plants are own fits to the printed curves, "
        "not the paper's.",
    )


def smoothness(*, quick: bool) -> Table:
    """Finite differences of a least-squares objective, at ever smaller steps, against Richardson's limit."""
    velocities = (2000.0, 4000.0) if quick else (1500.0, 2000.0, 3000.0, 4000.0, 6000.0)
    taps = [
        TapInput(v * MM_PER_MIN, m, 1.5e-3, direction=d)
        for v in velocities
        for m in (12.6, 18.9, 25.2)
        for d in (1, -1)
    ]
    times = [SAMPLES + 1.7e-5] * len(taps)
    identifiers = (
        "viscous_friction",
        "stribeck_friction",
        "actuator_droop",
        "force_sensor_lag",
        "channel_skew",
    )
    ensemble = Ensemble(taps, identifiers, force_time_s=times, position_time_s=times)
    typical = {name: {p.name: p.typical for p in LIBRARY[name].parameters} for name in identifiers}
    theta = ensemble.parameters(Plant(K, B, 0.2, 0.152, effects=typical))
    target = ensemble.traces(1.02 * theta)

    def objective(parameters: np.ndarray) -> float:
        made = ensemble.traces(parameters)
        force = np.sum(((made.force_n - target.force_n) / 0.4) ** 2)
        return float(force + np.sum(((made.position_m - target.position_m) / 1.5e-6) ** 2))

    def gradient(j: int, step: float) -> float:
        above, below = theta.copy(), theta.copy()
        above[j] *= 1.0 + step
        below[j] *= 1.0 - step
        return (objective(above) - objective(below)) / (2.0 * step)

    table = np.array([[gradient(j, step) for step in (1e-4, 1e-5, 1e-6)] for j in range(theta.size)])
    # All in proportion to the largest derivative: one that nearly vanishes has no relative accuracy.
    scale = np.abs(table[:, 1]).max()
    own = np.abs(table[:, 1])
    rows = []
    for place, step in ((0, "1e-4"), (2, "1e-6")):
        miss = np.abs(table[:, place] - table[:, 1])
        worst = int(np.argmax(miss / own))
        rows.append(
            (
                f"gradient at relative steps {step} against 1e-5",
                "converges",
                f"{(miss / scale).max():.1e} of the largest",
                f"{(miss / own)[worst]:.1e} of its own at most ({ensemble.names[worst]})",
            )
        )
    line = np.linspace(-5e-6, 5e-6, 41)
    values = np.array([objective(theta * np.where(np.arange(theta.size) == 0, 1.0 + s, 1.0)) for s in line])
    left = values - np.polynomial.Polynomial.fit(line, values, 3)(line)
    rows.append(
        (
            "noise of the objective along k, relative",
            "",
            f"{np.abs(left).max() / values.mean():.1e}",
            "41 points within 5e-6, about a cubic",
        )
    )
    return Table(
        "Smoothness of the objective",
        COLUMNS,
        rows,
        f"{len(taps)} taps, 1200 samples of force (0.4 N) and position (1.5 µm), {theta.size} parameters, "
        "five effects at their typical strength; the target is 2 % off in all.",
    )


def modified_euler() -> Table:
    """The paper's scheme at its step and finer ones."""
    tap = TapInput(4500.0 * MM_PER_MIN, MASS, halts_at_separation=True)
    exact = simulate_tap(reference_plant(0.2), tap)
    rows = []
    for step in (1e-4, 1e-5, 1e-6):
        grid = simulate_modified_euler(reference_plant(0.2), tap, step)
        rows.append(
            (
                f"modified Euler, step {step:g} s",
                "",
                f"F_p {abs(grid.peak_force_n / exact.peak_force_n - 1.0):.1e}",
                f"d {abs(grid.sliding_distance_m / exact.sliding_distance_m - 1.0):.1e}",
            )
        )
    return Table("The paper's scheme against located events, relative errors", COLUMNS, rows)


def tables(*, quick: bool = False) -> list[Table]:
    """Every table of this topic."""
    return [
        speed(quick=quick),
        coefficients(quick=quick),
        smoothness(quick=quick),
        modified_euler(),
    ]
