"""Whether force, position, mass and time of one tap belong together, whatever the plant is.

From first contact to the last separation the contact force F gives the part of mass m its momentum against
friction, which goes on to brake it by a = mu_k g:

    integral of F dt = m (v_sep + a t_sep)    with v_sep² = 2 a d, from rest after the distance d,

however stiff or damped the contact is. Before breakaway static friction takes up to mu_s/mu_k of the second
term, so that only a tap is judged in which friction takes less than half. A wrong unit, scale or sampling
rate of one of them leaves nothing of the kind.
"""

import math
from typing import Final

import numpy as np

from impactcell.errors import ClippedForceError
from impactcell.features.channels import MIN_MOTION_STD, rest_samples
from impactcell.features.contact import MIN_CONTACT_STD
from impactcell.features.extraction import Features

OUT_OF_BALANCE: Final = 1.5
"""Factor between both sides beyond which something is wrong: the smallest usual mistake is one of 2 [1]."""


def doubts(features: Features) -> tuple[str, ...]:
    """Say what of a tap cannot be, each with the way out; empty where nothing is doubted, or can be told."""
    found = [_sign_of_force(features), _sign_of_position(features), _balance(features)]
    return tuple(text for text in found if text)


def pull_n(features: Features) -> float:
    """Give with how much a force pulls, where a contact only pushes; 0 where it pushes, or cannot be told."""
    force = features.force
    if isinstance(force, Exception):
        return 0.0
    least, most = float(force.smooth.min()), float(force.smooth.max())
    return 0.0 if -least < MIN_CONTACT_STD * force.sigma or -least < 2.0 * most else -least


def moved_back_m(features: Features) -> float:
    """Give how far the part moved against its tap; 0 where it did not, or cannot be told."""
    position = features.position
    if isinstance(position, Exception):
        return 0.0
    few = rest_samples(len(position.values))
    way = float(np.mean(position.values[-few:]) - np.mean(position.values[:few]))
    moved = features.capture.direction * way
    return 0.0 if moved > -MIN_MOTION_STD * position.sigma else -moved


def _sign_of_force(features: Features) -> str:
    pull = pull_n(features)
    if not pull:
        return ""
    return (
        f"force pulls with {pull:.4g} N, where a contact only pushes: turn its sign in the module or at "
        "its amplifier"
    )


def _sign_of_position(features: Features) -> str:
    back_m, direction = moved_back_m(features), features.capture.direction
    if not back_m:
        return ""
    return (
        f"the part moved {1e3 * back_m:.4g} mm against the tap's direction {direction:+d}: turn the sign of "
        "position in the module, or put direction right"
    )


def _balance(features: Features) -> str:
    slide, force, mass_kg = features.slide, features.force, features.capture.mass_kg
    if isinstance(slide, Exception) or isinstance(force, Exception):
        return ""
    if isinstance(features.peak_force, ClippedForceError):  # what is cut off lacks in the impulse
        return ""
    braking, distance = slide.deceleration.value, slide.distance.value
    if not (mass_kg > 0.0 and braking > 0.0 and distance > 0.0):
        return ""
    speed, braked = math.sqrt(2.0 * braking * distance), braking * slide.separation_s
    if speed < braked:
        return ""
    touching = (force.time_s >= 0.0) & (force.time_s <= slide.separation_s)
    pushed = float(np.trapezoid(force.values[touching], force.time_s[touching]))
    taken = mass_kg * (speed + braked)
    if taken / OUT_OF_BALANCE <= pushed <= OUT_OF_BALANCE * taken:
        return ""
    return (
        f"force gave the part {pushed:.3g} N s, its motion shows {taken:.3g} N s: see unit and scale of "
        "force, position and mass, and the sampling rates"
    )
