"""What the model says a capture should be: blocks of force and position for given parameters, and residuals.

theta = ln(mu_k, mu_k / mu_s, k, b). Relative steps in it are of one size whatever the units.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.physics import Plant, Strike, strike
from impactcell.prediction.blocks import (
    FINE_FORCE_BLOCK_S,
    FINE_POSITION_BLOCK_S,
    FORCE_BLOCK_S,
    NOTHING,
    POSITION_BLOCK_S,
    Blocks,
    blocks,
)
from impactcell.records import Capture, Samples

MU_K, RATIO, STIFFNESS, DAMPING = range(4)
PARAMETERS = 4
STEP = 1e-5
JUST_SLIPPING = -1e-7
"""z at which mu_s m g lies just below the damper's first force: breakaway is immediate."""
KINK_SPAN_S = 1.5e-4


def commanded(capture: Capture) -> Strike:
    """Turn a capture's command into a tap for the model; without a stroke the actuator halts by itself."""
    return Strike(
        velocity_m_s=capture.velocity_m_s,
        mass_kg=capture.mass_kg,
        stroke_m=capture.stroke_m,
        direction=capture.direction,
        halts_at_separation=math.isinf(capture.stroke_m),
        start_m=capture.start_m,
        dwell_s=capture.dwell_s,
    )


def with_parameters(plant: Plant, theta: Samples) -> Plant:
    """Give a plant the parameters `theta`, shape (4,)."""
    mu_k, ratio, stiffness, damping = np.exp(theta).tolist()
    return replace(
        plant, stiffness_n_per_m=stiffness, damping_n_s_per_m=damping, mu_s=mu_k / ratio, mu_k=mu_k
    )


def parameters(plant: Plant) -> Samples:
    """Nominal parameters of a plant, shape (4,)."""
    return np.log(
        [plant.mu_k, plant.mu_k / plant.mu_s, plant.stiffness_n_per_m, max(plant.damping_n_s_per_m, 1e-6)]
    )


@dataclass(frozen=True, slots=True, eq=False)
class Response:
    """A capture in blocks, and the model that should reproduce them.

    Attributes
    ----------
    plant, tap : Plant, Strike
    force, position : Blocks
    """

    plant: Plant
    tap: Strike
    force: Blocks
    position: Blocks

    @property
    def size(self) -> int:
        """Number of residuals."""
        return len(self.force.values) + len(self.position.values)

    def kink(self, theta: Samples) -> float:
        """Give z = ln(mu_s m g / (b v)), positive where the part sticks first."""
        weight = self.tap.mass_kg * self.plant.gravity_m_s2 / self.tap.velocity_m_s
        return float(theta[MU_K] - theta[RATIO] - theta[DAMPING]) + math.log(weight)

    def residuals(self, theta: Samples, side: int = 0) -> Samples:
        """Normalised residuals, data minus model, shape (n,).

        Parameters
        ----------
        theta : ndarray, shape (4,)
        side : int
            -1: as if breakaway were immediate, whatever mu_s. 0 or +1: as the parameters say.
        """
        plant = with_parameters(self.plant, theta)
        if side < 0 and (above := self.kink(theta) - JUST_SLIPPING) > 0.0:
            plant = replace(plant, mu_s=plant.mu_s * math.exp(-above))
        motion = strike(plant, self.tap)
        force = motion.sample(self.force.time_s).force_n if len(self.force.time_s) else self.force.values
        position = motion.sample(self.position.time_s).position_m
        return np.concatenate(
            [
                (self.force.values - force) / self.force.std,
                (self.position.values - position) / self.position.std,
            ]
        )

    def jacobian(self, theta: Samples, residual: Samples, side: int = 0) -> Samples:
        """Differentiate the residuals, shape (n, 4), by steps that lead away from the kink."""
        columns = []
        for index, sign in ((MU_K, 1.0), (RATIO, -1.0), (STIFFNESS, 1.0), (DAMPING, -1.0)):
            if side < 0 and index == RATIO:
                columns.append(np.zeros(self.size))
                continue
            moved = theta.copy()
            moved[index] += sign * STEP
            columns.append((self.residuals(moved, side) - residual) / (sign * STEP))
        return np.column_stack(columns)


def respond(capture: Capture, plant: Plant, separation_s: float) -> Response:
    """Average a capture over blocks, fine where `plant` has its events and contact was lost.

    Parameters
    ----------
    capture : Capture
        With a position channel, a mass and a velocity; its force may be missing.
    plant : Plant
        Near enough for its events to tell where the kinks are.
    separation_s : float
        Last loss of contact as read off the force; nan where it was not.
    """
    tap = commanded(capture)
    motion = strike(plant, tap)
    kinks = [event.time_s for event in motion.events]
    if math.isfinite(separation_s):
        kinks.append(separation_s)
    spans = [(time - KINK_SPAN_S, time + KINK_SPAN_S) for time in kinks]
    halt = tap.stroke_m / tap.velocity_m_s
    edges = [halt] if math.isfinite(halt) else []
    force = NOTHING
    if capture.force is not None:
        force = blocks(capture.force, FORCE_BLOCK_S, FINE_FORCE_BLOCK_S, spans, edges)
    if capture.position is None:
        position = NOTHING
    else:
        position = blocks(capture.position, POSITION_BLOCK_S, FINE_POSITION_BLOCK_S, spans)
    return Response(plant, tap, force, position)
