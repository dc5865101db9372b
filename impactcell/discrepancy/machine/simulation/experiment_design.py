"""Which further records would tell tied terms of a machine apart, as far as simulating them can say.

A record that is there is run again, slower, faster, further or at another value of a column, by the final
model with its noise. A proposal is a change after which the selection, given the old records and the new, no
longer ties the two terms.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.integrate import cumulative_trapezoid

from impactcell.discrepancy.machine.finding import MachineFinding
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.regression.block_sums import Blocks
from impactcell.discrepancy.machine.regression.trials import ChosenTerm, TermSearch, Trial
from impactcell.discrepancy.machine.regression.weak_form import Rows
from impactcell.discrepancy.machine.search.ties import is_tied
from impactcell.discrepancy.machine.simulation.held_out import needed_force, positions_from
from impactcell.discrepancy.machine.terms.base_model import Response, TermChoice
from impactcell.discrepancy.search import Proposal
from impactcell.errors import CampaignError

UNCHANGED = 1.0
"""Factor that leaves a record as it is."""
FACTORS = (0.2, UNCHANGED, 2.0)
"""By which a drive, a motion, a release or its pace is changed: within reach of most machines [1]."""
COLUMN_SHARES = (-0.5, 0.5, 1.5)
"""Where a column is set, in shares of the range it had, from its lowest value [1]."""
MAX_RANGE = 2.5
"""Range of positions over that of the records, beyond which a machine is not asked to go [1]."""
COPIES = 8
"""Simulated records of each kind in a change, each with its own noise."""
COUNTS = (1, 2, 4)
"""Records of each kind that may be proposed."""
DRAWS = 10
"""Sets of so many records that are tried: the power is known to a tenth."""
POWER = 0.9
"""Share of the sets that have to tell the terms apart, as in the workflow of shots [1]."""
MIN_BLOCKS = 3.0
"""Least length of a new record in blocks: with fewer none may be whole [1]."""
LONGEST_BLOCKS = 20.0
"""Length in blocks that is simulated of a longer record: two minutes of a swing took ten."""
TRIED_CHANGES = 3
"""Changes, those that part the terms most first, of which sets of records are tried."""
SIMULATION = 9
"""Stream of random numbers of these records, apart from those of other draws."""


@dataclass(frozen=True, slots=True, eq=False)
class _Change:
    """Records of the finding, changed, without noise: as many of each would be made."""

    words: str
    records: tuple[UniformRecord, ...]


def with_experiments(fits: MachineFits, finding: MachineFinding) -> MachineFinding:
    """Add to a finding, for each two terms that it ties, the records that would tell them apart."""
    known = {choice.name for choice in fits.candidates}
    ties = [(name, rival) for name, rivals in finding.tied_with.items() for rival in rivals if rival in known]
    if not ties:
        return finding
    longest = _longest(finding)
    # What its beginning tells apart, all of it does.
    beginning = longest.part(0, int(np.searchsorted(longest.time_s, LONGEST_BLOCKS * fits.block_s)))
    changes = _within_reach(finding, _changes(finding, beginning))
    return replace(finding, experiments=tuple(_proposal(fits, finding, tie, changes) for tie in ties))


def _longest(finding: MachineFinding) -> UniformRecord:
    """Longest time of a record without a gap, of equal ones that with the widest motion."""
    whole = [record.part(piece.start, piece.stop) for record in finding.records for piece in record.pieces()]
    return max(whole, key=lambda record: (record.time_s[-1], np.ptp(record.position)))


def _changes(finding: MachineFinding, record: UniformRecord) -> list[_Change]:
    """List what could be done with a machine that made a record: one thing differently."""
    again = f"shot {record.shot} again"
    changes = [_Change(again, (record,))]
    for (before, after), values, change in _ways(finding, record):
        made = [change(value) for value in values]
        changes += [
            _Change(f"{again}, {before} {value:.3g}{after}", (other,))
            for value, other in zip(values, made, strict=True)
            if other is not record
        ]
        # Two laws of one covariate beside a constant part with three values of it at least.
        several = "{:.3g}, {:.3g} and {:.3g}".format(*values)
        changes.append(_Change(f"{again}, {before} {several}{after}, as often each", tuple(made)))
    return changes


def _ways(
    finding: MachineFinding, record: UniformRecord
) -> Iterator[tuple[tuple[str, str], Sequence[float], Callable[[float], UniformRecord]]]:
    """Ways to change a record: words before and after a number, the numbers, and how."""
    is_input = finding.base.response is Response.FORCE
    is_driven = np.ptp(record.force) > 0.0
    if is_input or is_driven:
        words = "its motion" if is_input else "its drive", " times as fast"
        yield words, FACTORS, partial(_at_pace, record)
    if is_driven and not is_input:
        yield ("its drive", " times as strong"), FACTORS, partial(_driven_by, record)
    else:
        words = ("its motion", " times as wide") if is_input else ("released from", " times as far")
        centre = float(record.position.mean()) if is_input else 0.0
        yield words, FACTORS, partial(_as_wide, record, centre)
    for column in sorted(record.covariates):
        values = [other.covariates[column] for other in finding.records if column in other.covariates]
        low, span = min(values), max(values) - min(values)
        if span > 0.0:
            set_to = partial(_with_column, record, column)
            yield (f"{column} at", ""), [low + share * span for share in COLUMN_SHARES], set_to


def _driven_by(record: UniformRecord, factor: float) -> UniformRecord:
    """Drive so many times as strongly."""
    if factor == UNCHANGED:
        return record
    command = None if record.command is None else factor * record.command
    return replace(record, force=factor * record.force, command=command)


def _as_wide(record: UniformRecord, centre: float, factor: float) -> UniformRecord:
    """Scale positions about one of them."""
    if factor == UNCHANGED:
        return record
    return replace(record, position=centre + factor * (record.position - centre))


def _at_pace(record: UniformRecord, factor: float) -> UniformRecord:
    """Go through a record so many times as fast, for no longer than it was."""
    if factor == UNCHANGED:
        return record
    count = math.ceil(min(factor, 1.0) * len(record.time_s))
    part = record.part(0, count)
    return replace(part, time_s=part.time_s / factor)


def _with_column(record: UniformRecord, column: str, value: float) -> UniformRecord:
    return replace(record, covariates={**record.covariates, column: value})


def _within_reach(finding: MachineFinding, changes: Sequence[_Change]) -> list[_Change]:
    """Run each change by the final model; those that lead too far fall out."""
    if finding.base.response is Response.FORCE:
        return [
            replace(change, records=tuple(_with_force(finding, record) for record in change.records))
            for change in changes
        ]
    records = [record for change in changes for record in change.records]
    start = np.array([_begin(record) for record in records]).T
    with np.errstate(over="ignore", invalid="ignore"):
        runs = iter(positions_from(finding.final, records, start, finding.scale.period_s))
    widest = MAX_RANGE * (finding.scale.high - finding.scale.low)
    within = []
    for change in changes:
        made = tuple(replace(record, position=next(runs)) for record in change.records)
        if all(np.isfinite(one.position).all() and 0.0 < np.ptp(one.position) <= widest for one in made):
            within.append(replace(change, records=made))
    return within


def _begin(record: UniformRecord) -> tuple[float, float]:
    """Position and speed at which a record begins, by a line through its first samples."""
    count = max(len(record.position) // 200, 3)
    slope, value = np.polyfit(record.time_s[:count], record.position[:count], 1)
    return float(value), float(slope)


def _with_force(finding: MachineFinding, record: UniformRecord) -> UniformRecord:
    """Force that a motion needs; where the part rests it goes from what is before to what is after."""
    force = needed_force(finding.final, record, slice(None), finding.scale)
    known = np.isfinite(force)
    return replace(record, force=np.interp(record.time_s, record.time_s[known], force[known]))


def _proposal(
    fits: MachineFits, finding: MachineFinding, tie: tuple[str, str], changes: Sequence[_Change]
) -> Proposal:
    """Fewest records of a change that tell two terms apart; 0 of them where none does."""
    tried = []
    for place, change in enumerate(changes):
        try:
            test = _Test.of(fits, finding, tie, change, place)
        except CampaignError:
            continue
        separation = test.separation()
        if separation > 0.0:
            tried.append((separation, -place, change, test))
    tried.sort(key=lambda one: one[:2], reverse=True)
    for count in COUNTS:
        for _, _, change, test in tried[:TRIED_CHANGES]:
            power = test.power(count)
            if power >= POWER:
                return Proposal(tie, change.words, count * len(change.records), power)
    nothing = "nothing from a fifth to twice of what was done tells them apart: measure one of them by itself"
    return Proposal(tie, nothing, 0, math.nan)


@dataclass(frozen=True, slots=True, eq=False)
class _Test:
    """Old records and copies of a new one, and the two terms that they are to tell apart.

    Attributes
    ----------
    fits : MachineFits
        Of old and new records, the two terms the first of its candidates.
    blocks : Blocks
        Its training blocks.
    terms : tuple of ChosenTerm
        Of the final model, without the one that is tied.
    old, kinds : int
        Training records that are there, and kinds of new ones.
    seed : int
    """

    fits: MachineFits
    blocks: Blocks
    terms: tuple[ChosenTerm, ...]
    old: int
    kinds: int
    seed: int

    @classmethod
    def of(
        cls, fits: MachineFits, finding: MachineFinding, tie: tuple[str, str], change: _Change, place: int
    ) -> "_Test":
        rng = np.random.default_rng([finding.seed, SIMULATION, place])
        copies = [_noisy(record, finding, rng) for _ in range(COPIES) for record in change.records]
        choices = [choice for choice in fits.candidates if choice.name in tie]
        choices.sort(key=lambda choice: tie.index(choice.name))
        terms = tuple(term for term in finding.final.terms if term.choice.name != tie[0])
        others = [term.choice for term in terms if term.choice not in fits.base.terms]
        every = MachineFits((*fits.records, *copies), fits.base, (*choices, *others), fits.held)
        every.gravity, every.delay_s = finding.final.gravity, finding.final.delay_s
        every.doubt = fits.doubt
        every.shapes = {name: fits.shapes[name] for name in every.shapes}
        blocks, _ = every.blocks(_with_columns(every, terms, choices))
        if min(record.time_s[-1] for record in change.records) < MIN_BLOCKS * every.block_s:
            raise CampaignError(f"{change.words}: too short to tell anything")
        kinds = len(change.records)
        return cls(every, blocks, terms, len(np.unique(blocks.fold)) - COPIES * kinds, kinds, finding.seed)

    def trials(self, copies: Sequence[int]) -> list[Trial]:
        """Try the two terms on the old records and some of the copies."""
        new = [self.old + copy * self.kinds + kind for copy in copies for kind in range(self.kinds)]
        chosen = np.isin(self.blocks.fold, [*range(self.old), *new])
        part = {
            name: getattr(self.blocks, name)[chosen]
            for name in ("products", "rows", "noise", "fold", "number")
        }
        search = TermSearch(
            replace(self.blocks, **part),
            self.fits.candidates[:2],
            self.fits.shapes,
            self.fits.priors,
            self.fits.nonnegative,
        )
        columns = self.fits.columns(self.terms)
        before = search.losses(columns)
        return [search.best_shape(choice, columns, before) for choice in search.candidates]

    def separation(self) -> float:
        """Share of the true term's gain that the other one does not have, with all new records; 0 if tied."""
        true, other = self.trials(range(COPIES))
        apart = true.gain > 0.0 and not is_tied(true, other)
        return 1.0 - other.gain / true.gain if apart else 0.0

    def power(self, count: int) -> float:
        """Share of sets of so many new records that tell the terms apart, and rightly."""
        rng = np.random.default_rng([self.seed, SIMULATION, count])
        sets = [rng.choice(COPIES, count, replace=False).tolist() for _ in range(DRAWS)]
        pairs = [self.trials(copies) for copies in sets]
        return float(np.mean([true.gain > other.gain and not is_tied(true, other) for true, other in pairs]))


def _with_columns(fits: MachineFits, terms: Sequence[ChosenTerm], choices: Sequence[TermChoice]) -> Rows:
    """Rows of some terms and of some that may be missing, without those of free forms."""
    shapes = [ChosenTerm(choice, shape) for choice in choices for shape in fits.shapes[choice.name]]
    rows = fits.rows()
    return replace(rows, columns={name: rows.columns[name] for name in fits.columns([*terms, *shapes])})


def _noisy(record: UniformRecord, finding: MachineFinding, rng: np.random.Generator) -> UniformRecord:
    """Record as its sensors would have it; what the final model leaves counts as noise of theirs."""
    level = max(finding.fall.after, 1.0)
    position, force = (level * std * rng.standard_normal(len(record.position)) for std in record.noise)
    if record.summed_up:
        position = cumulative_trapezoid(position, record.time_s, initial=0)
    if finding.base.response is Response.FORCE or np.ptp(record.force) > 0.0:
        record = replace(record, force=record.force + force)
    return replace(record, position=record.position + position)
