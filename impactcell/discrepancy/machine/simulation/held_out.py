"""Open-loop simulation of held-out stretches: a model runs by itself, from the first state of each.

Steps are Moreau's: position at the half step, all forces but friction at once, and friction as an impulse
that may stop the part and never turns it; a part that is stopped within a step goes on from rest. A command
is held from its sample to the next. Where the force is predicted, the measured motion is the input, and both
forces are averaged as the regression averages.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from impactcell.discrepancy.machine.finding import MachineFinding
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.fits.model_forces import law_of
from impactcell.discrepancy.machine.open_loop_error import OpenLoopError
from impactcell.discrepancy.machine.records.held_out_stretch import (
    OFFSET_STEPS,
    RECORD_STEPS,
    START_PERIODS,
    constant_forces,
    drifts,
    first_state,
    settled_start,
)
from impactcell.discrepancy.machine.records.motion_scale import (
    MotionScale,
    carried_load,
    half_supports,
    is_told,
)
from impactcell.discrepancy.machine.records.smoothing import averaged, smoothed_acceleration, smoothed_speed
from impactcell.discrepancy.machine.records.step_forces import Drive, drive_of
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.regression.weak_form import (
    ECCENTRICITY,
    INERTIA_BESIDE,
    direction_of_motion,
    eccentricity_waves,
)
from impactcell.discrepancy.machine.terms.base_model import PRIOR_REACH, Response
from impactcell.records import Samples

STEPS_PER_PERIOD = 200
"""Least steps in a period of the motion: second order, a step errs by (2 pi / 200)² / 24 of its force [1]."""
ROUNDS, FORCE_SETTLED = 6, 1e-3
"""Rounds at most in which first states and constant forces of stretches settle where these add up, and the
relative change of a constant that ends them: a round leaves about a fifth [1]."""
RUNAWAY = 100.0
"""Times the largest distance from 0 that was measured, beyond which a simulated part goes no further: on a
spring that softens it has run away, and by how much it errs is told all the same [1]."""


def with_simulations(finding: MachineFinding) -> MachineFinding:
    """Simulate what was held out without and with what is established."""
    models = finding.nominal, finding.final
    return replace(finding, simulated=tuple(simulate_held_out(finding, model) for model in models))


def simulate_held_out(finding: MachineFinding, model: FittedModel) -> OpenLoopError:
    """Simulate a model on what was held out."""
    stretches = []
    for place, begin_s, end_s in finding.held_spans:
        record = finding.records[place]
        first, last = np.searchsorted(record.time_s, [begin_s, end_s])
        stretches.append((record, slice(int(first), int(last) + 1)))
    if model.base.response is Response.FORCE:
        # At rest friction takes whatever balances the drive; no model says what.
        simulated = [needed_force(model, record, stretch, finding.scale) for record, stretch in stretches]
        measured = [
            averaged(record.force, _half_average(record, finding.scale), record.step_s)[stretch]
            for record, stretch in stretches
        ]
        if model.base.force_offset_by_record:
            simulated = [
                force - np.nanmean(force - values) if np.isfinite(force).any() else force
                for force, values in zip(simulated, measured, strict=True)
            ]
    else:
        simulated = _positions(model, stretches, finding.scale.period_s)
        measured = [record.position[stretch] for record, stretch in stretches]
    counted = [np.isfinite(values) for values in simulated]
    parts = [values[mask] for values, mask in zip(measured, counted, strict=True)]
    value = np.concatenate(parts)
    error = np.concatenate([values[mask] for values, mask in zip(simulated, counted, strict=True)]) - value
    rmse = float(np.sqrt(np.mean(error**2)))
    if model.base.response is Response.FORCE:
        return OpenLoopError(rmse, _fit(rmse, value), rmse / float(np.sqrt(np.mean(value**2))))
    # Where a stretch begins is given to the model: that the part lies elsewhere in the next is no motion.
    return OpenLoopError(
        rmse, _fit(rmse, np.concatenate([part - part.mean() for part in parts if part.size])), math.nan
    )


def _fit(rmse: float, varying: Samples) -> float:
    return 100.0 * (1.0 - rmse / float(varying.std()))


def needed_force(model: FittedModel, record: UniformRecord, stretch: slice, scale: MotionScale) -> Samples:
    """Force that the measured motion needs, averaged; nan where the part rests or turns, or a gap is near."""
    half = _half_average(record, scale)
    _, narrow = half_supports(record, scale)
    velocity = smoothed_speed(record.position, narrow, record.step_s)
    acceleration = smoothed_acceleration(record.position, half, record.step_s)
    direction = direction_of_motion(velocity, scale, record.speed_noise(narrow))
    load = carried_load(Response.FORCE, record, record.force, (model.gravity, scale))
    covariates = {
        term.choice.covariate: np.full(velocity.shape, record.covariates.get(term.choice.covariate, 0.0))
        for term in model.terms
    }
    smooth, friction = law_of(model, covariates)(record.position, velocity, load)
    gain = 1.0 + model.nuisance("force_gain")
    gravity = gain * model.base.gravity_torque.value * np.sin(record.position)
    beyond, by_zero = _gravity_deviation(model)
    deviation = by_zero * np.cos(record.position) - beyond * np.sin(record.position)
    beside = gravity - smooth - model.nuisance("force_offset") + direction * friction - deviation
    force = np.where(is_told(record, scale), averaged(beside, half, record.step_s), np.nan)
    inertia = record.inertia * (gain + model.nuisance("inertia")) + model.value(INERTIA_BESIDE)
    force += inertia * acceleration
    eccentricity = _eccentricity(model)
    if eccentricity.any():
        wave = eccentricity @ eccentricity_waves(record.position)
        bent = smoothed_acceleration(wave, half, record.step_s)
        force -= record.inertia * bent + model.gravity * np.cos(record.position) * wave
    delayed = np.interp(record.time_s - model.delay_s, record.time_s, force)
    return np.where(np.abs(direction) < 1.0, np.nan, delayed)[stretch]


def _half_average(record: UniformRecord, scale: MotionScale) -> int:
    """Half the samples over which forces are averaged."""
    half, narrow = half_supports(record, scale)
    return max(half // 2, narrow)


def _positions(
    model: FittedModel, stretches: Sequence[tuple[UniformRecord, slice]], period_s: float
) -> list[Samples]:
    """Positions that the measured forces lead to, all stretches at once.

    Where a constant force adds up, each stretch has one of its own beside the model's.
    """
    records = [record for record, _ in stretches]
    measured = [record.position[stretch] for record, stretch in stretches]
    drives = [drive_of(record, stretch, model.delay_s) for record, stretch in stretches]
    states = [first_state(values, record.step_s) for record, values in zip(records, measured, strict=True)]
    start = np.array(states).T
    run = _runner(model, records, drives, period_s)
    begin = [
        max(min(int(START_PERIODS * period_s / record.step_s), len(values) // 4), 2)
        for record, values in zip(records, measured, strict=True)
    ]
    constant = np.zeros(len(records))
    adrift = drifts(model.base)
    if adrift:
        # A drift shows at the longest step that a simulation may have, where no drive is switched within it.
        every = max(int(period_s / (STEPS_PER_PERIOD * max(record.step_s for record in records))), 1)
        if any(record.force_is_command for record in records):
            every = 1
        thin = [replace(record, time_s=record.time_s[::every]) for record in records]
        pushes = [drive_of(record, stretch, model.delay_s, every) for record, stretch in stretches]
        places = [values[::every] for values in measured]
        beside = _runner(model, thin * 2, pushes * 2, period_s)

        def settled(state: Samples, constant: Samples) -> Samples:
            return constant_forces(
                lambda forces: beside(np.tile(state, 2), max(map(len, places)), forces),
                ([push.values for push in pushes], places),
                constant,
                PRIOR_REACH * model.base.force_offset.std,
                RECORD_STEPS if model.base.force_offset_by_record else OFFSET_STEPS,
            )

    for _ in range(ROUNDS if adrift else 1):
        # The first speed first: a constant force that makes up for a wrong one keeps it wrong.
        beginning = partial(run, count=max(begin), constant=constant)
        start = settled_start(beginning, start, measured, begin)
        if adrift:
            before, constant = constant, settled(start, constant)
            if np.all(np.abs(constant - before) <= FORCE_SETTLED * np.abs(constant)):
                break
    out = run(start, max(map(len, measured)), constant)
    return [out[: len(values), lane] for lane, values in enumerate(measured)]


def positions_from(
    model: FittedModel, records: Sequence[UniformRecord], start: Samples, period_s: float
) -> list[Samples]:
    """Positions that forces lead to from first states of shape (2, n), as long as each force."""
    drives = [drive_of(record, slice(None), 0.0) for record in records]
    out = _runner(model, records, drives, period_s)(start, max(len(record.force) for record in records))
    return [out[: len(record.force), lane] for lane, record in enumerate(records)]


def _runner(
    model: FittedModel, records: Sequence[UniformRecord], drives: Sequence[Drive], period_s: float
) -> Callable[..., Samples]:
    """Run all drives side by side: from first states (2, lanes) to positions (samples, lanes).

    `run(state, count, constant)`: the last is a constant force of each lane, 0 where it is left out.
    """
    parts = max(math.ceil(STEPS_PER_PERIOD * max(record.step_s for record in records) / period_s), 1)
    step = np.array([record.step_s for record in records]) / parts
    drive = np.zeros((max(len(one.values) for one in drives), parts, len(records)))
    for lane, one in enumerate(drives):
        drive[: len(one.values), :, lane] = one.over(
            parts, 1.0 + model.nuisance("force_gain"), model.nuisance("force_offset")
        )
    inertia = np.array([record.inertia for record in records]) * (1.0 + model.nuisance("inertia"))
    columns = {term.choice.covariate for term in model.terms}
    law = law_of(
        model, {name: np.array([record.covariates.get(name, 0.0) for record in records]) for name in columns}
    )
    beyond, by_zero = _gravity_deviation(model)
    sine_torque = model.base.gravity_torque.value + beyond
    eccentricity = _eccentricity(model)
    far = RUNAWAY * max(float(np.abs(record.position).max()) for record in records)
    fast = far / float(step.max())
    half = 0.5 * step
    is_eccentric = bool(eccentricity.any())

    def reading(angle: Samples) -> Samples | float:
        """Give what an encoder off its centre reads beside the angle."""
        return eccentricity @ eccentricity_waves(angle) if is_eccentric else 0.0

    def advance(q: Samples, v: Samples, force: Samples) -> tuple[Samples, Samples]:
        """One step of Moreau's scheme, its speeds at the middle of the step."""
        middle = q + half * v
        sine = np.sin(middle) if sine_torque or model.gravity else 0.0
        load = np.abs(force + model.gravity * sine)
        outside = force - sine_torque * sine
        if by_zero:
            outside = outside + by_zero * np.cos(middle)
        ahead = mean = v
        for _ in range(2):
            smooth, friction = law(middle, 0.5 * (v + ahead), load)
            freely = v + step * (outside + smooth) / inertia
            held = step * np.maximum(friction, 0.0) / inertia
            ahead, mean = _with_a_stop(v, freely, held)
            ahead = _within(ahead, -fast, fast)
        return _within(q + step * mean, -far, far), ahead

    def run(state: Samples, count: int, constant: Samples | float = 0.0) -> Samples:
        slope = eccentricity @ np.stack([-np.sin(state[0]), np.cos(state[0])])
        q, v = state[0] - reading(state[0]), state[1] * (1.0 - slope)
        out = np.empty((count, len(records)))
        acting = drive[:count] + constant
        for place in range(count):
            out[place] = q + reading(q)
            for part in range(parts):
                q, v = advance(q, v, acting[place, part])
        return out

    return run


