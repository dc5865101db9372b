"""Laws by others, from what the nominal model leaves: a Gaussian process, PySINDy and pyoperon.

All three get the same rows, smoothed and differentiated by PySINDy from the training shots: in the free slide
m a + mu_k m g over place, speed, direction and mass; in contact
F - k d - b max(d', 0) over indentation and its rate. What they make of them enters the equations of motion as
two tables, then the plant is fitted anew beside them, and held-out shots are judged as those of a law are.

- `gaussian_process`: scikit-learn, a squared exponential with a length for each input, and white noise.
- `sindy`: polynomials to the third degree, waves, bumps and Stribeck terms, each of force and of friction,
  each with and without direction; sequential thresholding with a ridge, both by cross-validation over shots.
- `operon`: genetic programming with sums, products, quotients, exponentials, sines and roots; of what is best
  for its length the one with the shortest description.
"""

import math
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import product
from typing import Any

import numpy as np

from impactcell.discrepancy.data import shot_set
from impactcell.discrepancy.data.prepared_shots import FORCE
from impactcell.discrepancy.laws import LawFinding
from impactcell.discrepancy.model import (
    Constraints,
    Fit,
    Problem,
    fit,
    refit_shot_parameters,
)
from impactcell.discrepancy.model.initial_guess import fit_nominal
from impactcell.discrepancy.search import GapMeasure, Part
from impactcell.discrepancy.workflow import DiscrepancyResult
from impactcell.errors import DiscrepancyError
from impactcell.numerics.jit import FloatPointer, Law
from impactcell.physics.bspline import spline_basis
from impactcell.physics.effect import Effect, Kind, LawKind, Parameter, Phase
from impactcell.physics.effects import add_effect
from impactcell.records import Samples
from tests.benchmarks._discrepancy_sindy import fitted, smoothed_shots

G = 9.81
LEAST_SPEED = 0.1
"""Share of a slide's largest speed below which its rows are left out: smoothing takes the stop for a bend."""
MASSES_KG = (12.6, 18.9, 25.2)
"""Masses of a campaign's parts: what is found is tabled for each."""
PLACES, SPEEDS, DEPTHS = 64, 10, 20
"""Points of a table along the place, the speed, and along indentation and its rate."""
MOST_ROWS = 700
"""Rows that a Gaussian process is fitted to: its cost grows with their cube."""
OPERON_S = 30
"""Time that pyoperon has for the slide, and for the contact [s]."""
PERIODS_M = tuple(float(one) for one in np.geomspace(5e-4, 8e-3, 12))
BUMPS, BUMP_WIDTHS = 16, (1.0, 2.0)
STRIBECK = (0.05, 0.1, 0.2, 0.4)
"""Stribeck velocities as shares of the largest speed."""
THRESHOLDS = tuple(float(one) for one in np.geomspace(0.01, 1.0, 10))
FOLDS = 5
RIDGES = (1e-6, 1e-2, 1.0, 100.0)
SLIDE_TABLE, CONTACT_TABLE = "rival_slide_table", "rival_contact_table"
Rows = tuple[Samples, Samples, Samples]
"""Inputs, shape (n, inputs), what the nominal model leaves [N] and the shot's number, shape (n,) each."""
Predict = Callable[[Samples], Samples]
Learn = Callable[[Rows, int], Predict]


def _slide_law(x: float, v: float, m: float, _g: float, p: FloatPointer) -> float:
    """Force of a table over place and speed, one for each mass and direction."""
    mass = min(max(round((m - 12.6) / 6.3), 0), 2)
    block = 2 * mass + (0 if v >= 0.0 else 1)
    u = min(max((x - p[0]) / (p[1] - p[0]), 0.0), 1.0) * 63.0
    w = min(abs(v) / p[2], 1.0) * 9.0
    i, j = min(int(u), 62), min(int(w), 8)
    a, b = u - i, w - j
    at = 3 + 640 * block + 10 * i + j
    near = p[at] * (1.0 - b) + p[at + 1] * b
    return near * (1.0 - a) + (p[at + 10] * (1.0 - b) + p[at + 11] * b) * a


def _contact_law(d: float, rate: float, _k: float, _b: float, p: FloatPointer) -> float:
    """Force of a table over indentation and its rate."""
    u = min(max(d / p[0], 0.0), 1.0) * 19.0
    w = min(max((rate - p[1]) / (p[2] - p[1]), 0.0), 1.0) * 19.0
    i, j = min(int(u), 18), min(int(w), 18)
    a, b = u - i, w - j
    at = 3 + 20 * i + j
    near = p[at] * (1.0 - b) + p[at + 1] * b
    return near * (1.0 - a) + (p[at + 20] * (1.0 - b) + p[at + 21] * b) * a


