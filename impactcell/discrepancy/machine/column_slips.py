"""Columns that are turned or in another unit: asked for where records follow a base model only with that."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactcell.campaign import Coordinate
from impactcell.discrepancy.machine.better_simulated import errors_with_terms
from impactcell.discrepancy.machine.establishing import establish
from impactcell.discrepancy.machine.finding import MachineFinding
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.records.travel import is_turn_in_degrees
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.regression.block_plan import BlockPlan
from impactcell.discrepancy.machine.regression.block_sums import blocks_of, fit_blocks
from impactcell.discrepancy.machine.regression.weak_form import Column, Rows, build_rows
from impactcell.discrepancy.machine.simulation.held_out import simulate_held_out, with_simulations
from impactcell.discrepancy.machine.terms.base_model import BaseModel, NumberPrior
from impactcell.german.findings import enumerated
from impactcell.german.open_loop import POOR_FIT_PERCENT

MOST_LEFT = 0.5
"""Error of the held-out simulation with a slip, over the least that it has with the columns as they are (by
the base model, with a term of the catalogue beside it, without the drive), up to which a slip is told. Our
choice."""
FOLLOWED_PERCENT = 90.0
"""Fit of a simulation from which on no column is turned or a thousand times too large. Our choice."""
DEGREE = math.pi / 180.0
"""[rad]."""


@dataclass(frozen=True, slots=True)
class ColumnSlip:
    """What a column may be instead of what its name says.

    Attributes
    ----------
    words : str
        The column as it would be: "force_n in kN".
    force, inertia, position : float
        Factors that make it what its name says.
    places : frozenset of int
        Records whose force is turned beside that.
    error : float
        Of the held-out simulation by the base model, over that with the columns as they are.
    """

    words: str
    force: float = 1.0
    inertia: float = 1.0
    position: float = 1.0
    places: frozenset[int] = frozenset()
    error: float = math.nan

    @property
    def reason(self) -> str:
        """What the base model does with it."""
        return f"with {self.words} the base model, simulated open loop, errs {self.error:.2g} times as much"

    @property
    def note(self) -> str:
        """What to do about it."""
        return f"Records follow the base model with {self.words}: see which it is, and correct that."

    def corrected(
        self, base: BaseModel, records: Sequence[UniformRecord]
    ) -> tuple[BaseModel, tuple[UniformRecord, ...]]:
        """Give base model and records with the column as its name says."""
        inertia = NumberPrior(self.inertia * base.inertia.value, self.inertia * base.inertia.std)
        signs = [-1.0 if place in self.places else 1.0 for place in range(len(records))]
        corrected = [
            _scaled(record, sign * self.force, self.inertia, self.position)
            for record, sign in zip(records, signs, strict=True)
        ]
        return replace(base, inertia=inertia), tuple(corrected)


TRANSLATION = (
    ColumnSlip("mass_kg in g, position_m in mm or force_n in kN", inertia=1e-3),
    ColumnSlip("mass_kg in t or force_n in mN", inertia=1e3),
    ColumnSlip("position_m in µm", inertia=1e-6),
    ColumnSlip("time_s in ms", inertia=1e6),
)
"""Units that a slide may have: to all that is fitted beside its inertia any size is as good."""
ROTATION = (
    ColumnSlip("torque_n_m in mN m", force=1e-3),
    ColumnSlip("inertia_kg_m2 in kg cm²", inertia=1e-4),
    ColumnSlip("inertia_kg_m2 in kg mm²", inertia=1e-6),
    ColumnSlip("inertia_kg_m2 in g cm²", inertia=1e-7),
    ColumnSlip("time_s in ms", inertia=1e6),
)
"""Units that a rotation may have where something drives it."""
DEGREES = ColumnSlip("angle_rad in degrees", position=DEGREE)
"""Unit of any rotation."""
UNDRIVEN = ColumnSlip("no drive", force=1e-9)
"""No slip: records that are followed with it go on by themselves, as a motor that has come to its speed."""


def slip_in_columns(fits: MachineFits, finding: MachineFinding) -> ColumnSlip | None:
    """Find what columns would have to be for records to follow the base model; None where they do as it is.

    Something has to remain, and nothing be named that the held-out records follow; but for degrees, for small
    swings in these look like those of a spring.
    """
    now = finding.simulated[-1].fit_percent
    followed = POOR_FIT_PERCENT if finding.established else FOLLOWED_PERCENT
    if finding.missing_blocks or finding.is_at_floor:
        return None
    tried = [
        replace(slip, error=(100.0 - fit) / (100.0 - now))
        for slip in _slips(fits, is_driven=finding.is_driven, is_followed=now >= followed)
        if (fit := _fit_percent(fits, slip, finding.seed)) >= POOR_FIT_PERCENT
    ]
    best = min(tried, key=lambda slip: slip.error, default=None)
    if best is None or best.error > MOST_LEFT:
        return None
    return best if best.error <= MOST_LEFT * _least_error_as_it_is(fits, finding, best) else None


def _least_error_as_it_is(fits: MachineFits, finding: MachineFinding, slip: ColumnSlip) -> float:
    """Error of the held-out simulation, over the base model's, by what needs no column to be another.

    A force of nearly nothing and an inertia of any size beside it follow whatever moves on by itself, and a
    wrong unit may look like the term that is missing. That small angles in degrees look like those on a
    spring is no reason to take them for it.
    """
    now = finding.simulated[-1]
    least = min(1.0, (100.0 - _fit_percent(fits, UNDRIVEN, finding.seed)) / (100.0 - now.fit_percent))
    if slip.words == DEGREES.words:
        return least
    return min([least, *(rmse / now.rmse for rmse in errors_with_terms(fits, finding).values())])


def told_of_slip(
    fits: MachineFits, finding: MachineFinding, slip: ColumnSlip, notes: Sequence[str]
) -> MachineFinding:
    """Tell a slip for a finding: nothing is named, and no law looked for, that records show with one."""
    bare = with_simulations(establish(_without_candidates(fits), [], finding.seed))
    steps = [replace(step, accepted=None, tied_with=(), reason=slip.reason) for step in finding.steps[:1]]
    return replace(bare, steps=tuple(steps), notes=(*notes, slip.note), law_refused=slip.reason)


def with_degrees_asked_for(finding: MachineFinding) -> MachineFinding:
    """Ask whether angles are in degrees where a wave of them repeats after about 360."""
    if finding.base.coordinate is not Coordinate.ROTATION:
        return finding
    turns = [period for period in _periods(finding) if is_turn_in_degrees(period)]
    if not turns:
        return finding
    asked = f"A period of {turns[0]:.0f} rad is a turn in degrees: see whether angle_rad is in degrees."
    return replace(finding, notes=(*finding.notes, asked))


def _periods(finding: MachineFinding) -> list[float]:
    """Periods of the waves that a finding has."""
    periods = [term.shape for term in finding.final.terms if term.choice.identifier.startswith("periodic_")]
    law = finding.law
    if law is not None and law.choice is not None and law.choice.law is not None:
        periods += [period for item in law.choice.law.terms for period in item.periods]
    return periods


def _slips(fits: MachineFits, *, is_driven: bool, is_followed: bool) -> Iterator[ColumnSlip]:
    """Give what may be: each column is in one unit, and some records are turned."""
    is_rotation = fits.base.coordinate is Coordinate.ROTATION
    if is_rotation:
        yield DEGREES
    if is_followed or not is_driven:
        return
    yield from ROTATION if is_rotation else TRANSLATION
    turned = _turned(fits)
    if turned:
        columns = "torque_n_m or angle_rad" if is_rotation else "force_n or position_m"
        shots = [str(fits.records[place].shot) for place in sorted(turned)]
        where = f" in shot{'s' if len(shots) > 1 else ''} {enumerated(shots, 'and')}"
        in_some = where if len(turned) < len(fits.records) else ""
        yield ColumnSlip(f"{columns} turned{in_some}", places=turned)


def _turned(fits: MachineFits) -> frozenset[int]:
    """Find records each of which, by itself, leaves less to the base model with its force turned."""
    terms = fits.base_terms
    shapes = {term.choice: (term.shape,) for term in terms}
    losses = []
    for sign in (1.0, -1.0):
        records = [_scaled(record, sign, 1.0, 1.0) for record in fits.records]
        rows = build_rows(records, fits.base, shapes, (fits.gravity, fits.delay_s))
        losses.append([_left(fits, rows, place, fits.columns(terms)) for place in range(len(records))])
    as_it_is, turned = losses
    return frozenset(place for place in range(len(fits.records)) if turned[place] < as_it_is[place])


def _left(fits: MachineFits, rows: Rows, place: int, columns: Sequence[Column]) -> float:
    """Squared residual of one record by a model fitted to it alone."""
    inside = rows.record == place
    of_record = replace(
        rows,
        target=rows.target[inside],
        columns={column: rows.columns[column][inside] for column in columns},
        record=rows.record[inside],
        time_s=rows.time_s[inside],
        variance=rows.variance[inside],
        doubt=rows.doubt[inside],
    )
    number = BlockPlan(fits.block_s, None).number(of_record)
    blocks = blocks_of(of_record, number, dict.fromkeys(np.unique(number).tolist(), 0))
    if not len(blocks):
        return 0.0
    fit = fit_blocks(blocks, columns, fits.priors, fits.nonnegative)
    return float(blocks.losses(columns, fit.coefficients).sum())


def _fit_percent(fits: MachineFits, slip: ColumnSlip, seed: int) -> float:
    """Fit of the held-out simulation by the base model with a slip corrected; -inf where there is none."""
    corrected = _without_candidates(fits, slip)
    if not corrected.rows().target.size or not all(map(len, corrected.blocks())):
        return -math.inf
    finding = establish(corrected, [], seed)
    return simulate_held_out(finding, finding.nominal).fit_percent


def _without_candidates(fits: MachineFits, slip: ColumnSlip | None = None) -> MachineFits:
    base, records = (fits.base, fits.records) if slip is None else slip.corrected(fits.base, fits.records)
    return fits.without_candidates(base, records)


def _scaled(record: UniformRecord, force: float, inertia: float, position: float) -> UniformRecord:
    """Record with its columns times some factors, and their noise."""
    of_position, of_force = record.noise
    return replace(
        record,
        position=position * record.position,
        force=force * record.force,
        command=None if record.command is None else force * record.command,
        inertia=inertia * record.inertia,
        noise=(position * of_position, abs(force) * of_force),
    )