def _within(values: Samples, least: float, most: float) -> Samples:
    """Values no less and no more: numpy's own takes several times as long for the few lanes of a step."""
    return np.minimum(np.maximum(values, least), most)


def _with_a_stop(v: Samples, freely: Samples, held: Samples) -> tuple[Samples, Samples]:
    """Speed after a step that begins at v, and mean speed over it, if friction stops the part within it.

    `freely` is the speed that it would have without friction, `held` what friction takes at most. What is
    left of the step after a stop begins at rest.
    """
    slid = freely - np.sign(v) * held
    stops = slid * v <= 0.0
    if not np.count_nonzero(stops):  # as in most steps
        return slid, 0.5 * (v + slid)
    share = np.divide(v, v - slid, out=np.zeros(v.shape), where=stops & (v != slid))
    push = freely - v
    ahead = (1.0 - share) * np.sign(push) * np.maximum(np.abs(push) - held, 0.0)
    return (
        np.where(stops, ahead, slid),
        0.5 * np.where(stops, share * v + (1.0 - share) * ahead, v + slid),
    )


def _gravity_deviation(model: FittedModel) -> tuple[float, float]:
    """G beyond its stated value, of -sin q, and what the zero of the position sensor adds, of cos q."""
    return model.nuisance("gravity_torque"), model.gravity * model.nuisance("position_offset")


def _eccentricity(model: FittedModel) -> Samples:
    """Amplitudes e_c and e_s of an encoder that turns off its centre, shape (2,)."""
    return np.array([model.value((ECCENTRICITY, 0.0, number)) for number in range(2)])
