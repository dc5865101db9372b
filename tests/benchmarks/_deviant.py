"""Deviant cycles: false alarms, and the power beside the oracle's and the best possible."""

import math
from dataclasses import replace

import numpy as np
from scipy.stats import chi2, norm
from scipy.stats import f as f_distribution

from impactcell.features import extract, required
from impactcell.tracking.signature import deviation_shapes, deviation_test, friction_profile, tracker
from impactcell.tracking.signature import reference as references
from tests.benchmarks._slides import FRICTION, GRAVITY, slide
from tests.benchmarks.table import Table

NOISE = 0.42e-6
SPEED = 0.09
RATE = 1e4


def _normal(rng: np.random.Generator):
    """A normal cycle: texture, and level, tilt and curvature that vary from cycle to cycle."""
    a, b, c = 0.005 * rng.normal(size=3) * (2.0, 1.0, 1.0)

    def friction(x):
        shape = a + b * (x / 1e-3 - 1.0) + c * np.cos(np.pi * x / 2e-3)
        return FRICTION * (1.0 + 0.03 * np.sin(2.0 * np.pi * x / 1.3e-3) + shape)

    return friction


MODES = (
    lambda x: 0.01 * np.ones_like(x),
    lambda x: 0.005 * (x / 1e-3 - 1.0),
    lambda x: 0.005 * np.cos(np.pi * x / 2e-3),
)
LEARNED = (50, 100, 400, 2000)
SPEEDS, MIXED, LEVELS = (0.05, 0.0667, 0.0833, 0.1), 150, (1e-2, 1e-3, 1e-4, 1e-5)
ORACLE = (0.5, 0.8, 0.9, 0.95, 0.99)


def _bump(rng: np.random.Generator):
    place, width = rng.uniform(0.2e-3, 1.85e-3), np.exp(rng.uniform(math.log(0.2e-3), math.log(0.6e-3)))
    return (lambda x: np.exp(-0.5 * ((x - place) / width) ** 2)), place


def _ripple(rng: np.random.Generator):
    wave, phase = np.exp(rng.uniform(math.log(0.5e-3), math.log(1.5e-3))), rng.uniform(0.0, 2.0 * math.pi)
    return (lambda x: np.sin(2.0 * np.pi * x / wave + phase)), math.nan


DEVIATIONS = {
    "bump": _bump,
    "level": lambda _: (np.ones_like, math.nan),
    "tilt": lambda _: (lambda x: x / 1e-3 - 1.0, math.nan),
    "ripple": _ripple,
}


class Normality:
    """How normal cycles truly vary, as information on the spline coefficients of one typical slide."""

    def __init__(self, settings: tracker.SignatureSettings) -> None:
        self.grid = settings.grid_m
        self.to_coefficients = np.linalg.pinv(friction_profile.on_grid(settings.points))
        capture, _ = slide(_normal(np.random.default_rng([8, 0])), SPEED, RATE, NOISE, 0)
        self.seen = friction_profile.information(required(extract(capture).segment), self.grid, GRAVITY)
        G = self.G = self.seen.matrix
        self.C = self.to_coefficients @ (FRICTION * np.array([m(self.grid) for m in MODES]).T)
        texture = FRICTION * (1.0 + 0.03 * np.sin(2.0 * np.pi * self.grid / 1.3e-3))
        self.mean = self.to_coefficients @ texture
        values, vectors = np.linalg.eigh(G)
        self.root = vectors * np.sqrt(np.maximum(values, 0.0))
        self.covariance = G + G @ self.C @ self.C.T @ G
        inner = np.eye(3) + self.C.T @ G @ self.C
        self.P = G - G @ self.C @ np.linalg.solve(inner, self.C.T @ G)

    def vectors(self, rng: np.random.Generator, n: int) -> np.ndarray:
        """Draw h - G m of normal cycles, shape (n, j)."""
        noise = rng.normal(size=(n, len(self.G))) @ self.root.T
        return noise + rng.normal(size=(n, 3)) @ (self.G @ self.C).T

    def score(self, shape, G: np.ndarray) -> float:
        """Oracle's mean score for a shape of the size of the friction itself in a slide of information G."""
        s = self.to_coefficients @ (FRICTION * shape(self.grid))
        image = G @ s
        along = self.C.T @ image
        return math.sqrt(s @ image - along @ np.linalg.solve(np.eye(3) + self.C.T @ G @ self.C, along))

    def whitened(self, shape) -> np.ndarray:
        """Direction of a shape where normal cycles are white, of unit length."""
        values, vectors = np.linalg.eigh(self.P)
        s = self.to_coefficients @ shape(self.grid)
        along = np.sqrt(np.maximum(values, 0.0)) * (vectors.T @ s)
        return along / np.linalg.norm(along)


