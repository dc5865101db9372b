"""Acceleration of a part that slides freely, by what depends on its speed and not on where it is."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from impactcell.numerics.jit import FloatArray, address, compiled, float_pointer, invoke
from impactcell.physics.effect import LawKind
from impactcell.physics.effects import find_effect
from impactcell.physics.law_table import build_law_table, parameter_vector
from impactcell.physics.plant import Plant, TapInput
from impactcell.records import Capture, Samples

CHORD_SPEED_M_S = 2.0**-4
"""Speed of a slide at which resistance is looked at; a power of two, so that viscous friction is exact."""


def acts_on_speed(identifier: str) -> bool:
    """Whether an effect accelerates a free part, friction that changes from place to place apart.

    One that reads columns of `shots.csv` is at its null: a cycle does not say what they are.
    """
    effect = find_effect(identifier)
    return not effect.columns and not {LawKind.BODY, LawKind.KINETIC}.isdisjoint(effect.laws)


def depends_on_mass(identifier: str) -> bool:
    """Whether an effect accelerates a light part more than a heavy one: a force does, a tilt does not."""
    effect = find_effect(identifier)
    body = effect.laws.get(LawKind.BODY)
    if body is None:
        return False
    typical = np.array([*(one.typical for one in effect.parameters), *([1.0] * len(effect.columns))])
    masses = np.repeat([1.0, 2.0], 2)
    rows = np.array([[0.01, speed, mass, 9.81] for mass, speed in zip(masses, (0.1, -0.1) * 2, strict=True)])
    per_kg = values_of_law(address(body), rows, typical) / masses
    return not np.allclose(per_kg[:2], per_kg[2:], rtol=1e-9)


def model_acceleration(plant: Plant, capture: Capture) -> Callable[[Samples], Samples] | None:
    """Give what a plant's effects do to the free part of a cycle; None where they do nothing.

    Where the mass is not known, forces are left out.

    Returns
    -------
    callable or None
        Speeds along the tap, m/s, to `acceleration` along it, m/s².
    """
    is_known = capture.mass_kg > 0.0
    effects = {
        name: given
        for name, given in plant.effects.items()
        if acts_on_speed(name) and (is_known or not depends_on_mass(name))
    }
    if not effects:
        return None
    mass_kg = capture.mass_kg if is_known else 1.0
    tap = TapInput(1.0, mass_kg, direction=capture.direction, start_m=capture.start_m)
    return partial(acceleration, replace(plant, effects=effects), tap)


def acceleration(plant: Plant, tap: TapInput, speed_m_s: Samples) -> Samples:
    """Evaluate the laws of a plant's effects for a free part, mu_k itself left out.

    Along the tap, a = s sum_i F_i(x_0, s v, m, g) / m - g sum_j dmu_j(v, x_0), with s its direction, F the
    laws of `LawKind.BODY` and dmu those of `LawKind.KINETIC`. What depends on the place is taken where the
    part lay.

    Parameters
    ----------
    plant : Plant
    tap : TapInput
        Its mass, direction and place.
    speed_m_s : ndarray, shape (n,)
        Along the tap, not negative.

    Returns
    -------
    ndarray, shape (n,)
        Along the tap, m/s².
    """
    program = build_law_table(tuple(plant.effects))
    values = parameter_vector(plant, program)
    mass, g, sign = tap.mass_kg, plant.gravity_m_s2, tap.direction
    total, arguments = np.zeros(len(speed_m_s)), np.zeros((len(speed_m_s), 4))
    for effect, spans in zip(program.effects, program.parameter_spans, strict=True):
        laws, p = effect.laws, np.array([values[first] for first, _ in spans])
        body, kinetic = laws.get(LawKind.BODY), laws.get(LawKind.KINETIC)
        if body is not None:
            arguments[:, 0], arguments[:, 1] = tap.start_m, sign * speed_m_s
            arguments[:, 2], arguments[:, 3] = mass, g
            total += sign * values_of_law(address(body), arguments, p) / mass
        if kinetic is not None:
            arguments[:, 0], arguments[:, 1], arguments[:, 2:] = speed_m_s, tap.start_m, 0.0
            total -= g * values_of_law(address(kinetic), arguments, p)
    return total


@compiled
def values_of_law(law: int, arguments: FloatArray, parameters: FloatArray) -> FloatArray:
    """Values of the law at an address, one for each row of four arguments."""
    values, pointer = np.empty(len(arguments)), float_pointer(parameters)
    for i in range(len(arguments)):
        row = arguments[i]
        values[i] = invoke(law, row[0], row[1], row[2], row[3], pointer, 0)
    return values


def linear_resistance(plant: Plant) -> float:
    """Resistance of a plant's effects that grows with speed, as one viscous coefficient (N s/m).

    The chord from rest to `CHORD_SPEED_M_S` of the laws of `LawKind.BODY`, k_v = (F(0) - F(v)) / v: exact
    where they are linear in speed, at the middle of a slide where they are not.
    """
    table = build_law_table(tuple(plant.effects))
    values = parameter_vector(plant, table)
    total = 0.0
    for effect, spans in zip(table.effects, table.parameter_spans, strict=True):
        body = effect.laws.get(LawKind.BODY)
        if body is not None and not effect.columns:
            p = [values[first] for first, _ in spans]
            force = [body(0.0, v, 1.0, plant.gravity_m_s2, p) for v in (0.0, CHORD_SPEED_M_S)]
            total += (force[0] - force[1]) / CHORD_SPEED_M_S
    return float(total)
