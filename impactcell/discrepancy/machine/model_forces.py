"""Forces of a fitted model by the state of the machine: anywhere, at rest, and where it was measured."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from impactcell.discrepancy.machine.finding import FittedModel, MachineFinding
from impactcell.discrepancy.machine.law_terms import term_of
from impactcell.discrepancy.machine.motion_scale import MotionScale, carried_load, half_supports, is_told
from impactcell.discrepancy.machine.smoothing import smoothed_speed
from impactcell.discrepancy.machine.terms import MotionState
from impactcell.discrepancy.machine.uniform_records import UniformRecord
from impactcell.discrepancy.machine.weak_form import direction_of_motion
from impactcell.records import Samples


def law_of(
    model: FittedModel, covariates: Mapping[str, Samples]
) -> Callable[[Samples, Samples, Samples], list[Samples]]:
    """Sum of all smooth forces, and level of friction, of position, velocity and load: shape (n,) each."""
    parts = [
        (term_of(chosen.choice), chosen, np.array([model.value(column) for column in chosen.columns]))
        for chosen in model.terms
    ]

    def law(position: Samples, velocity: Samples, load: Samples) -> list[Samples]:
        sums = [np.zeros(position.shape), np.zeros(position.shape)]
        motions_by = {
            name: MotionState(position, velocity, load, column) for name, column in covariates.items()
        }
        for term, chosen, strengths in parts:
            features = term.features(motions_by[chosen.choice.covariate], chosen.shape)
            sums[term.is_friction] += (
                strengths @ features if len(strengths) > 1 else strengths[0] * features[0]
            )
        return sums

    return law


def friction_at_rest(model: FittedModel, records: Sequence[UniformRecord], scale: MotionScale) -> float:
    """Mean level of a model's friction where the part would rest, over all places of all records."""
    levels = []
    for record in records:
        still = np.zeros(record.position.shape)
        load = carried_load(model.base.response, record, record.force, (model.gravity, scale))
        columns = {
            term.choice.covariate: still + record.covariates.get(term.choice.covariate, 0.0)
            for term in model.terms
        }
        _, friction = law_of(model, columns)(record.position, still, load)
        levels.append(float(friction.mean()))
    return float(np.mean(levels))


def motions(finding: MachineFinding) -> list[MotionState]:
    """Measured motion of every record, by the final model's gravity; without any column of `shots.csv`.

    What lies near a gap is left out.
    """
    states = []
    for record in finding.records:
        _, narrow = half_supports(record, finding.scale)
        velocity = smoothed_speed(record.position, narrow, record.step_s)
        gravity = finding.final.gravity
        load = carried_load(finding.base.response, record, record.force, (gravity, finding.scale))
        told = is_told(record, finding.scale)
        states.append(
            MotionState(record.position[told], velocity[told], load[told], np.zeros(int(told.sum())))
        )
    return states


def resistance(finding: MachineFinding, model: FittedModel) -> tuple[float, float]:
    """Least and largest force against the motion over all records, by the terms that may not give energy.

    Terms of friction count, those whose strength may not be negative, and of a smooth force what turns with
    the motion; springs and waves of force do not.
    """
    least, largest = math.inf, 0.0
    for record, motion in zip(finding.records, motions(finding), strict=True):
        _, narrow = half_supports(record, finding.scale)
        noise = record.speed_noise(narrow)
        moving = np.abs(direction_of_motion(motion.velocity, finding.scale, noise)) == 1.0
        against = np.zeros(moving.shape)
        for chosen in model.terms:
            term = term_of(chosen.choice)
            column = np.full(moving.shape, record.covariates.get(chosen.choice.covariate, 0.0))
            is_smooth = chosen.choice.reach is not None
            if not (term.is_friction or term.nonnegative or is_smooth):
                continue
            state = replace(motion, covariate=column)
            features = term.features(state, chosen.shape)
            if is_smooth:  # what turns with the motion takes energy, or gives it
                other_way = replace(state, velocity=-motion.velocity)
                features = 0.5 * (features - term.features(other_way, chosen.shape))
            sense = 1.0 if term.is_friction else -np.sign(motion.velocity)
            against += sense * sum(
                model.value(name) * feature for name, feature in zip(chosen.columns, features, strict=True)
            )
        if moving.any():
            least = min(least, float(against[moving].min()))
            largest = max(largest, float(against[moving].max()))
    return least, largest