def false_alarm_table(*, quick: bool) -> Table:
    """False alarms a cycle after so many learned cycles, by importance sampling.

    Drawn are cycles pushed along a shape that is looked for until its score is near the threshold, of all
    shapes alike and one in ten as it is; each counts with the ratio of the densities.
    """
    settings = tracker.SignatureSettings()
    truth = Normality(settings)
    draws, references_tried = (150, 2) if quick else (1000, 16)
    alpha, push = 1.0 / settings.false_alarm_cycles, 5.0
    rates_by_learned: dict[int, list[float]] = {n: [] for n in LEARNED}
    ordinary = judged = 0
    for trial in range(references_tried):
        rng = np.random.default_rng([11, trial])
        state = tracker.initial_state(settings)
        vectors = truth.vectors(rng, LEARNED[-1] + 10) + truth.G @ truth.mean
        for vector in vectors:
            reference = state.reference
            if (
                reference.variation.cycles in rates_by_learned
                and len(rates_by_learned[reference.variation.cycles]) == trial
            ):
                rates_by_learned[reference.variation.cycles].append(
                    _tail(truth, settings, reference, rng, draws, alpha, push)
                )
            information = replace(truth.seen, vector=vector)
            verdict = None
            if reference.variation.cycles >= settings.learned_cycles:
                verdict = deviation_test.test_deviation(reference, information, truth.grid)
                ordinary += verdict.p_value < 100.0 * alpha
                judged += 1
            # never given up: what is falsely thought deviant is learned all the same
            state = tracker.update_reference(
                state, information, settings, verdict and replace(verdict, p_value=1.0)
            )
    rows = []
    for n, rates in rates_by_learned.items():
        error = 1.96 * np.std(rates) / math.sqrt(len(rates))
        worst = max(rates)
        rows.append(
            [f"after {n} cycles", "<= 1e-5", f"{np.mean(rates):.1e}", f"± {error:.1e}", f"{worst:.1e}"]
        )
    rows.append(
        ["all cycles, at a hundred times the level", "<= 1e-3", f"{ordinary / judged:.1e}", f"{judged}", ""]
    )
    note = (
        f"{references_tried} references learned from scratch, {draws} weighted cycles each; the last "
        "row is plain counting. Information on the friction drawn at random, as one slide at 10 kHz gives it."
    )
    return Table("False alarms a cycle", ["what", "bar", "mean", "95 %", "worst reference"], rows, note)


def mixed_table(*, quick: bool) -> Table:
    """False alarms of real slides whose velocities come in turn, while cycles are still being learned."""
    settings = tracker.SignatureSettings()
    runs = 4 if quick else 40
    p_values: dict[float, list[float]] = {speed: [] for speed in SPEEDS}
    for run in range(runs):
        rng, state = np.random.default_rng([13, run]), tracker.initial_state(settings)
        for cycle in range(MIXED):
            speed = SPEEDS[cycle % len(SPEEDS)]
            capture, _ = slide(_normal(rng), speed, RATE, NOISE, run * MIXED + cycle)
            information = friction_profile.information(
                required(extract(capture).segment), settings.grid_m, GRAVITY
            )
            reference, verdict = state.reference, None
            if reference.variation.cycles >= settings.learned_cycles:
                verdict = deviation_test.test_deviation(reference, information, settings.grid_m)
                p_values[speed].append(verdict.p_value)
            state = tracker.update_reference(
                state, information, settings, verdict and replace(verdict, p_value=1.0)
            )
    rows = []
    for name, p in [(f"{speed:g} m/s", np.array(p_values[speed])) for speed in SPEEDS] + [
        ("all", np.concatenate(list(p_values.values())))
    ]:
        rows.append([name, f"{len(p)}", *(f"{np.mean(p < level):.1e}" for level in LEVELS)])
    return Table(
        "False alarms a cycle where velocities come in turn",
        ["velocity", "cycles judged", *(f"below {level:g}" for level in LEVELS)],
        rows,
        f"{runs} references learned from {MIXED} slides each, which end at different places and tell "
        "differently much; plain counting, so that the columns are to be at most their own headings.",
    )


