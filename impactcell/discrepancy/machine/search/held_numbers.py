"""What a number that a base model holds would explain if it were off: a late force, a zero, an inertia.

A force that was recorded late looks like its own derivative, an encoder off its centre like a wave of the
angle, a wrong zero like a constant. Each is a column of the regression, and is held against what would be
named, and against a law that nobody had listed.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final

from impactcell.campaign import Coordinate
from impactcell.discrepancy.machine.records.motion_scale import MotionScale
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.regression.block_sums import Blocks, fit_blocks
from impactcell.discrepancy.machine.regression.held_number import DELAY, HeldNumber
from impactcell.discrepancy.machine.regression.held_number_words import (
    larger_or_smaller,
    late_or_early,
    more_or_less,
    off_its_centre,
    two_digits,
)
from impactcell.discrepancy.machine.regression.trials import ChosenTerm, TermSearch, Trial, mean_over_error
from impactcell.discrepancy.machine.regression.weak_form import ECCENTRICITY, INERTIA_BESIDE, Column
from impactcell.discrepancy.machine.search.selection import MIN_GAIN_Z, SelectionStep
from impactcell.discrepancy.machine.search.ties import MIN_TIED_SHARE, TIE_Z, tied_terms
from impactcell.discrepancy.machine.terms.base_model import BaseModel, NumberPrior, Response, TermChoice
from impactcell.records import Samples

NEARLY_ALL = 0.9
"""Share of what remains from which on a force recorded late or early, by however much, is no law."""
FARTHEST_OFF_RAD = 0.05
"""Error of an angle, three degrees, beyond which no encoder that anybody uses turns off its centre."""
FARTHEST_ZERO_RAD = 0.5
"""Error of the zero of an angle beyond which it makes no constant."""
FARTHEST_DELAY_PERIODS = 0.25
"""Delay in periods of the motion beyond which it is not the force's derivative that it adds."""
FARTHEST_SHARE = 0.5
"""Share of a mass, a gain or a torque of gravity by which one who states it may be wrong."""
INERTIA: Final = {
    Coordinate.TRANSLATION: ("a mass", "mass_kg", "kg"),
    Coordinate.ROTATION: ("an inertia", "inertia_kg_m2", "kg m²"),
}
"""What is inert, its key in a base model and its unit."""
MIN_SHARE_BESIDE = 0.5
"""Share of what a term closes by itself that it closes beside a number too, where both are missing [1]."""


def numbers_held(
    base: BaseModel, records: Sequence[UniformRecord], scale: MotionScale
) -> tuple[HeldNumber, ...]:
    """List the numbers that a base model holds and that its records could tell."""
    is_driven = any(record.force.any() for record in records)
    return held_numbers(base, sampling_step_s(records), period_s=scale.period_s, is_driven=is_driven)


def held_numbers(
    base: BaseModel, sample_s: float, *, period_s: float = math.inf, is_driven: bool = True
) -> tuple[HeldNumber, ...]:
    """List the numbers that a base model holds and that records could tell.

    Parameters
    ----------
    base : BaseModel
    sample_s : float
        Between two samples: a delay of less is nobody's to exclude [s].
    period_s : float
        Of the motion.
    is_driven : bool
        Whether a force acts: else only forces over the inertia show.
    """
    turns = base.coordinate is Coordinate.ROTATION
    unit = "N m" if turns else "N"
    numbers = [
        HeldNumber(
            "delay_s", (DELAY,), "a force recorded late or early", late_or_early,
            _nuisance("delay_s: {std: SECONDS}"),
            sample_s, FARTHEST_DELAY_PERIODS * period_s,
        ),
        HeldNumber(
            "force_offset", (_column("force_offset"),), "a constant force",
            lambda size: f"a constant force of {two_digits(size[0])} {unit}", _nuisance("force_offset"),
        ),
    ]  # fmt: skip
    if base.response is Response.FORCE or base.inertia.is_held:  # else without any force nothing is left
        numbers.append(_gain_of_force(base))
    if turns:
        numbers += [
            HeldNumber(
                "position_eccentricity", tuple((ECCENTRICITY, 0.0, number) for number in range(2)),
                "an encoder that turns off its centre", off_its_centre, _nuisance("position_eccentricity"),
                FARTHEST_OFF_RAD, FARTHEST_OFF_RAD,
            ),
            HeldNumber(
                "position_offset", (_column("position_offset"),), "a zero of the angle that is off",
                lambda size: f"a zero of the angle {two_digits(1e3 * abs(size[0]))} mrad off",
                _nuisance("position_offset"), FARTHEST_OFF_RAD, FARTHEST_ZERO_RAD,
            ),
            HeldNumber(
                "gravity_torque", (_column("gravity_torque"),), "another torque of gravity",
                lambda size: f"a torque of gravity {more_or_less(size[0], unit)}",
                "a free gravity_torque_n_m in the base model",
                farthest=FARTHEST_SHARE * abs(base.gravity_torque.value) or math.inf,
                is_absent=not base.has_gravity,
            ),
        ]  # fmt: skip
    if base.inertia.value > 0.0 and is_driven and not _is_one_scale(base):
        numbers.append(_inertia(base))
    if base.inertia.value == 0.0:
        numbers.append(_inertia_of_none(base))
    return tuple(one for one in numbers if _is_held(base, one.name))


