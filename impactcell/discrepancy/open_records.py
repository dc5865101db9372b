"""What a record tells of a shot is not exact: where it has to be open, and what is found beside that."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from impactcell.discrepancy.model import (
    SETTINGS,
    Fit,
    dependence_notes,
    fit_from,
    implausible_notes,
    setting_scatter,
)
from impactcell.discrepancy.nominal_model import NominalModel, NominalModels
from impactcell.discrepancy.search import (
    Remaining,
    SearchContext,
    SelectionResult,
    fit_between_shots,
    only_test,
    scan_candidates,
)
from impactcell.errors import DiscrepancyError

VELOCITY = SETTINGS[0]
"""What no effect of the library is about where all shots have it wrong alike, as one is of the mass."""
Search = Callable[[SearchContext, Fit], SelectionResult]
"""Looks for effects, or only tests the nominal model."""


@dataclass(frozen=True, slots=True, eq=False)
class Basis:
    """A nominal model, and what a search beside it found.

    Attributes
    ----------
    nominals : NominalModels
        With settings open as far as they scatter.
    nominal : NominalModel
        The one in use.
    notes : tuple of str
        What is to be said of others.
    """

    nominals: NominalModels
    nominal: NominalModel
    context: SearchContext
    selection: SelectionResult
    notes: tuple[str, ...] = ()

    @property
    def explains(self) -> bool:
        """Whether nothing remains."""
        return self.selection.accepted is not None and not self.selection.remains

    @property
    def best(self) -> Fit:
        """What was accepted, else the nominal model."""
        return self.selection.accepted or self.nominal.fit

    def notes_of(self, final: Fit, remaining: Remaining) -> tuple[str, ...]:
        """Say what is open, by the model that is left in the end and what remains beside it."""
        return (*self.nominal.notes(final, remains=not remaining.explained), *self.notes)


def find_basis(context: SearchContext, nominals: NominalModels, search: Search) -> Basis:
    """Search beside the nominal model, or beside one that is open in first contact, velocity or mass.

    Velocity and mass are open from the start where they scatter among like shots, whatever acts between
    shots; where something remains they are so, too, where that is seen beside what was found. Anything else
    has to explain the shots: open contact, velocity and mass alone, which are looked at first, and then
    effects beside open contact, where too few replicates say that contact is at t = 0, and beside velocities
    that are told a little wrong.
    """
    if not nominals.exact.prepared.excitation.has_contact:
        return _beside(context, nominals, nominals.start, search)
    opened = _scattered_at_first(context, nominals)
    if opened:
        nominals = nominals.with_settings(opened)
    basis = _beside(context, nominals, nominals.start, search)
    while further := _opened_further(basis):
        nominals = further
        basis = _beside(with_known(context, basis, nominals.start), nominals, nominals.start, search)
    if basis.explains:
        return basis
    already = nominals.exact.opened
    notes: tuple[str, ...] = ()
    for nominal, looks in _others(nominals, search):
        known = context if looks is only_test else with_known(context, basis, nominal)
        other = _beside(known, nominals, nominal, looks)
        if other.explains:
            new = [name for name in nominal.opened if name not in already]
            doubts = _doubts(other, new)
            if not doubts:
                return other
            notes = notes or doubts
    return replace(basis, notes=notes)


def _doubts(basis: Basis, opened: Sequence[str]) -> tuple[str, ...]:
    """Say why what explains the shots is no error of their records: it is too much, or knows the shot."""
    settings = [name for name in SETTINGS if name in opened]
    return (
        *implausible_notes(basis.best, settings),
        *dependence_notes(basis.context.problem, basis.best, opened),
    )


def _beside(context: SearchContext, nominals: NominalModels, nominal: NominalModel, search: Search) -> Basis:
    context = _on(context, nominal)
    return Basis(nominals, nominal, context, search(context, nominal.fit))


def with_known(context: SearchContext, basis: Basis, nominal: NominalModel) -> SearchContext:
    """Fit the likeliest models of each size that a search has found on to shots with more of their own."""
    likeliest: dict[int, Fit] = {}
    for one in (basis.selection.accepted, *(other.fit for other in basis.selection.alternatives)):
        if one is not None and len(one.effects) > len(nominal.fit.effects):
            likeliest.setdefault(len(one.effects), one)
    known = []
    for model in likeliest.values():
        with contextlib.suppress(DiscrepancyError):  # the plant has no answer there
            known.append(fit_from(nominal.problem, model))
    return replace(context, known=tuple(known))


def _on(context: SearchContext, nominal: NominalModel) -> SearchContext:
    return replace(context, problem=nominal.problem, coarse=nominal.coarse, prepared=nominal.prepared)


def _scattered_at_first(context: SearchContext, nominals: NominalModels) -> tuple[str, ...]:
    """Name the settings whose scatter among like shots no effect that acts between shots takes away."""
    start = nominals.start
    seen = [name for name, one in setting_scatter(start.problem, start.fit).items() if one.is_seen]
    if not seen:
        return ()
    beside = _on(context, start)
    scanned = scan_candidates(beside.coarse, start.fit, beside.library, (beside.seed, 0))
    for model in fit_between_shots(beside, scanned):
        scatter = setting_scatter(start.problem, model)
        seen = [name for name in seen if scatter[name].is_seen]
    return tuple(seen)


def _opened_further(basis: Basis) -> NominalModels | None:
    """Open the settings that scatter among like shots where something remains, if there are more.

    One that scatters much hides another: what is seen is open before the next look.
    """
    if basis.explains:
        return None
    nominals: NominalModels | None = None
    opened, problem, best = basis.nominals.exact.opened, basis.nominal.problem, basis.best
    while more := [
        name for name, one in setting_scatter(problem, best).items() if one.is_seen and name not in opened
    ]:
        opened = (*opened, *more)
        nominals = basis.nominals.with_settings(opened)
        problem, best = nominals.start.problem, nominals.start.fit
    return nominals


def _others(nominals: NominalModels, search: Search) -> Iterator[tuple[NominalModel, Search]]:
    """List what else may explain the shots, the least first."""
    opened = nominals.exact.opened
    yield from ((nominal, only_test) for nominal in _other_contact(nominals))
    if set(opened) != set(SETTINGS):
        all_open = nominals.with_settings(SETTINGS)
        yield all_open.start, only_test
        yield from ((nominal, only_test) for nominal in _other_contact(all_open))
    if nominals.scatter is not None and nominals.scatter.is_open:
        yield from ((nominal, search) for nominal in _other_contact(nominals))
    if VELOCITY not in opened:
        yield nominals.with_settings((VELOCITY, *opened)).start, search


def _other_contact(nominals: NominalModels) -> Iterator[NominalModel]:
    """Give the model with first contact open, where it is not open from the start."""
    if nominals.contact_free is not None and nominals.contact_free is not nominals.start:
        yield nominals.contact_free
