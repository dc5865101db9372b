"""Plan of the discrepancy study: which campaigns, and how strong what is hidden in them has to be."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from impactcell.discrepancy.data import noise_floor
from impactcell.discrepancy.data.prepared_campaign import prepare, shot_set
from impactcell.discrepancy.model.initial_guess import fit_nominal
from impactcell.discrepancy.model.problem import Problem
from impactcell.errors import ImpactCellError
from simulator.campaign import make
from simulator.effects import LIBRARY as LAWS
from simulator.effects import UNLISTED
from tests.discrepancy import study
from tests.discrepancy.study import JOINED, Job, numbered, recorded, scenario

CONFOUNDED = frozenset({"mass_error", "force_sensor_gain"})
EQUIVALENT = (
    CONFOUNDED,
    frozenset({"surface_tilt", "direction_asymmetry"}),
    frozenset({"friction_drift", "batch_shift"}),
    frozenset({"force_sensor_lag", "channel_skew"}),
)
"""As impactcell/discrepancy/README.md declares them: one may be named where the library lacks the other."""
EARLIER = sorted(set(LAWS) - set(JOINED))
"""Effects of which pairs and trios are made; with the others every pair would be another one."""
VISIBLE = (2.3, 6.0)
SUBTLE = (1.27, 1.43)
FIRST_SHOTS = 24
"""Shots on which a strength is first tried."""

LOOKS = 8
NEAR = 0.06
LARGEST, SMALLEST = 6.0, 1e-3
CAPS = {"stiction_ageing": 3.0, "presliding_compliance": 20.0, "force_saturation": 4.0}
"""Multiples of the default strength beyond which an effect would no longer be sensible."""


def jobs(
    *,
    single: int = 5,
    subtle: int = 3,
    removed: int = 2,
    outside: int = 5,
    two: int = 44,
    three: int = 0,
    none: int = 200,
    later: int = 0,
) -> list[Job]:
    """Plan so many campaigns of every effect, of pairs, of three effects and of none; balanced wherever it is
    interrupted. `later` is added to every seed: numbers that earlier studies have not seen.
    """
    kinds = (
        _single("single", single, VISIBLE, 10_000),
        _single("subtle", subtle, SUBTLE, 20_000),
        _removed(removed),
        _outside(outside),
        _two(two),
        _three(three),
        _none(none),
    )
    placed = []
    for number, made in enumerate(map(list, kinds)):
        placed += [
            ((place + 0.5) / len(made), number, replace(job, seed=job.seed + later))
            for place, job in enumerate(made)
        ]
    return [job for _, _, job in sorted(placed, key=lambda one: one[:2])]


def measured_jobs(measured: str, later: int = 0) -> list[Job]:
    """Campaigns as they are measured, whose contact lies anywhere between two samples (`LOGGED`) or whose
    velocities and masses are a little off what is told (`TOLD`): every effect twice, what lies outside of the
    vocabulary twice, and 40 with nothing hidden.
    """
    made = [
        *(replace(job, kind=measured) for job in _single("single", 2, VISIBLE, 80_000)),
        *(replace(job, kind=f"{measured} outside", seed=job.seed + 50_000) for job in _outside(2)),
        *(replace(job, kind=f"{measured} none", seed=job.seed + 50_000) for job in _none(40)),
    ]
    return [replace(job, seed=job.seed + later) for job in made]


def _target(seed: int, bounds: tuple[float, float]) -> float:
    low, high = map(math.log, bounds)
    return round(math.exp(float(np.random.default_rng([seed, 3]).uniform(low, high))), 3)


def _turns(names: list[str], per: int, first: int) -> Iterator[tuple[str, int]]:
    """Every name once a turn, the order differing; those that joined later last."""
    drawn = sum(name not in JOINED for name in names)
    for turn in range(per):
        order = np.random.default_rng([first, turn]).permutation(drawn)
        for place in (*order, *range(drawn, len(names))):
            yield names[int(place)], first + 100 * turn + int(place)


def _like(kind: str, hidden: tuple[str, ...], seed: int, bounds: tuple[float, float]) -> Job:
    """60 shots: in a fifth of them the noise is coloured, in a third the actuator was not recorded."""
    rng = np.random.default_rng([seed, 4])
    needed = bool({"actuator_droop", "actuator_ramp"} & set(hidden))
    return Job(
        kind,
        hidden,
        seed,
        target=_target(seed, bounds),
        coloured=bool(rng.random() < 0.2),
        actuator=bool(rng.random() < 2 / 3) or needed,
    )


def _single(kind: str, per: int, bounds: tuple[float, float], first: int) -> Iterator[Job]:
    for effect, seed in _turns(numbered(LAWS), per, first):
        yield _like(kind, (effect,), seed, bounds)


def _removed(per: int) -> Iterator[Job]:
    for effect, seed in _turns(numbered(LAWS), per, 30_000):
        yield replace(_like("removed", (effect,), seed, VISIBLE), removed=effect)


def _outside(per: int) -> Iterator[Job]:
    for effect, seed in _turns(sorted(set(UNLISTED) - {"wandering_force", "wedge_drag"}), per, 40_000):
        yield _like("outside", (effect,), seed, VISIBLE)


def _two(count: int) -> Iterator[Job]:
    pairs = [pair for pair in itertools.combinations(EARLIER, 2) if set(pair) != CONFOUNDED]
    chosen = np.random.default_rng(50).permutation(len(pairs))[:count]
    for place, pair in enumerate(chosen):
        yield _like("two", pairs[int(pair)], 50_000 + place, VISIBLE)


def _three(count: int) -> Iterator[Job]:
    """Three effects, no two of which are declared to be equivalent."""
    trios = [
        trio
        for trio in itertools.combinations(EARLIER, 3)
        if not any(len(group & set(trio)) > 1 for group in EQUIVALENT)
    ]
    chosen = np.random.default_rng(70).permutation(len(trios))[:count]
    for place, trio in enumerate(chosen):
        yield _like("three", trios[int(trio)], 70_000 + place, VISIBLE)


def _none(count: int) -> Iterator[Job]:
    like = itertools.cycle(itertools.product((30, 60, 100), (False, True), (True, False)))
    for place, (shots, coloured, replicates) in zip(range(count), like, strict=False):
        yield Job(
            "none", (), 60_000 + place, shots=shots, coloured=coloured, replicates=replicates,
            actuator=place % 3 > 0,
        )  # fmt: skip


def calibrated(job: Job) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Multiples of the default strengths that make the nominal model's gap the target, effect by effect.

    Returns
    -------
    multiples, gaps : tuple of float
        Gaps are those expected; below the target where no sensible strength reaches it.
    """
    if not job.target:
        return (job.strength,) * len(job.hidden), (math.nan,) * len(job.hidden)
    found = [_calibrated(replace(job, hidden=(effect,))) for effect in job.hidden]
    return tuple(one for one, _ in found), tuple(gap for _, gap in found)


