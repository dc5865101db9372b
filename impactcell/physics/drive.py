"""A part driven by a measured force, without an actuator."""

import numpy as np

from impactcell.physics.ensemble import Ensemble
from impactcell.physics.motion import Sampled
from impactcell.physics.plant import Plant, Strike
from impactcell.records import Samples


def drive(
    plant: Plant,
    tap: Strike,
    time_s: Samples,
    force_n: Samples,
    sample_s: Samples,
    initial_speed_m_s: float = 0.0,
) -> Sampled:
    """Let a measured force along +1 drive the part, which sticks and slips under it.

    Parameters
    ----------
    plant, tap
        Of the tap its mass, start and covariates; velocity, stroke and direction mean nothing here.
    time_s, force_n : ndarray, shape (n,)
        The force as measured, linear between its ascending times. Laws of the force sensor are undone to
        find the force that acts; where it saturates nothing can be undone.
    sample_s : ndarray, shape (m,)
        Ascending times at which to sample; the motion begins at `time_s[0]`.
    initial_speed_m_s : float
        Along +1.

    Returns
    -------
    Sampled
        `force_n` repeats the driving force; the actuator is nan.

    Raises
    ------
    PhysicsError
        For effects or parameters that do not exist, and times that do not ascend.
    """
    ensemble = Ensemble(
        [tap],
        tuple(plant.effects),
        position_time_s=[sample_s],
        velocity_time_s=[sample_s],
        gravity_m_s2=plant.gravity_m_s2,
        initial_speed_m_s=np.array([initial_speed_m_s]),
        drives=[(time_s, force_n)],
    )
    traces = ensemble.traces(ensemble.parameters(plant))
    return Sampled(
        force_n=np.interp(sample_s, time_s, force_n),
        position_m=traces.position_m,
        actuator_m=np.full(len(sample_s), np.nan),
        velocity_m_s=traces.velocity_m_s,
    )
