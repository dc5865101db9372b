"""What a fit says of its record: a channel that is late, or does not stand at zero, by what it would explain.

A channel that is late by tau shows f(t - tau), nearly f - tau f': its rate of change, which the model tells,
is the shape of the fault. A late position and static friction look alike at the begin of a tap, which is why
such a tap fits, with a wrong mu_s. Each shape is eliminated from the fit as one more unknown (a score test,
Rao 1948); what its sum of squares falls by, all else fitted anew, is chi-square distributed with one degree
of freedom where there is no fault. Friction that is larger in slow slip than the model's bends the begin of a
tap as a late position does, and nobody should look for that in a filter: it is one more shape.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from impactcell.prediction.block_residuals import rates_of_change
from impactcell.prediction.linearised_model import MU_K, RATIO, LinearisedModel
from impactcell.prediction.posterior import TruncatedGaussian
from impactcell.prediction.tap_problem import GaussianPrior, Minimum, TapProblem
from impactcell.records import Samples

LATE_S, ZERO_N, ZERO_M = 3e-4, 3.0, 3e-5
"""Usual sizes of these faults: latency of a filter or an interface, offset of the force and of position."""
SLOW_INCREASE, SLOW_M_S = 0.01, 3e-3
"""Usual increase of mu_k in slow slip, and what speed it fades over: of one that fades over 1 to 5 mm/s that
explains nine tenths of what the right speed would. Our choice."""
MIN_FALL = 20.0
"""Fall of the sum of squares from which on it is no chance: 4.5 standard deviations, once in 1e5 taps. Of two
that are none, a difference below this does not tell which it is."""
MIN_TOGETHER = 10.0
"""Fall by all faults of a record from which on friction in slow slip is tried, which costs a linear model: in
one of 25 taps that fit. Where that fell by 20 it was 12 and more."""
MIN_ONSET_FALL = 30.0
"""The same of a first contact that lies elsewhere, which costs whole fits to try."""
MIN_MOVED_STD = 2.0
"""What it has to move mu_s or mu_k by, in standard deviations, in a tap that fits without it. Our choice:
what matters less is no reason to doubt a tap."""
MIN_EXPLAINED = 0.5
"""Share of what noise does not explain of a missed tap that it has to promise: trying it costs a fit."""


@dataclass(frozen=True, slots=True, eq=False)
class RecordFault:
    """A fault of the record, or what looks like one.

    Attributes
    ----------
    shape : ndarray, shape (n,)
        What a fault of the usual size adds to the blocks, N and m.
    text, opposite : str
        What is to be said of it and of its opposite, each with a place for its size.
    scale : float
        Its usual size, in the unit of the text.
    beside : str
        What it may be as well.
    """

    shape: Samples
    text: str
    opposite: str
    scale: float
    beside: str = ""

    def said(self, size: float) -> str:
        """Say it of a size, in usual ones."""
        return (self.text if size > 0.0 else self.opposite).format(abs(self.scale * size))

    def told(self, response: LinearisedModel, fitted: Minimum) -> str:
        """Say it, with the size that it has in a fit with it."""
        own = self.said(response.size_of(self.shape, fitted.residual))
        return f"{own}; {self.beside}" if self.beside else own


def begun_at(onset_us: float) -> str:
    """Say where first contact lies, by a fit."""
    side = "after" if onset_us > 0.0 else "before"
    return f"as if first contact lay {abs(onset_us):.2g} µs {side} t = 0: check the trigger"


def record_fault(
    response: LinearisedModel, prior: GaussianPrior, at: Minimum, *, fits: bool
) -> RecordFault | None:
    """Give the fault that explains most, where it is no chance, and what explains as much; None without one.

    Parameters
    ----------
    response : LinearisedModel
    prior : GaussianPrior
    at : Minimum
        Of the fit without any.
    fits : bool
        Whether that explains the tap: then a fault has to matter for friction.
    """
    faults = _faults(response, at)
    plain = at.truncated(prior)
    shown, together = _score(response, plain, at, np.array([fault.shape for fault in faults]))
    if not together > MIN_TOGETHER:
        return None
    slow = _slow_slip(response, prior, at)
    (slow_shown,), _ = _score(response, plain, at, slow.shape[None])
    of_record = max(zip(shown, faults, strict=True), key=_fall)
    other, (likeliest, fault) = sorted([of_record, (slow_shown, slow)], key=_fall)
    matters = _moved_stds(plain, likeliest) >= MIN_MOVED_STD if fits else likeliest.fall >= _unexplained(at)
    if not (likeliest.fall > MIN_FALL and matters):
        return None
    if other[0].fall > max(MIN_FALL, likeliest.fall - MIN_FALL):
        return replace(fault, beside=f"or {other[1].said(other[0].size)}")
    return fault


def may_have_begun_elsewhere(
    response: LinearisedModel, prior: GaussianPrior, at: Minimum, onset_std_s: float
) -> bool:
    """Whether a first contact that lies elsewhere promises something of a missed tap: all is late alike.

    It promises little of what it explains, a jump where there is another by the model; what a model lacks
    promised less than 30 in 60 taps, a trigger 60 µs off 77 and more.
    """
    late = -onset_std_s * np.append(*_rates(response, at))
    _, fall = _score(response, at.truncated(prior), at, late[None])
    return fall > MIN_ONSET_FALL


def _unexplained(at: Minimum) -> float:
    """Give the part that has to be explained of what chi2 is beyond its degrees of freedom."""
    return MIN_EXPLAINED * (at.chi2 - (len(at.residual) - len(at.theta)))


def _rates(response: LinearisedModel, at: Minimum) -> tuple[Samples, Samples]:
    """Rates of change of force [N/s] and position [m/s] at the blocks, by the model."""
    force, position = response.modelled(at.residual)
    return (
        rates_of_change(response.force_time_s, force),
        rates_of_change(response.position_time_s, position),
    )


def _faults(response: LinearisedModel, at: Minimum) -> list[RecordFault]:
    rise, speed = _rates(response, at)
    no_force, no_position = np.zeros_like(rise), np.zeros_like(speed)
    position_late = "as if position were recorded {:.2g} µs late against force: check its filter and clock"
    force_late = "as if force were recorded {:.2g} µs late against position: check its filter and clock"
    force_off = "as if force stood {:.2g} N off its zero: tare its sensor"
    position_off = "as if position stood {:.2g} µm off its zero: check where it is counted from"
    late_us, zero_um = 1e6 * LATE_S, 1e6 * ZERO_M
    return [
        RecordFault(np.append(no_force, -LATE_S * speed), position_late, force_late, late_us),
        RecordFault(np.append(-LATE_S * rise, no_position), force_late, position_late, late_us),
        RecordFault(np.append(no_force + ZERO_N, no_position), force_off, force_off, ZERO_N),
        RecordFault(np.append(no_force, no_position + ZERO_M), position_off, position_off, zero_um),
    ]


def _slow_slip(response: LinearisedModel, prior: GaussianPrior, at: Minimum) -> RecordFault:
    """Give friction that is larger in slow slip than the model's, as one more shape."""
    effects = response.plant.effects
    law = {
        "friction_increase": 0.0,
        "stribeck_velocity_m_s": SLOW_M_S,
        **effects.get("stribeck_friction", {}),
    }
    law["friction_increase"] = float(np.mean(law["friction_increase"])) + SLOW_INCREASE
    plant = replace(response.plant, effects={**effects, "stribeck_friction": law})
    slower = TapProblem(response.with_effects_of(plant), prior, at.side).linearise(at.theta)
    shape = np.append(*response.curves(slower.linear)) - np.append(*response.curves(at.linear))
    text = "as if friction were {:.1g} %s in slow slip, its first and last mm/s: run `impactcell discrepancy`"
    return RecordFault(shape, text % "larger", text % "smaller", SLOW_INCREASE)


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """What one more unknown does to a fit: what the sum of squares falls by, its size, how theta is moved."""

    fall: float
    size: float
    moved: Samples


