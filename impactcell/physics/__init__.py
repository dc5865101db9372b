"""The plant: one tap of an actuator on a part that slides and stops, integrated from event to event.

One tap, with its events, outputs and samples::

    plant = Plant(6.5e5, 465.0, mu_s=0.2, mu_k=0.152, effects={"surface_tilt": {"tilt_rad": 0.002}})
    motion = simulate_tap(plant, TapInput(velocity_m_s=0.05, mass_kg=18.9, stroke_m=1.5e-3))
    motion.peak_force_n, motion.sliding_distance_m, motion.displacement_m, motion.events
    motion.sample(time_s).force_n

Positions count from where the part lay, positive along +1, whatever `start_m` is; the laws of effects see the
position on the table. `simulate_free_slide` is the same without an actuator, `simulate_driven` under a
measured force.

For fits and planners, `Ensemble` integrates many taps for a vector of parameters in one compiled call, at
some tens of microseconds a tap:

>>> import numpy as np
>>> taps = [TapInput(v, 18.9, 1.5e-3, direction=s) for v in (0.04, 0.06, 0.09) for s in (1, -1)]
>>> times = [np.arange(1, 1200) * 1e-4] * len(taps)
>>> ensemble = Ensemble(taps, ["viscous_friction"], force_time_s=times, position_time_s=times)
>>> ensemble.names[2:]
('mu_s', 'mu_k', 'viscous_friction.viscous_coefficient_n_s_per_m')
>>> theta = np.array([6.5e5, 465.0, 0.2, 0.152, 85.0])
>>> factors = np.ones(len(taps))  # one friction factor a shot
>>> ensemble.traces(theta, factors).force_n.shape  # all taps end to end
(7194,)
>>> ensemble.sensitivities(theta, ["mu_k", "friction_factor"], factors).position_m.shape
(2, 7194)
>>> ensemble.outputs(theta).peak_force_n.round(1)  # no sampling: planners, calibration
array([156.1, 156.1, 219.8, 219.8, 315.6, 315.6])

Parameters may also be one vector a tap, shape (n, len(names)); `ensemble.parameters(plant)` makes a vector of
a `Plant`. Samples are smooth in the parameters while the sequence of events is unchanged.

`impactcell.physics.effects.LIBRARY` holds every effect by its identifier; a new effect is one new file there.
"""

from impactcell.physics.effect import Effect, Kind, LawKind, Parameter, ParameterKind, Phase
from impactcell.physics.ensemble import Ensemble
from impactcell.physics.motion import ChannelSamples, Motion, TapEvent, TapEventKind, TapOutputs, Traces
from impactcell.physics.plant import Plant, TapInput
from impactcell.physics.simulate import simulate_driven, simulate_free_slide, simulate_tap

__all__ = [
    "ChannelSamples",
    "Effect",
    "Ensemble",
    "Kind",
    "LawKind",
    "Motion",
    "Parameter",
    "ParameterKind",
    "Phase",
    "Plant",
    "TapEvent",
    "TapEventKind",
    "TapInput",
    "TapOutputs",
    "Traces",
    "simulate_driven",
    "simulate_free_slide",
    "simulate_tap",
]
