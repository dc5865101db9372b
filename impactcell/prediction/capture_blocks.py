"""A capture in blocks, fine where the model has its kinks, beside the model that should reproduce them."""

import math
from dataclasses import replace

import numpy as np

from impactcell.features import CheckedChannel, Features, required
from impactcell.features.contact import contact_spells
from impactcell.physics import Plant, TapEventKind, TapInput, simulate_tap
from impactcell.physics.local_friction import friction_factor
from impactcell.prediction.block_averaging import (
    FINE_FORCE_BLOCK_S,
    FINE_POSITION_BLOCK_S,
    FORCE_BLOCK_S,
    POSITION_BLOCK_S,
    average_blocks,
)
from impactcell.prediction.linearised_model import (
    LATEST_ONSET,
    MASS,
    PARAMETERS,
    VELOCITY,
    LinearisedModel,
    RecorderStd,
    with_parameters,
)
from impactcell.records import AT_THE_HALT_S, Capture, Samples

KINK_SPAN_S = 1.5e-4
"""How far to either side of an event of the start, s, blocks are short: the fit has its event there. With
half of it, twice and four times the errors of mu_s are the same to 1e-3 of themselves."""

JUMP_SPAN_S = 1e-4
"""How far to either side of a jump of the force, s, where a part is met again, blocks say nothing: a few
times how well it is known when that is. A sample that the jump crosses is off by a hundred times the noise,
and its slope is that of a wall."""
MAX_CHANGING, LEAST_RUN = 0.75, 2
"""Share of samples that differ from the one before above which a raster hides in the noise, and samples on
one step from which on they count as one. Our choice."""
LEFT_OUT = 1e3
"""Factor of the standard deviation of blocks that are left out of a fit."""


def tap_input(capture: Capture) -> TapInput:
    """Turn a capture's command into a tap for the model; without a stroke the actuator halts by itself."""
    return TapInput(
        velocity_m_s=capture.velocity_m_s,
        mass_kg=capture.mass_kg,
        stroke_m=capture.stroke_m,
        direction=capture.direction,
        halts_at_separation=math.isinf(capture.stroke_m),
        start_m=capture.start_m,
        dwell_s=capture.dwell_s,
    )


def friction_factor_of(capture: Capture, plant: Plant) -> float:
    """Give by what the friction of a plant is multiplied where the tap of a capture began."""
    return friction_factor(plant, tap_input(capture))


def halts_in_contact(capture: Capture, plant: Plant, theta: Samples) -> bool:
    """Whether the actuator ends its stroke before contact is lost, in a tap with these parameters.

    Only these tell: by a velocity as it was told the two may be in the other order, where they are close.
    """
    tap = tap_input(capture)
    if len(theta) > PARAMETERS:
        mass_kg = tap.mass_kg * math.exp(capture.mass_std * theta[MASS])
        velocity_m_s = tap.velocity_m_s * math.exp(capture.velocity_std * theta[VELOCITY])
        tap = replace(tap, mass_kg=mass_kg, velocity_m_s=velocity_m_s)
    touches = True
    for event in simulate_tap(with_parameters(plant, theta), tap).events:
        if event.kind is TapEventKind.HALT:
            return touches
        if event.kind in (TapEventKind.SEPARATION, TapEventKind.CONTACT):
            touches = event.kind is TapEventKind.CONTACT
    return False


def recorder_std_of(capture: Capture) -> RecorderStd:
    """Give the standard deviations of what a record does not tell exactly."""
    scales = capture.force_scale_std, capture.position_scale_std
    return capture.onset_std_s, capture.mass_std, capture.velocity_std, *scales


def linearised_model(features: Features, plant: Plant) -> LinearisedModel:
    """Average a capture over blocks, fine where `plant` has its events and contact was lost.

    Parameters
    ----------
    features : Features
        Of a capture with force, position, a mass and a velocity.
    plant : Plant
        Near enough for its events to tell where the kinks are.

    Raises
    ------
    PredictionError, PhysicsError
        The capture does not show its slide, or the plant has no motion.
    """
    tap, recorder_std = tap_input(features.capture), recorder_std_of(features.capture)
    onset_std_s, *_ = recorder_std
    motion = simulate_tap(plant, tap)
    kinks = [*(event.time_s for event in motion.events), required(features.separation).value]
    spans = [(time - KINK_SPAN_S, time + KINK_SPAN_S) for time in kinks]
    halt_s = features.capture.halt_s
    edges = [halt_s] if math.isfinite(halt_s) else []
    whole_force, whole_position = required(features.force), required(features.position)
    pressed = _surely_touching(whole_force.after_contact(), onset_std_s)
    force = average_blocks(pressed, FORCE_BLOCK_S, FINE_FORCE_BLOCK_S, spans, edges)
    jumps = [event.time_s for event in motion.events if event.kind is TapEventKind.CONTACT]
    if jumps or edges:
        factors = _std_factors_at_jumps(force.time_s, jumps, JUMP_SPAN_S)
        factors *= _std_factors_at_jumps(force.time_s, edges, AT_THE_HALT_S)
        force = replace(force, std=force.std * factors)
    moved = _surely_touching(whole_position, onset_std_s)
    position = average_blocks(moved, POSITION_BLOCK_S, FINE_POSITION_BLOCK_S, spans)
    position = replace(position, std=position.std * _std_factors_of_runs(moved, position.time_s))
    zero_std = whole_force.zero_std, whole_position.zero_std
    return LinearisedModel(plant, tap, force, position, recorder_std, zero_std)


def until_next_contact(response: LinearisedModel, features: Features) -> LinearisedModel:
    """Leave out all that comes after the part is met again; the model itself where it is not.

    When it is met again depends on all before: by a rough start at some other time, or never, and from there
    no step leads to where it was.
    """
    spells = contact_spells(required(features.force))
    if len(spells) < 2:
        return response
    met_s, _ = spells[1]
    times = np.concatenate([response.force_time_s, response.position_time_s])
    return response.reweighted(np.where(times < met_s - JUMP_SPAN_S, 1.0, LEFT_OUT))


def _surely_touching(channel: CheckedChannel, onset_std_s: float) -> CheckedChannel:
    """Leave out the samples that may lie before first contact."""
    if not onset_std_s:
        return channel
    since = slice(int(np.searchsorted(channel.time_s, LATEST_ONSET * onset_std_s, "right")), None)
    return replace(channel, time_s=channel.time_s[since], values=channel.values[since])


def _std_factors_of_runs(channel: CheckedChannel, times: Samples) -> Samples:
    """Factor by which a raster makes blocks uncertain: what stands on one step is rounded by the same.

    A run of n equal samples tells no more than one of them, with the rounding error of one.
    """
    is_new = channel.values[1:] != channel.values[:-1]
    if np.count_nonzero(is_new) > MAX_CHANGING * len(is_new):
        return np.ones_like(times)
    run = np.append(0, np.cumsum(is_new))
    length = np.bincount(run)[run[np.searchsorted(channel.time_s, times).clip(max=len(run) - 1)]]
    return np.where(length >= LEAST_RUN, np.sqrt(length), 1.0)


def _std_factors_at_jumps(times: Samples, jumps: list[float], within_s: float) -> Samples:
    """Factor that takes blocks about a jump out of the fit: their means depend on where in them it lies."""
    factor = np.ones_like(times)
    for jump in jumps:
        factor[np.abs(times - jump) < within_s] = LEFT_OUT
    return factor
