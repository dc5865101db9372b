"""Friction of the place, the direction and the rest that one tap has: by what a plant's own is multiplied."""

from dataclasses import dataclass, replace

import numpy as np

from impactcell.physics import memory_layout as at
from impactcell.physics.free_motion import values_of_law
from impactcell.physics.law_table import build_law_table, parameter_vector, tap_columns
from impactcell.physics.plant import Plant, TapInput


@dataclass(frozen=True, slots=True)
class FrictionFactors:
    """By what a plant's mu_s and mu_k are multiplied where a tap begins.

    Attributes
    ----------
    mu_s, mu_k : float
        1 without effects that make friction differ from tap to tap, or from place to place.
    """

    mu_s: float
    mu_k: float


def friction_factors(plant: Plant, tap: TapInput) -> FrictionFactors:
    """Evaluate a plant's effects on friction where a tap begins, before the part moves.

    f_s = b_s prod_i s_i(x_0), f_k = b_k prod_i s_i(x_0), with s the laws of `LawKind.SCALE` at the place
    where the part lies, and b what acts between shots: direction, dwell, batch and order. What depends on
    speed is added to mu_k in slip, and is no part of it.
    """
    if not plant.effects:
        return FrictionFactors(1.0, 1.0)
    program = build_law_table(tuple(plant.effects))
    values = parameter_vector(replace(plant, mu_s=1.0, mu_k=1.0), program)
    row = program.tap_parameters(values[None], plant.gravity_m_s2, tap_columns([tap]))[0]
    place = np.array([[tap.start_m, 0.0, 0.0, 0.0]])
    scale = 1.0
    for entry in range(program.laws[at.SCALE], program.laws[at.SCALE + 1], 2):
        law, first = int(program.laws[entry]), int(program.laws[entry + 1])
        scale *= float(values_of_law(law, place, row[first:])[0])
    return FrictionFactors(float(row[at.MU_S]) * scale, float(row[at.MU_K]) * scale)
