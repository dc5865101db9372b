"""Features of a capture, extracted once for all that use them."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ParamSpec, TypeVar

from impactcell.errors import PhysicsError, PredictionError
from impactcell.features.channels import (
    CheckedChannel,
    CheckedForce,
    check_force,
    displacement,
    path_along_tap,
)
from impactcell.features.contact import loss_of_contact, peak_force
from impactcell.features.force_zero import with_zero
from impactcell.features.lost_samples import without_lost_samples
from impactcell.features.measured import MeasuredFeature
from impactcell.features.noise import noise_std
from impactcell.features.segment import SlideSegment, extract_segment
from impactcell.features.slide import SlideFeatures, extract_slide
from impactcell.features.spikes import without_spikes
from impactcell.records import Capture

Fault = PredictionError | PhysicsError
"""Why a feature could not be extracted."""

T = TypeVar("T")
P = ParamSpec("P")


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """What is extracted from a capture; in the place of a feature that it does not show stands the error.

    Attributes
    ----------
    capture : Capture
        From which they are, without its spikes and what was lost.
    force : CheckedForce or Fault
    position : CheckedChannel or Fault
        Displacement from where the part lay, m, positive along +1. Both channels carry their noise.
    peak_force : MeasuredFeature or Fault
        Largest contact force over all contacts, N.
    separation : MeasuredFeature or Fault
        Time at which contact was last lost, s.
    slide : SlideFeatures or Fault
        Distance, deceleration and time of rest of the free slide.
    segment : SlideSegment or Fault
        Block means of the position from separation, or from the start of a record of a part that nothing
        strikes, to just before rest.
    left_out : tuple of str
        What of the capture is in none of them, an offset of the force too.
    """

    capture: Capture
    force: CheckedForce | Fault
    position: CheckedChannel | Fault
    peak_force: MeasuredFeature | Fault
    separation: MeasuredFeature | Fault
    slide: SlideFeatures | Fault
    segment: SlideSegment | Fault
    left_out: tuple[str, ...] = ()


def extract(capture: Capture) -> Features:
    """Extract all features of a capture; nothing is raised for one that does not show them.

    Examples
    --------
    >>> features = extract(Capture(1, 0.05, 18.9, force=None, position=None))
    >>> features.slide
    CaptureError('no position was recorded')
    """
    capture, lost = without_lost_samples(capture)
    capture, spikes = without_spikes(capture)
    force, offset = _attempt(check_force, capture.force), ""
    if isinstance(force, CheckedForce):
        force, offset = with_zero(force)
    position = _attempt(displacement, capture)
    path = position if isinstance(position, Fault) else _attempt(path_along_tap, position, capture.direction)
    peak = force if isinstance(force, Fault) else _attempt(peak_force, force)
    separation = force if isinstance(force, Fault) else _attempt(loss_of_contact, force)
    slide: SlideFeatures | Fault
    if isinstance(path, Fault):
        slide = path
    elif isinstance(separation, Fault):
        slide = separation
    else:
        slide = _attempt(extract_slide, path, separation)
    return Features(
        capture,
        force,
        position,
        peak,
        separation,
        slide,
        _segment(capture, position, separation),
        lost + spikes + ((offset,) if offset else ()),
    )


def required(feature: T | PredictionError | PhysicsError) -> T:
    """Give a feature, or raise why it could not be extracted."""
    if isinstance(feature, (PredictionError, PhysicsError)):
        raise feature
    return feature


def _segment(
    capture: Capture, position: CheckedChannel | Fault, separation: MeasuredFeature | Fault
) -> SlideSegment | Fault:
    """Segment of the slide; of a tap whose force does not tell the separation, or is lost, there is none."""
    if capture.force is None and math.isnan(capture.velocity_m_s):  # nothing strikes: all of it is the slide
        separation_s = None
    elif isinstance(separation, Fault):
        return separation
    else:
        separation_s = separation.value
    if isinstance(position, CheckedChannel):
        sigma = position.sigma
    else:
        sigma = 0.0 if capture.position is None else noise_std(capture.position)
    return _attempt(extract_segment, capture.position, capture.direction, separation_s, sigma)


def _attempt(function: Callable[P, T], *arguments: P.args, **keywords: P.kwargs) -> T | Fault:
    """Give what a function gives, or the error that it raises for a capture."""
    try:
        return function(*arguments, **keywords)
    except (PredictionError, PhysicsError) as fault:
        return fault
