"""Where the workflow starts: the nominal model on the training shots, as told or open in what may be off."""

from collections.abc import Sequence
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
    fit_from,
    fit_nominal,
    setting_notes,
    usable_blocks,
    with_open_settings,
)
from impactcell.errors import CampaignError
from impactcell.physics import Plant
from impactcell.physics.free_motion import depends_on_mass

ONSET = "onset_s"
"""First contact, by its name among the shots' own numbers."""
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
    opened : tuple of str
        What shots have of their own that records had told.
    """

    prepared: PreparedCampaign
    floor: NoiseFloor
    training: IndexArray
    problem: Problem
    fit: Fit
    opened: tuple[str, ...] = ()

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
        return self._reopened(prepared, (*self.opened, ONSET))

    def with_settings(self, names: Sequence[str]) -> "NominalModel":
        """Let velocity, mass or both of every shot be a little off what is told."""
        prepared = replace(self.prepared, shots=with_open_settings(self.prepared.shots, names))
        return self._reopened(prepared, tuple(names))

    def _reopened(self, prepared: PreparedCampaign, opened: tuple[str, ...]) -> "NominalModel":
        problem = problem_of(prepared, self.floor, self.training)
        return NominalModel(prepared, self.floor, self.training, problem, fit_from(problem, self.fit), opened)

    def notes(self, final: Fit, *, remains: bool = False) -> tuple[str, ...]:
        """Say what the shots have of their own that records had told, by the model left in the end.

        Where something remains that it does not explain, their own numbers have taken of it what they could.
        """
        contact = (contact_note(final, remains=remains),) if ONSET in self.opened else ()
        told = set(self.problem.shot_parameter_names) - {ONSET}
        names = [name for name in self.opened if name in told]
        return (*contact, *setting_notes(final, names, remains=remains))


@dataclass(frozen=True, slots=True, eq=False)
class NominalModels:
    """The nominal model, and the one that it may give way to.

    Attributes
    ----------
    exact : NominalModel
        First contact at t = 0, unless the records have samples before it.
    contact_free : NominalModel or None
        First contact open, where it is not in the other one and there is any.
    scatter : ContactScatter or None
        Of first contact, as it is in `contact_free`.
    """

    exact: NominalModel
    contact_free: NominalModel | None = None
    scatter: ContactScatter | None = None

    @property
    def start(self) -> NominalModel:
        """The one to start from: where contact differs among like shots it is open."""
        seen = self.scatter is not None and self.scatter.is_seen
        return self.contact_free if seen and self.contact_free is not None else self.exact

    def with_settings(self, names: Sequence[str]) -> "NominalModels":
        """Let velocity, mass or both of every shot be a little off what is told."""
        return _with_contact(self.exact.with_settings(names))


def nominal_models(
    prepared: PreparedCampaign, floor: NoiseFloor, training: IndexArray, plant: Plant | None
) -> NominalModels:
    """Fit the nominal model, and the one that it may give way to: with first contact open.

    Raises
    ------
    CampaignError
        A force of the plant acts on slides whose mass nobody tells.
    DiscrepancyError
        The nominal model cannot be fitted at all.
    """
    if plant is not None:
        _refuse_forces_without_mass(prepared, plant)
    problem = problem_of(prepared, floor, training)
    nominal = NominalModel(prepared, floor, training, problem, fit_nominal(problem, plant))
    if prepared.excitation.selects_blocks:
        kept = usable_blocks(problem, nominal.fit)
        if len(kept) < len(training):
            prepared = replace(prepared, notes=(*prepared.notes, _left_out(training, kept)))
            training = training[kept]
            problem = problem_of(prepared, floor, training)
            nominal = NominalModel(prepared, floor, training, problem, fit_nominal(problem, plant))
    return _with_contact(nominal)


def _refuse_forces_without_mass(prepared: PreparedCampaign, plant: Plant) -> None:
    """Refuse a plant of which a force acts on slides whose mass nobody tells."""
    if prepared.lacks_mass and (forces := [name for name in plant.effects if depends_on_mass(name)]):
        raise CampaignError(
            f"no shot states its mass, which a slide does not show, and {', '.join(forces)} of the nominal "
            "model is a force: state mass_kg in shots.csv, or part.mass_kg in the cell file"
        )


def _with_contact(nominal: NominalModel) -> NominalModels:
    """See how first contact scatters."""
    if nominal.is_open or not nominal.prepared.excitation.has_contact:
        return NominalModels(nominal)
    contact_free = nominal.with_open_contact()
    return NominalModels(nominal, contact_free, contact_scatter(contact_free.problem, contact_free.fit))


def problem_of(prepared: PreparedCampaign, floor: NoiseFloor, indices: IndexArray) -> Problem:
    """Lay out some shots of a campaign for fits."""
    return Problem(shot_set(prepared, indices, floor.noise_std), len(prepared.batches))


def _left_out(training: IndexArray, kept: IndexArray) -> str:
    return (
        f"{len(training) - len(kept)} of {len(training)} training blocks were left out: in them stick ends, "
        "or does not, by so little that noise decides, or the nominal model does not follow them."
    )
