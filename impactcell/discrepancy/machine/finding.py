"""What an investigation with a base model found: models before and after, and the proof."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from impactcell.discrepancy.data import MIN_HELD_OUT, MIN_TRAINING
from impactcell.discrepancy.laws import FittedFunction
from impactcell.discrepancy.machine.evidence import ClearStrength, FallOfGap
from impactcell.discrepancy.machine.fits.fitted_model import FittedModel
from impactcell.discrepancy.machine.fits.remainder import Remainder
from impactcell.discrepancy.machine.open_loop_error import BetterSimulation, OpenLoopError
from impactcell.discrepancy.machine.records.motion_scale import MotionScale
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.regression.block_sums import Blocks
from impactcell.discrepancy.machine.regression.trials import ChosenTerm
from impactcell.discrepancy.machine.search.selection import SelectionStep
from impactcell.discrepancy.machine.terms.base_model import BaseModel, Response, TermChoice
from impactcell.discrepancy.machine.terms.law_terms import listed_term
from impactcell.discrepancy.search import Proposal
from impactcell.german.open_loop import POOR_FIT_PERCENT

LEAST_GAP = 0.5
"""Gap below which the noise is less than half of what it was taken for [1]."""
FAR_ABOVE_NOISE = 2.0
"""Error of a simulated position over the sensor's noise from which on it is no noise [1]."""


@dataclass(frozen=True, slots=True, eq=False)
class MachineLaw:
    """A function that the catalogue does not have, where something remains.

    Attributes
    ----------
    place : str
        Identifier of the place where it acts.
    tested : mapping
        By covariate, the range that was gone through.
    spline : FittedFunction
        Spline in that place, with its 95 % band; of two covariates along the first, at one of the second.
    choice : TermChoice or None
        Functional form that does as well as a spline; None where only the spline does.
    equivalents : tuple of str
        Other forms that the records cannot tell from it.
    rival_places : tuple of str
        Other places at which a spline does as well.
    without, model : FittedModel
        Without and with it; with the form where there is one, else with the spline.
    fall : FallOfGap
        Of the held-out gap, from the one to the other.
    simulated : (OpenLoopError, OpenLoopError) or None
        Of the held-out simulation, without and with it; None of a spline in one place.
    beside : tuple of str
        What the base model holds and is left free without and with it.
    slices : tuple of (float, FittedFunction)
        Of two covariates, along the first at some values of the second.
    """

    place: str
    tested: Mapping[str, tuple[float, float]]
    spline: FittedFunction
    choice: TermChoice | None
    equivalents: tuple[str, ...]
    rival_places: tuple[str, ...]
    without: FittedModel
    model: FittedModel
    fall: FallOfGap
    simulated: tuple[OpenLoopError, OpenLoopError] | None
    beside: tuple[str, ...] = ()
    slices: tuple[tuple[float, FittedFunction], ...] = ()

    @property
    def listed(self) -> str:
        """Identifier of the term of the catalogue that this is; empty where it is none."""
        if self.choice is None:
            return ""
        columns = ChosenTerm(self.choice, 0.0).columns
        return listed_term(self.choice, [self.model.value(column) for column in columns])