def _table(identifier: str, law: Law, kind: LawKind, on: Kind, count: int) -> Effect:
    numbers = tuple(
        Parameter(f"c{i}", "1", null=math.nan, lower=-math.inf, upper=math.inf, typical=1.0)
        for i in range(count)
    )
    phases = (Phase.LOADING, Phase.UNLOADING, Phase.FREE_SLIDE)
    return Effect(identifier, on, "a table", "a rival's", phases, numbers, {kind: law})


SLIDE = _table(SLIDE_TABLE, _slide_law, LawKind.BODY, Kind.BODY, 3 + 6 * PLACES * SPEEDS)
CONTACT = _table(CONTACT_TABLE, _contact_law, LawKind.CONTACT, Kind.CONTACT, 3 + DEPTHS * DEPTHS)


@dataclass(frozen=True)
class Slide:
    """Rows of the free slides: along the motion [m, m/s, 1, kg], and place on the table."""

    place_m: Samples
    speed_m_s: Samples
    direction: Samples
    mass_kg: Samples
    left_n: Samples
    shot: Samples

    @property
    def rows(self) -> Rows:
        """Inputs, what is left, and shots."""
        inputs = np.column_stack([self.place_m, self.speed_m_s, self.direction, self.mass_kg])
        return inputs, self.left_n, self.shot


@dataclass(frozen=True)
class Contact:
    """Rows in contact."""

    indentation_m: Samples
    rate_m_s: Samples
    left_n: Samples
    shot: Samples

    @property
    def rows(self) -> Rows:
        """Inputs, what is left, and shots."""
        return np.column_stack([self.indentation_m, self.rate_m_s]), self.left_n, self.shot


def compare(place: str, truth: Predict | None, found: DiscrepancyResult) -> dict[str, Any]:
    """Gap of held-out traces and error of the force: of each rival, of the nominal model, of what was found.

    Parameters
    ----------
    place : str
        Where something is hidden.
    truth : callable, optional
        The hidden function of that place's covariate; without it no force is judged.
    found : DiscrepancyResult
    """
    for effect in (SLIDE, CONTACT):
        add_effect(effect)
    prepared, floor = found.prepared, found.floor
    problem, held = (
        Problem(shot_set(prepared, shots, floor.noise_std), len(prepared.batches))
        for shots in (found.training, found.held_out)
    )
    nominal = fit_nominal(problem)
    slide, contact = residual_rows(problem, nominal)

    def gap(judged: Problem, model: Fit) -> float:
        measure = GapMeasure(judged, floor, found.replicates, found.seed)
        return measure.gap(refit_shot_parameters(judged, model)).of([Part.TRACES])

    mu = plant_numbers(problem, nominal)[3]
    right = None if truth is None else force(place, truth, slide, contact, mu)
    answer: dict[str, Any] = {"nominal_gap": gap(held, nominal), "law_error": None}
    law = found.law
    if right is not None and law is not None and not law.refused:
        told = force(law.term.form.place, function_of(law), slide, contact, mu)
        answer["law_error"] = error(told, right, slide, contact)
    for name, learn in RIVALS.items():
        started = time.process_time()
        of_slide, of_contact = (within(rows, learn(rows, found.seed)) for rows in (slide.rows, contact.rows))
        seconds = time.process_time() - started
        constraints = Constraints(tables(of_slide, of_contact, slide, contact))
        names = (SLIDE_TABLE, CONTACT_TABLE)
        try:
            refitted = fit(
                problem.constrained(names, constraints), nominal.theta, nominal.shot_parameters,
                spread=nominal.spread,
            )  # fmt: skip
            left = gap(held.constrained(names, constraints), refitted)
        except DiscrepancyError:
            left = math.inf
        told = np.concatenate([of_slide(slide.rows[0]), of_contact(contact.rows[0])])
        answer[name] = {
            "gap": left,
            "error": None if right is None else error(told, right, slide, contact),
            "seconds": round(seconds, 2),
        }
    return answer


def plant_numbers(problem: Problem, nominal: Fit) -> list[float]:
    """Stiffness, damping, mu_s and mu_k."""
    numbers: list[float] = problem.with_effects(nominal.effects).plant_parameters(nominal.theta)[:4].tolist()
    return numbers