def _fall(pair: tuple[_Shown, RecordFault]) -> float:
    return pair[0].fall


def _score(
    response: LinearisedModel, plain: TruncatedGaussian, at: Minimum, shapes: Samples
) -> tuple[list[_Shown], float]:
    """Give what each of the disturbances D, (d, n), does to a fit, and what the fit gains by all of them.

    With derivative J, covariance C and residuals r at the quadratic's minimum each has D r to show, of
    variance S = D D' + 1 - D J C J' D': the fall is (D r)' S^-1 (D r), and a size u moves theta by C J' D' u.
    """
    with_residual, with_derivative, with_each_other = response.products_with(shapes, at.linear)
    with_residual = with_residual + with_derivative @ (plain.mean - at.theta)
    moves = with_derivative @ plain.covariance
    variance = with_each_other + np.eye(len(shapes)) - moves @ with_derivative.T
    together = float(with_residual @ np.linalg.solve(variance, with_residual))
    sizes = with_residual / variance.diagonal()
    shown = [
        _Shown(float(r * u), float(u), u * move)
        for r, u, move in zip(with_residual, sizes, moves, strict=True)
    ]
    return shown, together


def _moved_stds(plain: TruncatedGaussian, shown: _Shown) -> float:
    """By how many of its standard deviations ln mu_s or ln mu_k is moved, whichever is more."""
    moved = []
    for mu in (MU_K,), (MU_K, RATIO):
        form = np.zeros(len(plain.mean))
        form[list(mu)] = (1.0, -1.0)[: len(mu)]
        std = math.sqrt(max(float(form @ plain.covariance @ form), 1e-30))
        moved.append(abs(float(form @ shown.moved)) / std)
    return max(moved)