def _inertia(base: BaseModel) -> HeldNumber:
    """Inertia by the share that it is off, beside forces of known size."""
    what, key, _ = INERTIA[base.coordinate]
    return HeldNumber(
        "inertia", (_column("inertia"),), f"another {what.split()[1]}",
        lambda size: f"{what} {larger_or_smaller(size[0])}",
        f"a free {key} in the base model", farthest=FARTHEST_SHARE,
    )  # fmt: skip


def _inertia_of_none(base: BaseModel) -> HeldNumber:
    """Inertia by its size, where the base model has none."""
    what, key, unit = INERTIA[base.coordinate]
    return HeldNumber(
        "inertia", (INERTIA_BESIDE,), what,
        lambda size: f"{what} of {two_digits(size[0])} {unit}",
        f"a free {key} above 0 in the base model", is_positive=True,
    )  # fmt: skip


def _gain_of_force(base: BaseModel) -> HeldNumber:
    """Gain of the force, which is the inertia as well where one scales everything else that is free."""
    gain = HeldNumber(
        "force_gain", (_column("force_gain"),), "another gain of the force",
        lambda size: f"a gain of the force {larger_or_smaller(size[0])}", _nuisance("force_gain"),
        farthest=FARTHEST_SHARE,
    )  # fmt: skip
    if not (_is_one_scale(base) and base.inertia.is_held and base.inertia.value > 0.0):
        return gain

    def of_inertia(relative: float) -> float:
        # A force that is predicted grows with the inertia; from a force that is given the motion falls.
        return relative if base.response is Response.FORCE else 1.0 / (1.0 + relative) - 1.0

    inertia, other = _inertia(base), INERTIA[base.coordinate][1]
    return replace(
        gain,
        phrase=f"{gain.phrase} or {inertia.phrase}",
        sized=lambda size: (
            f"{gain.sized(size)}, or {inertia.sized([of_inertia(size[0])])} (these records do not tell which)"
        ),
        other_key=f"a free {other}",
    )


def sampling_step_s(records: Iterable[UniformRecord]) -> float:
    """Longest time between two samples of position or force as they were recorded [s]."""
    return max(record.finer * record.force_span * record.step_s for record in records)


def fitted(
    blocks: Blocks,
    columns: Sequence[Column],
    number: HeldNumber,
    priors: Mapping[Column, NumberPrior],
    nonnegative: frozenset[Column],
) -> tuple[float, ...]:
    """Coefficients of least squares of a number beside a model's columns."""
    fit = fit_blocks(blocks, [*columns, *number.columns], priors, nonnegative)
    return tuple(float(value) for value in fit.coefficients[-len(number.columns) :])


def does_as_well(gains: Samples, other: Samples, least_share: float) -> bool:
    """Whether gains of blocks are, but for chance, as large as others."""
    is_enough = float(gains.sum()) >= least_share * float(other.sum())
    return is_enough and mean_over_error(other - gains) < TIE_Z


def told_from_number(
    search: TermSearch, columns: Sequence[Column], steps: list[SelectionStep], number: HeldNumber
) -> list[SelectionStep]:
    """Refuse the first step of a selection where a number that is off would explain clearly more, or as much.

    The latter only if it is a sensor's, and so small that nobody can exclude it. One that the base model has
    none of is tied. A term that holds beside the number as well is not refused: both are missing.
    """
    if not steps or (best := steps[0].accepted) is None:
        return steps
    before = search.losses(columns)
    gains = before - search.losses([*columns, *number.columns])
    if not (hold(search, gains, before) and does_as_well(gains, best.gains, MIN_TIED_SHARE)):
        return steps
    beside = before - gains
    own = beside - search.losses([*columns, *number.columns, *best.term.columns])
    if not number.is_absent and hold(search, own, beside) and own.sum() >= MIN_SHARE_BESIDE * best.gain:
        return steps
    size = fitted(search.blocks, columns, number, search.priors, search.nonnegative)
    if number.is_possible(size) and mean_over_error(gains - best.gains) >= TIE_Z:
        return [replace(steps[0], accepted=None, tied_with=(), reason=number.better)]
    if number.is_absent:
        rival = ChosenTerm(TermChoice(number.name), 0.0)
        trial = Trial(rival, gains, search.shares(gains, before), at_end=False)
        tied = (*steps[0].tied_with, *tied_terms(search, before, best, [trial]))
        return [replace(steps[0], tied_with=tied), *steps[1:]]
    if math.hypot(*size) > number.largest:
        return steps
    return [replace(steps[0], accepted=None, tied_with=(), reason=number.as_well)]


def _is_one_scale(base: BaseModel) -> bool:
    """Whether gain and inertia are one number: no force of known size acts."""
    return not base.has_gravity or math.isinf(base.gravity_torque.std)


def hold(search: TermSearch, gains: Samples, before: Samples) -> bool:
    """Whether gains hold from block to block, as those of a term have to."""
    return max(mean_over_error(gains), mean_over_error(search.shares(gains, before))) >= MIN_GAIN_Z


def _is_held(base: BaseModel, name: str) -> bool:
    prior: NumberPrior = getattr(base, name)
    return prior.is_held and not (name == "force_offset" and base.force_offset_by_record)


def _column(name: str) -> Column:
    return name, 0.0, 0


def _nuisance(name: str) -> str:
    return f"{name} among the nuisances of the base model"