def _calibrated(job: Job) -> tuple[float, float]:
    """Regula falsi in log(strength) against log(gap² - 1), which is nearly a line of slope 2."""
    (effect,) = job.hidden
    cap = CAPS.get(effect, LARGEST)
    wanted = _excess(job.target)
    tried: dict[float, float] = {}
    strength = 0.5 if job.target > SUBTLE[1] else 0.15
    for _ in range(LOOKS):
        tried[strength] = nominal_gap(job, strength)
        if abs(tried[strength] / job.target - 1.0) < NEAR:
            break
        below = max((one for one, gap in tried.items() if gap < job.target), default=None)
        above = min((one for one, gap in tried.items() if gap >= job.target), default=None)
        if below is not None and below >= cap:
            break
        if below is None or above is None:
            step = math.exp(0.5 * (wanted - _excess(tried[strength])))
            strength = strength * min(max(step, 0.1), 8.0)
        else:
            low, high = _excess(tried[below]), _excess(tried[above])
            share = min(max((wanted - low) / max(high - low, 1e-9), 0.15), 0.85)
            if len(tried) % 2:  # where the gap rises all at once, halving is faster
                share = 0.5
            strength = below ** (1.0 - share) * above**share
        strength = min(max(strength, SMALLEST), cap)
    best = min(tried, key=lambda one: abs(math.log(tried[one] / job.target)))
    return round(best, 4), round(tried[best], 3)


def _excess(gap: float) -> float:
    return math.log(max(gap**2 - 1.0, 1e-3))


@lru_cache(maxsize=64)
def nominal_gap(job: Job, strength: float, shots: int = FIRST_SHOTS) -> float:
    """Gap of the nominal model on a few shots of a campaign, the scatter of the factors as it was made.

    It is the gap as `result.json` defines it, but of all shots, and with the scatter that the simulator has
    drawn in the place of the replicates', which on a few shots would be too uncertain to calibrate with.
    """
    rate, study.RATE_HZ = study.RATE_HZ, 2000.0
    few = replace(job, shots=shots, kind="single")  # settings exactly as told
    try:
        plan = scenario(few, [strength])
        made = make(plan)[1]
        prepared = prepare(recorded(plan, made))
        floor = noise_floor.sensor_noise(prepared)
        every = np.arange(len(prepared.shots))
        problem = Problem(shot_set(prepared, every, floor.noise_std), len(prepared.batches))
        nominal = fit_nominal(problem)
    except ImpactCellError:
        return math.inf
    finally:
        study.RATE_HZ = rate
    size = problem.shots.values.size
    free = size - len(problem.shot_parameter_names) * problem.count - len(nominal.coordinates)
    trace = math.sqrt(float(nominal.misfit(problem.shots).sum()) / free)
    scatter = np.log([shot.plan.factor for shot in made])
    more = float(np.var(nominal.shot_parameters.log_factor) - np.var(scatter)) / plan.friction_scatter**2
    return max(trace, math.sqrt(max(1.0 + more, 0.0)))
