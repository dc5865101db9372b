"""Friction of the place that a tap begins at: by what a plant's own is multiplied there."""

import numpy as np

from impactcell.physics import memory_layout as at
from impactcell.physics.free_motion import values_of_law
from impactcell.physics.law_table import build_law_table, parameter_vector, tap_columns
from impactcell.physics.plant import Plant, TapInput


def goes_with_place(plant: Plant) -> bool:
    """Whether effects of a plant make its friction another from place to place: its own is of one of them."""
    if not plant.effects:
        return False
    laws = build_law_table(tuple(plant.effects)).laws
    return bool(laws[at.SCALE] != laws[at.SCALE + 1])


def friction_factor(plant: Plant, tap: TapInput) -> float:
    """Evaluate a plant's effects on the friction of a place where a tap begins, before the part moves.

    prod_i s_i(x_0) of mu_s and mu_k, with s the laws of `LawKind.SCALE`; 1 without any. The plant's own are
    those of x = 0 with most laws, where no tap may ever be. What acts between shots (direction, rest) is no
    part of it: friction of taps both ways, or after other rests, is to be one that wear can be followed by.
    What depends on speed is added to mu_k in slip.
    """
    if not goes_with_place(plant):
        return 1.0
    program = build_law_table(tuple(plant.effects))
    values = parameter_vector(plant, program)
    row = program.tap_parameters(values[None], plant.gravity_m_s2, tap_columns([tap]))[0]
    place = np.array([[tap.start_m, 0.0, 0.0, 0.0]])
    factor = 1.0
    for entry in range(int(program.laws[at.SCALE]), int(program.laws[at.SCALE + 1]), 2):
        law, first = int(program.laws[entry]), int(program.laws[entry + 1])
        factor *= float(values_of_law(law, place, row[first:])[0])
    return factor