@dataclass(frozen=True, slots=True, eq=False)
class MachineFinding:
    """Outcome of an investigation with a base model.

    Attributes
    ----------
    base : BaseModel
    records : tuple of UniformRecord
    steps : tuple of SelectionStep
    established : tuple of str
        Names of the terms that joined, in their order.
    unconfirmed : tuple of str
    falls : mapping
        Of each established term.
    nominal, final : FittedModel
    training, held_out : Blocks
    train_gaps : (float, float)
        Of the nominal and the final model.
    expected : (float, float)
        Range of the held-out gap where nothing is left.
    fall : FallOfGap
        From the nominal to the final model.
    held_spans : tuple of (int, float, float)
        Record and time of each stretch that was held out.
    remainder : Remainder
        What the final model leaves.
    block_s : float
    scale : MotionScale
    notes : tuple of str
    seed : int
    law : MachineLaw or None
        What is proposed where something remains.
    law_refused : str
        Why nothing is, where something was looked for.
    experiments : tuple of Proposal
        Records that would tell tied terms apart.
    simulated : tuple of OpenLoopError
        Of the held-out simulation, by the nominal and by the final model; empty until it was done.
    better_simulated : BetterSimulation or None
        Where nothing is established, a term that held-out blocks do not show and their simulation does.
    clear_strengths : tuple of ClearStrength
        Terms beside what is established where the gap is at its floor, that which simulates best first.
    tied_models : mapping
        By the name of a tied term, the final model with it in the place of the named one.
    is_told_of : bool
        Whether what remains is told to be a number of the base model, or a constant of each record.
    number_off : str
        Number that the base model holds and that would explain most of what remains; empty where none does.
    unconfirmed_since : mapping
        What each unconfirmed term lacks, as a clause.
    """

    base: BaseModel
    records: tuple[UniformRecord, ...]
    steps: tuple[SelectionStep, ...]
    established: tuple[str, ...]
    unconfirmed: tuple[str, ...]
    falls: Mapping[str, FallOfGap]
    nominal: FittedModel
    final: FittedModel
    training: Blocks
    held_out: Blocks
    train_gaps: tuple[float, float]
    expected: tuple[float, float]
    fall: FallOfGap
    held_spans: tuple[tuple[int, float, float], ...]
    remainder: Remainder
    block_s: float
    scale: MotionScale
    notes: tuple[str, ...]
    seed: int
    law: MachineLaw | None = None
    law_refused: str = ""
    experiments: tuple[Proposal, ...] = ()
    simulated: tuple[OpenLoopError, ...] = ()
    better_simulated: BetterSimulation | None = None
    clear_strengths: tuple[ClearStrength, ...] = ()
    tied_models: Mapping[str, FittedModel] = field(default_factory=dict)
    is_told_of: bool = False
    number_off: str = ""
    unconfirmed_since: Mapping[str, str] = field(default_factory=dict)

    @staticmethod
    def enough(training: Blocks, held_out: Blocks) -> bool:
        """Whether there are blocks enough for any test."""
        return len(training) >= MIN_TRAINING and len(held_out) >= MIN_HELD_OUT

    @property
    def missing_blocks(self) -> int:
        """How many blocks more any test needs."""
        return max(MIN_TRAINING - len(self.training), 0) + max(MIN_HELD_OUT - len(self.held_out), 0)

    @property
    def is_at_floor(self) -> bool:
        """Whether the final model leaves nothing."""
        return self.fall.after <= self.expected[1] and self.train_gaps[1] <= self.training.largest_by_chance

    @property
    def is_driven(self) -> bool:
        """Whether a force acts."""
        return any(record.force.any() for record in self.records)

    @property
    def noise_is_motion(self) -> bool:
        """Whether less than half remains of noise read off neighbouring samples: what differs there moves."""
        channels = 2 if self.is_driven else 1
        stated = all(all(record.noise_is_stated[:channels]) for record in self.records)
        return self.fall.after < LEAST_GAP and not stated

    @property
    def noise_hides(self) -> bool:
        """Whether the equation of motion shows nothing beyond noise, and a simulation errs far beyond."""
        if self.better_simulated is not None and self.fall.after <= self.expected[1]:
            return True
        return (
            self.errs_beyond_noise and self.is_at_floor and self.simulated[-1].fit_percent < POOR_FIT_PERCENT
        )

    @property
    def errs_beyond_noise(self) -> bool:
        """Whether simulated positions are off by more than the sensor's noise makes them."""
        if not self.simulated or self.base.response is Response.FORCE:
            return False
        noise = max(record.position_noise for record in self.records)
        return self.simulated[-1].rmse > FAR_ABOVE_NOISE * noise

    @property
    def tied_with(self) -> dict[str, tuple[str, ...]]:
        """Rivals of each established term that the data cannot tell from it."""
        accepted = (step for step in self.steps if step.accepted is not None)
        return {
            step.accepted.term.choice.name: step.tied_with
            for step in accepted
            if step.accepted is not None and step.accepted.term.choice.name in self.established
        }

    @property
    def verdict(self) -> str:
        """`no_gap`, `named`, `tied`, `unknown` or `untested`."""
        if self.missing_blocks:
            return "untested"
        if self.established:
            return "tied" if any(self.tied_with.values()) else "named"
        if self.noise_is_motion or self.noise_hides or self.clear_strengths:
            return "untested"
        return "no_gap" if self.is_at_floor else "unknown"