def _tail(
    truth: Normality,
    settings: tracker.SignatureSettings,
    reference: references.Reference,
    rng: np.random.Generator,
    draws: int,
    alpha: float,
    push: float,
) -> float:
    j = len(truth.G)
    shapes = deviation_shapes.deviation_shapes(settings.length_m, settings.points)
    rows, _, waves = shapes.within(truth.seen.reached_m, j)
    first = len(rows) - 2 - 2 * waves
    cosines, sines = (rows[first + k : len(rows) - 2 : 2] for k in (0, 1))
    rows = np.vstack([rows, cosines + sines, cosines - sines])
    # the test's own filters, from y = h - G m to scores
    mean_covariance = np.linalg.solve(
        truth.G + references.precision(reference.matrix, reference.strength), np.eye(j)
    )
    first = np.eye(j) - truth.G @ mean_covariance
    image = first @ truth.G @ reference.components
    inner = np.eye(image.shape[1]) + reference.components.T @ image
    filters = rows @ (np.eye(j) - image @ np.linalg.solve(inner, reference.components.T)) @ first
    varies = np.einsum("ij,jk,ik->i", filters, truth.covariance, filters)
    least = 30.0 / (0.5 * FRICTION) ** 2
    use = np.einsum("ij,jk,ik->i", rows, truth.P, rows) > least
    filters = filters[use] / np.sqrt(varies[use])[:, np.newaxis]
    y = truth.vectors(rng, draws)
    picked, sign = rng.integers(len(filters), size=draws), rng.choice([-1.0, 1.0], draws)
    sign[: draws // 10] = 0.0
    y += (push * sign)[:, np.newaxis] * (filters[picked] @ truth.covariance)
    ratio = 0.1 + 0.9 * (np.cosh(push * (y @ filters.T)) * math.exp(-(push**2) / 2.0)).mean(axis=1)
    alarms = [
        deviation_test.test_deviation(reference, replace(truth.seen, vector=v), truth.grid).p_value < alpha
        for v in y + truth.G @ truth.mean
    ]
    return float(np.mean(np.array(alarms) / ratio))


def _limits(truth: Normality, alpha: float) -> dict[str, dict[float, float]]:
    """Power of the best test that does not know which of the shapes it is, nor its sign, by oracle's power.

    It averages the likelihood ratio over all of them (Neyman-Pearson), knows amplitude, variation and mean.
    Drawn from that average, the density under normality is one over the ratio: size and power from one run.
    """
    rng = np.random.default_rng(12)
    each = 300
    names = [name for name in DEVIATIONS for _ in range(each)]
    directions = np.array([truth.whitened(DEVIATIONS[name](rng)[0]) for name in names])
    powers: dict[str, dict[float, float]] = {name: {} for name in DEVIATIONS}
    for oracle in ORACLE:
        delta = norm.isf(alpha) + norm.ppf(oracle)
        picked = np.tile(np.arange(len(names)), 40)
        w = rng.normal(size=(len(picked), directions.shape[1])) + delta * directions[picked]
        ratio = np.cosh(delta * (w @ directions.T)).mean(axis=1) * math.exp(-(delta**2) / 2.0)
        order = np.argsort(ratio)[::-1]
        size = np.cumsum(1.0 / ratio[order]) / len(ratio)
        threshold = ratio[order][int(np.searchsorted(size, alpha))]
        for name in DEVIATIONS:
            of_shape = np.array(names)[picked] == name
            powers[name][oracle] = float((ratio[of_shape] > threshold).mean())
    return powers


def power_table(*, quick: bool) -> Table:
    """Power at one false alarm in 100000 cycles beside the oracle's and the plain statistics'."""
    settings = tracker.SignatureSettings()
    truth = Normality(settings)
    alpha = 1.0 / settings.false_alarm_cycles
    state = tracker.initial_state(settings)
    learned = 150 if quick else LEARNED[-1]
    runs = 40 if quick else 200
    false = judged = 0
    young = state
    for k in range(learned):
        rng = np.random.default_rng([8, k])
        capture, _ = slide(_normal(rng), SPEED, RATE, NOISE, k)
        outcome = tracker.update(settings, state, extract(capture))
        false += outcome.deviation is not None
        judged += outcome.judged
        state = outcome.state
        young = state if k < LEARNED[2] else young
    limits = _limits(truth, alpha)
    rows = [["false alarms while learning", "", f"{false} of {judged}", *[""] * 8]]
    for name, make in DEVIATIONS.items():
        ours, early, plain, off, power = ({oracle: [] for oracle in ORACLE} for _ in range(5))
        amplitudes = []
        for k in range(runs):
            rng = np.random.default_rng([9, k])
            base, sign = _normal(rng), rng.choice([-1.0, 1.0])
            shape, place = make(rng)
            for oracle in ORACLE:
                aim = norm.isf(alpha) + norm.ppf(oracle)
                size = aim / truth.score(shape, truth.G)
                # as large as the oracle needs it in this very slide, whose length the deviation changes
                size = aim / truth.score(shape, _deviant(truth, base, size * sign, shape, 5000 + k).matrix)
                information = _deviant(truth, base, size * sign, shape, 5000 + k)
                power[oracle].append(norm.sf(norm.isf(alpha) - size * truth.score(shape, information.matrix)))
                verdict = deviation_test.test_deviation(state.reference, information, truth.grid)
                ours[oracle].append(verdict.p_value < alpha)
                if verdict.p_value < alpha:
                    off[oracle].append(abs(verdict.at_m - place))
                plain[oracle].append(_plain(verdict, state.reference.variation.cycles) < alpha)
                verdict = deviation_test.test_deviation(young.reference, information, truth.grid)
                early[oracle].append(verdict.p_value < alpha)
            amplitudes.append(100.0 * size)
        for kind, hits, bar in (
            ("", ours, "<= 0.1"),
            (f", {LEARNED[2]} cycles learned", early, ""),
            (", T² and SPE only", plain, ""),
            (", best possible", limits[name], ""),
        ):
            against = {o: o if hits is limits[name] else float(np.mean(power[o])) for o in ORACLE}
            shortfall = [against[oracle] - float(np.mean(hits[oracle])) for oracle in ORACLE]
            about = ""
            if not kind:
                about = f"{np.median(amplitudes):.1f} %"
                if name == "bump":
                    about += f"; placed within {1e3 * np.sqrt(np.mean(np.square(off[0.99]))):.2f} mm rms"
            interval = (
                f"± {1.96 * math.sqrt(np.var(hits[ORACLE[-1]]) / runs):.2f}" if kind[2:3] != "b" else ""
            )
            cells = [f"{v:+.2f}" for v in shortfall]
            rows.append(
                [
                    name + kind,
                    bar,
                    cells[-1],
                    interval,
                    *cells[:-1],
                    f"{np.mean(shortfall):+.2f}",
                    f"{max(shortfall):+.2f}",
                    about,
                ]
            )
    columns = ["oracle's power minus ours", "bar", "oracle at 0.99", "95 %"]
    columns += [f"at {o:g}" for o in ORACLE[:-1]] + ["mean", "worst", "median amplitude at 0.99"]
    note = (
        f"Reference of {learned} cycles, {runs} deviant cycles each. The oracle knows shape, place, width, "
        "phase and sign of the deviation, the mean, and how cycles vary (level, tilt and half a cosine of 1, "
        "0.5 and 0.5 % sd). The deviation is as large as gives it its power in that very slide, and its "
        "power is the exact one in the slides judged. Bumps lie anywhere from 0.2 to 1.85 mm, 0.2 to "
        "0.6 mm wide (one sd), ripples of 0.5 to 1.5 mm at any phase. Best possible: the averaged likelihood "
        "ratio over the four families, knowing all but family, place, width, phase and sign: no test with as "
        "few false alarms finds more on average."
    )
    return Table("Deviant cycle at 1e-5 false alarms", columns, rows, note)


def _deviant(truth: Normality, base, size: float, shape, seed: int) -> friction_profile.SplineInformation:
    """What one slide says over friction that deviates by a shape, in shares of the friction."""

    def friction(x):
        return base(x) + size * FRICTION * shape(np.asarray(x))

    capture, _ = slide(friction, SPEED, RATE, NOISE, seed)
    return friction_profile.information(required(extract(capture).segment), truth.grid, GRAVITY)


def _plain(verdict: deviation_test.DeviationTest, cycles: int) -> float:
    """p-value of Hotelling's T^2 and SPE alone, half of the false alarms each."""
    k = deviation_test.COMPONENTS
    hotelling = f_distribution.sf(verdict.t_squared * (cycles - k) / (k * (cycles - 1.0)), k, cycles - k)
    return 2.0 * min(hotelling, chi2.sf(verdict.spe, max(verdict.spe_freedom, 1)))
