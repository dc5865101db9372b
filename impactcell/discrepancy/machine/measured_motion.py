"""Measured motion of a finding's records, and the forces of its models against it."""

import math
from dataclasses import replace

import numpy as np

from impactcell.discrepancy.machine.finding import MachineFinding
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.records.motion_scale import carried_load, half_supports, is_told
from impactcell.discrepancy.machine.records.smoothing import smoothed_speed
from impactcell.discrepancy.machine.regression.weak_form import direction_of_motion
from impactcell.discrepancy.machine.terms.catalogue import MotionState
from impactcell.discrepancy.machine.terms.law_terms import term_of


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
