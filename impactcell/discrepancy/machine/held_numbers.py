"""What a number that a base model holds would explain if it were off: a late force, a zero, an inertia.

A force that was recorded late looks like its own derivative, an encoder off its centre like a wave of the
angle, a wrong zero like a constant. Each is a column of the regression, and is held against what would be
named, and against a law that nobody had listed.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from impactcell.campaign import Coordinate
from impactcell.discrepancy.machine.base_model import BaseModel, NumberPrior, Response, TermChoice
from impactcell.discrepancy.machine.held_number_words import (
    larger_or_smaller,
    late_or_early,
    more_or_less,
    off_its_centre,
    two_digits,
)
from impactcell.discrepancy.machine.regression import Blocks, fit_blocks
from impactcell.discrepancy.machine.selection import MIN_GAIN_Z, SelectionStep
from impactcell.discrepancy.machine.ties import MIN_TIED_SHARE, TIE_Z, tied_terms
from impactcell.discrepancy.machine.trials import ChosenTerm, TermSearch, Trial, mean_over_error
from impactcell.discrepancy.machine.uniform_records import UniformRecord
from impactcell.discrepancy.machine.weak_form import ECCENTRICITY, Column
from impactcell.records import Samples

DELAY: Column = ("delay_s", 0.0, 0)
"""Column of how late the force was recorded: the force's derivative."""
NEARLY_ALL = 0.9
"""Share of what remains from which on a force recorded late or early, by however much, is no law."""
FARTHEST_OFF_RAD = 0.05
"""Error of an angle, three degrees, beyond which no encoder that anybody uses turns off its centre."""
FARTHEST_ANGLE_RAD = 0.5
"""Error of an angle beyond which a wave of it is not small."""
FARTHEST_SHARE = 0.5
"""Share of a mass, a gain or a torque of gravity by which one who states it may be wrong."""
INERTIA: Final = {
    Coordinate.TRANSLATION: ("a", "mass", "mass_kg"),
    Coordinate.ROTATION: ("an", "inertia", "inertia_kg_m2"),
}
"""What is inert, and its key in a base model."""
MIN_SHARE_BESIDE = 0.5
"""Share of what a term closes by itself that it closes beside a number too, where both are missing [1]."""


@dataclass(frozen=True, slots=True)
class HeldNumber:
    """A number that a base model holds, and how one would speak of it if it were off.

    Attributes
    ----------
    name : str
        Attribute of the base model.
    columns : tuple of Column
    phrase : str
        What would be off.
    sized : callable
        The same with its size, from its coefficients.
    key : str
        Where the base model would leave it free.
    largest : float
        Error of a sensor up to which nobody can exclude it who has not stated it [s or rad]: nothing is named
        that it explains as well. 0 of a number that is none of a sensor.
    farthest : float
        Error beyond which it explains nothing, in the unit of its coefficients: a gain of nought would take
        all force out of a model.
    is_absent : bool
        The base model has none of it: a term that it explains as well is tied with it.
    other_key : str
        Where the base model would leave free what records do not tell from it; empty where there is nothing.
    """

    name: str
    columns: tuple[Column, ...]
    phrase: str
    sized: Callable[[Sequence[float]], str]
    key: str
    largest: float = 0.0
    farthest: float = math.inf
    is_absent: bool = False
    other_key: str = ""

    @property
    def keys(self) -> str:
        """Where the base model would leave it free, or what is not told from it."""
        return f"{self.key} or {self.other_key}" if self.other_key else self.key

    @property
    def is_delay(self) -> bool:
        """Whether it is how late the force was recorded, which is looked for within a prior only."""
        return self.columns == (DELAY,)

    @property
    def as_well(self) -> str:
        """Why a term is not taken that explains no more."""
        least = " by less than a sample" if self.is_delay else ""
        return f"{self.phrase}{least} would explain as much as the best term"

    @property
    def better(self) -> str:
        """Why a term is not taken that explains less."""
        return f"{self.phrase} would explain more than the best term"

    @property
    def as_a_law(self) -> str:
        """Why no law is proposed that explains no more."""
        return (
            f"{self.phrase} does as well as any function of speed, load or position; {self.keys} would tell"
        )

    @property
    def beside_a_law(self) -> str:
        """What is told of a law that was found with this number left free."""
        return (
            f"A{self.phrase[1:]} explains nearly all that any function of speed, load or position would; "
            f"the law is of what is left beside it, and has {self.key}."
        )

    def freed(self, base: BaseModel) -> BaseModel:
        """Leave the number free."""
        prior: NumberPrior = getattr(base, self.name)
        changed: BaseModel = replace(base, **{self.name: replace(prior, std=math.inf)})  # type: ignore[arg-type]
        return changed


def held_numbers(base: BaseModel, sample_s: float) -> tuple[HeldNumber, ...]:
    """List the numbers that a base model holds and that records could tell.

    Parameters
    ----------
    base : BaseModel
    sample_s : float
        Between two samples: a delay of less is nobody's to exclude [s].
    """
    turns = base.coordinate is Coordinate.ROTATION
    unit = "N m" if turns else "N"
    numbers = [
        HeldNumber(
            "delay_s", (DELAY,), "a force recorded late or early", late_or_early,
            _nuisance("delay_s: {std: SECONDS}"),
            sample_s,
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
                FARTHEST_OFF_RAD, FARTHEST_ANGLE_RAD,
            ),
            HeldNumber(
                "position_offset", (_column("position_offset"),), "a zero of the angle that is off",
                lambda size: f"a zero of the angle {two_digits(1e3 * abs(size[0]))} mrad off",
                _nuisance("position_offset"), FARTHEST_OFF_RAD, FARTHEST_ANGLE_RAD,
            ),
            HeldNumber(
                "gravity_torque", (_column("gravity_torque"),), "another torque of gravity",
                lambda size: f"a torque of gravity {more_or_less(size[0], unit)}",
                "a free gravity_torque_n_m in the base model",
                farthest=FARTHEST_SHARE * abs(base.gravity_torque.value) or math.inf,
                is_absent=not base.has_gravity,
            ),
        ]  # fmt: skip
    if base.response is Response.FORCE and base.inertia.value > 0.0 and not _is_one_scale(base):
        article, word, key = INERTIA[base.coordinate]
        numbers.append(
            HeldNumber(
                "inertia", (_column("inertia"),), f"another {word}",
                lambda size: f"{article} {word} {larger_or_smaller(size[0])}",
                f"a free {key} in the base model", farthest=FARTHEST_SHARE,
            )
        )  # fmt: skip
    return tuple(one for one in numbers if _is_held(base, one.name))


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

    article, word, key = INERTIA[base.coordinate]
    return replace(
        gain,
        phrase=f"{gain.phrase} or another {word}",
        sized=lambda size: (
            f"{gain.sized(size)}, or {article} {word} {larger_or_smaller(of_inertia(size[0]))} "
            "(these records do not tell which)"
        ),
        other_key=f"a free {key}",
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
    size = math.hypot(*fitted(search.blocks, columns, number, search.priors, search.nonnegative))
    if size <= number.farthest and mean_over_error(gains - best.gains) >= TIE_Z:
        return [replace(steps[0], accepted=None, tied_with=(), reason=number.better)]
    if number.is_absent:
        rival = ChosenTerm(TermChoice(number.name), 0.0)
        trial = Trial(rival, gains, search.shares(gains, before), at_end=False)
        tied = (*steps[0].tied_with, *tied_terms(search, before, best, [trial]))
        return [replace(steps[0], tied_with=tied), *steps[1:]]
    if size > number.largest:
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