def residual_rows(problem: Problem, nominal: Fit) -> tuple[Slide, Contact]:
    """What the nominal model leaves of the smoothed training shots."""
    k, b, _, mu = plant_numbers(problem, nominal)
    slides, contacts = [], []
    for number, (shot, slow, fast) in enumerate(smoothed_shots(problem, nominal)):
        if slow is not None:
            on = slow.v > LEAST_SPEED * slow.v.max()
            # With the mean friction: a shot's own has taken up what differs between fast and slow ones.
            friction = mu * shot.mass_kg * problem.shots.gravity_m_s2
            same = np.ones(int(on.sum()))
            slides.append(
                (
                    shot.start_m + shot.direction * slow.x[on], slow.v[on], shot.direction * same,
                    shot.mass_kg * same, shot.mass_kg * slow.a[on] + friction, number * same,
                )
            )  # fmt: skip
        if fast is not None and len(shot.times[FORCE]):
            on = fast.travel > fast.x
            d, rate = (fast.travel - fast.x)[on], (fast.travel_rate - fast.v)[on]
            known = k * d + b * np.maximum(rate, 0.0)
            contacts.append((d, rate, fast.force[on] - known, number * np.ones(len(d))))
    return Slide(*map(np.concatenate, zip(*slides, strict=True))), Contact(
        *map(np.concatenate, zip(*contacts, strict=True))
    )


def force(
    place: str, function: Callable[[Samples], Samples], slide: Slide, contact: Contact, mu_k: float
) -> Samples:
    """Force of a function at a place, along the motion: at every row of the slides, then of the contacts."""
    none = np.zeros(len(slide.left_n)), np.zeros(len(contact.left_n))
    weight = slide.mass_kg * G
    if place == "free_drag_over_speed":
        return np.concatenate([-slide.speed_m_s * function(slide.speed_m_s), none[1]])
    if place == "free_friction_over_speed":
        return np.concatenate([-weight * function(slide.speed_m_s), none[1]])
    if place == "free_friction_over_position":
        return np.concatenate([-mu_k * weight * function(slide.place_m), none[1]])
    if place == "free_force_over_position":
        return np.concatenate([slide.direction * function(slide.place_m), none[1]])
    if place == "free_damping_over_indentation":
        return np.concatenate([none[0], contact.rate_m_s * function(contact.indentation_m)])
    if place == "free_stiffness_over_indentation":
        return np.concatenate([none[0], contact.indentation_m * function(contact.indentation_m)])
    return np.concatenate(none)


def error(told: Samples, truth: Samples, slide: Slide, contact: Contact) -> float:
    """RMS error of a force over the RMS of the true one; what mu_k, k and b do is no error."""
    weight, d = slide.mass_kg * G, contact.indentation_m
    plant = np.zeros((len(truth), 3))
    plant[: len(weight), 0] = weight
    plant[len(weight) :, 1] = d
    plant[len(weight) :, 2] = np.maximum(contact.rate_m_s, 0.0)
    scale = np.sqrt((plant**2).sum(0))
    plant = plant[:, scale > 0.0] / scale[scale > 0.0]
    basis = np.linalg.qr(plant)[0]

    def beyond(values: Samples) -> Samples:
        rest: Samples = values - basis @ (basis.T @ values)
        return rest

    # Where nothing is hidden, in the slide or in contact, nothing has to be told.
    acts = np.repeat(
        [bool(np.any(truth[: len(weight)])), bool(np.any(truth[len(weight) :]))], [len(weight), len(d)]
    )
    wrong, right = beyond(told - truth)[acts], beyond(truth)[acts]
    return float(np.sqrt(np.mean(wrong**2) / np.mean(right**2)))


def function_of(law: LawFinding) -> Callable[[Samples], Samples]:
    """Function that was found: the law, or the spline where only that does."""
    proposed, term = law.proposed, law.term
    if proposed is not None:
        return proposed.values
    seen = term.visited
    return lambda u: spline_basis(u, seen.lower, seen.upper, term.form.spans) @ term.coefficients


def within(rows: Rows, predict: Predict) -> Predict:
    """Keep a function, where it goes on beyond the rows, to what was seen of it."""
    ends = float(rows[1].min()), float(rows[1].max())
    return lambda points: np.clip(np.nan_to_num(predict(points)), *ends)


def tables(of_slide: Predict, of_contact: Predict, slide: Slide, contact: Contact) -> dict[str, float]:
    """Numbers of both tables, by name."""
    ends = (float(slide.place_m.min()), float(slide.place_m.max()), float(slide.speed_m_s.max()))
    x, v = np.linspace(*ends[:2], PLACES), np.linspace(0.0, ends[2], SPEEDS)
    numbers = [*ends]
    for mass in MASSES_KG:
        for direction in (1.0, -1.0):
            grid = np.stack(np.meshgrid(x, v, direction, mass, indexing="ij"), axis=-1).reshape(-1, 4)
            numbers += (direction * of_slide(grid)).tolist()
    of_depth = (
        float(contact.indentation_m.max()), float(contact.rate_m_s.min()), float(contact.rate_m_s.max())
    )  # fmt: skip
    d, rate = np.linspace(0.0, of_depth[0], DEPTHS), np.linspace(*of_depth[1:], DEPTHS)
    grid = np.stack(np.meshgrid(d, rate, indexing="ij"), axis=-1).reshape(-1, 2)
    of_contact_numbers = [*of_depth, *of_contact(grid).tolist()]
    return {f"{SLIDE_TABLE}.c{i}": number for i, number in enumerate(numbers)} | {
        f"{CONTACT_TABLE}.c{i}": number for i, number in enumerate(of_contact_numbers)
    }


