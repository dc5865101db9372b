"""Where the workflow starts: the nominal model on the training shots, and when contact began in them."""

from dataclasses import dataclass, replace

from impactcell.discrepancy.data import (
    IndexArray,
    NoiseFloor,
    PreparedCampaign,
    decimate,
    shot_set,
    with_open_onset,
)
from impactcell.discrepancy.model import (
    ContactScatter,
    Fit,
    Problem,
    contact_note,
    contact_scatter,
    fit_nominal,
    free_contact,
    usable_blocks,
)
from impactcell.physics import Plant

COARSE_SAMPLES = 400
"""Samples of a channel and shot that a search among many models reads."""


@dataclass(frozen=True, slots=True, eq=False)
class NominalModel:
    """The nominal model, fitted to the training shots.

    Attributes
    ----------
    training : ndarray
        Places of the shots.
    problem : Problem
    fit : Fit
    """

    prepared: PreparedCampaign
    floor: NoiseFloor
    training: IndexArray
    problem: Problem
    fit: Fit

    @property
    def coarse(self) -> Problem:
        """The same problem on fewer samples."""
        fewer = decimate(self.problem.shots, COARSE_SAMPLES)
        return self.problem if fewer is self.problem.shots else Problem(fewer, self.problem.batches)

    @property
    def is_open(self) -> bool:
        """Whether first contact is fitted shot by shot."""
        return bool(self.problem.onset_step_s.any())

    def with_open_contact(self) -> "NominalModel":
        """Let first contact of every shot lie within a sampling step of t = 0."""
        prepared = with_open_onset(self.prepared)
        problem = problem_of(prepared, self.floor, self.training)
        fitted = free_contact(problem, self.fit)
        prepared = replace(prepared, notes=(*prepared.notes, contact_note(fitted)))
        return NominalModel(prepared, self.floor, self.training, problem, fitted)


@dataclass(frozen=True, slots=True, eq=False)
class OtherContact:
    """The nominal model with first contact open, where the one in use has it at t = 0."""

    nominal: NominalModel
    scatter: ContactScatter


def nominal_models(
    prepared: PreparedCampaign, floor: NoiseFloor, training: IndexArray, plant: Plant | None
) -> tuple[NominalModel, OtherContact | None]:
    """Fit the nominal model, and the one that it may give way to: with first contact open.

    Where contact differs among like shots it is open from the start.

    Raises
    ------
    DiscrepancyError
        The nominal model cannot be fitted at all.
    """
    problem = problem_of(prepared, floor, training)
    nominal = NominalModel(prepared, floor, training, problem, fit_nominal(problem, plant))
    if prepared.excitation.selects_blocks:
        kept = usable_blocks(problem, nominal.fit)
        if len(kept) < len(training):
            prepared = replace(prepared, notes=(*prepared.notes, _left_out(training, kept)))
            training = training[kept]
            problem = problem_of(prepared, floor, training)
            nominal = NominalModel(prepared, floor, training, problem, fit_nominal(problem, plant))
    if nominal.is_open or not prepared.excitation.has_contact:
        return nominal, None
    contact_free = nominal.with_open_contact()
    scatter = contact_scatter(contact_free.problem, contact_free.fit)
    return (contact_free, None) if scatter.is_seen else (nominal, OtherContact(contact_free, scatter))


def problem_of(prepared: PreparedCampaign, floor: NoiseFloor, indices: IndexArray) -> Problem:
    """Lay out some shots of a campaign for fits."""
    return Problem(shot_set(prepared, indices, floor.noise_std), len(prepared.batches))


def _left_out(training: IndexArray, kept: IndexArray) -> str:
    return (
        f"{len(training) - len(kept)} of {len(training)} training blocks were left out: in them stick ends, "
        "or does not, by so little that noise decides, or the nominal model does not follow them."
    )