def gaussian_process(rows: Rows, seed: int) -> Predict:
    """Fit a Gaussian process to some of the rows, its lengths by the largest likelihood."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    inputs, left, _ = rows
    chosen = np.random.default_rng(seed).permutation(len(left))[:MOST_ROWS]
    middle, width = inputs.mean(0), np.maximum(inputs.std(0), 1e-12)
    size = float(left.std())
    kernel = ConstantKernel(1.0, (1e-3, 1e3)) * RBF(np.ones(inputs.shape[1]), (1e-2, 1e3)) + WhiteKernel(
        0.1, (1e-6, 10.0)
    )
    process = GaussianProcessRegressor(kernel, n_restarts_optimizer=1, random_state=seed % 2**31)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        process.fit((inputs[chosen] - middle) / width, left[chosen] / size)
    return lambda points: size * process.predict((points - middle) / width)


def sindy(rows: Rows, _seed: int) -> Predict:
    """Regress on many terms; threshold and ridge are those that predict left-out shots best."""
    inputs, left, shot = rows
    library = _slide_library if inputs.shape[1] == 4 else _contact_library
    ends = np.array([inputs.min(0), inputs.max(0)])
    columns = library(inputs, ends)
    size, scale = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300), float(left.std())
    columns, y = columns / size, left / scale
    fold = np.unique(shot, return_inverse=True)[1] % FOLDS

    def missed(settings: tuple[float, float]) -> float:
        total = 0.0
        for out in range(FOLDS):
            left_out = fold == out
            weights = fitted(columns, y, ~left_out, *settings)
            total += float(np.sum((y[left_out] - columns[left_out] @ weights) ** 2))
        return total

    weights = fitted(columns, y, np.ones(len(y), dtype=bool), *min(product(THRESHOLDS, RIDGES), key=missed))
    return lambda points: scale * (library(points, ends) / size) @ weights


def _slide_library(inputs: Samples, ends: Samples) -> Samples:
    x, v, direction, mass = inputs.T
    reach, fastest = float(np.abs(ends[:, 0]).max()), float(ends[1, 1])
    u, w = x / reach, v / fastest
    terms = [u**i * w**j for i in range(4) for j in range(4 - i)]
    terms += [np.exp(-((w / one) ** 2)) for one in STRIBECK]
    terms += [wave(2.0 * math.pi * x / one) for one in PERIODS_M for wave in (np.sin, np.cos)]
    middles = np.linspace(-1.0, 1.0, BUMPS)
    terms += [
        np.exp(-0.5 * ((u - middle) / (wide * 2.0 / BUMPS)) ** 2)
        for middle in middles
        for wide in BUMP_WIDTHS
    ]
    basis = np.column_stack(terms)
    weight = (mass / MASSES_KG[1])[:, None]
    sign = direction[:, None]
    return np.hstack([basis, basis * weight, basis * sign, basis * weight * sign])


def _contact_library(inputs: Samples, ends: Samples) -> Samples:
    d, rate = inputs.T
    u, w = d / float(ends[1, 0]), rate / float(np.abs(ends[:, 1]).max())
    closing = np.maximum(w, 0.0)
    logarithm = u * np.log(np.maximum(u, 1e-6))
    terms = [u**i * w**j for i in range(5) for j in range(5 - i)]
    terms += [logarithm, np.sqrt(np.maximum(u, 0.0)), closing, closing * u, closing * u**2]
    terms += [np.maximum(u - one, 0.0) for one in (0.2, 0.4, 0.6, 0.8)]
    return np.column_stack(terms)


def operon(rows: Rows, seed: int) -> Predict:
    """Search for a formula by genetic programming."""
    from pyoperon.sklearn import SymbolicRegressor

    inputs, left, _ = rows
    width = np.maximum(np.abs(inputs).max(0), 1e-12)
    size = float(left.std())
    search = SymbolicRegressor(
        allowed_symbols="add,sub,mul,div,exp,sin,sqrt,square,constant,variable",
        optimizer_iterations=10,
        max_length=30,
        objectives=["r2", "length"],
        model_selection_criterion="minimum_description_length",
        generations=1000,
        max_evaluations=100_000_000,
        max_time=OPERON_S,
        n_threads=1,
        random_state=seed % 2**31,
    )
    search.fit(inputs / width, left / size)

    return lambda points: size * np.asarray(search.predict(points / width), dtype=np.float64)


RIVALS: dict[str, Learn] = {"gaussian_process": gaussian_process, "sindy": sindy}
if find_spec("pyoperon"):
    RIVALS["operon"] = operon
