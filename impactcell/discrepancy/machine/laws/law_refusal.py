"""Why a law of a machine is not proposed: what it was not fitted to contradicts it, or it cannot be."""

from impactcell.discrepancy.machine.finding import MachineFinding, MachineLaw
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.fits.proof import fall_of_gap
from impactcell.discrepancy.machine.measured_motion import resistance
from impactcell.discrepancy.machine.regression.trials import TermSearch
from impactcell.discrepancy.machine.terms.base_model import Response
from impactcell.discrepancy.machine.terms.law_terms import term_of
from impactcell.discrepancy.machine.terms.rival_forms import SPLINE_PIECES
from impactcell.discrepancy.search import MAX_EXPECTED_GAP

GIVES_ENERGY = "with the law that fits best friction would give energy in the range that was gone through"
"""Why no law is proposed where held-out blocks confirm one that cannot be."""
NOTHING_HELPS = (
    f"no function of speed, load or position that a spline of {SPLINE_PIECES} pieces can follow helps block "
    "after block that it was not fitted to"
)
"""Why no law is proposed where no spline holds."""
NOT_IN_BLOCKS = "it does not help block after block that it was not fitted to"
"""Why a smooth force of velocity and position is not proposed."""
LEAST_INERTIA = 0.3
"""Times the inertia without a law, below which the law stands in for the drive: with all of it cancelled and
no inertia the equation of motion is 0 = 0 [1]."""
NEGATIVE_SHARE = 0.02
"""Share of the largest friction by which it may be below zero before it gives energy [1]."""


def not_in_one_place(fault: str) -> str:
    """Say why no law is proposed where a smooth force, refused for a fault, leaves none in one place."""
    return (
        "beside a smooth force of position and speed what remains needs no law in one place, and that force "
        f"is none either: {fault}"
    )


def refusal_of(finding: MachineFinding, law: MachineLaw, tests: int) -> str:
    """Say why a law, one of so many that are tested, is not proposed; empty if it is."""
    if not law.fall.is_real_among(tests):
        return "on held-out blocks the gap does not fall by more than chance"
    left = _inertia_left(law)
    if left < LEAST_INERTIA:
        return (
            f"the law that fits best stands in for the drive: with it the inertia would be {left:.2g} times "
            "what it is without"
        )
    if law.simulated is None:
        return ""
    without, with_it = law.simulated
    if not with_it.rmse < without.rmse:
        return "simulated open loop, the law that fits best errs no less on held-out records than no law"
    if with_it.fit_percent <= 0.0 and law.fall.after > MAX_EXPECTED_GAP:
        return "simulated open loop, the law that fits best errs more on held-out records than a constant"
    least, largest = resistance(finding, law.model)
    if least < -NEGATIVE_SHARE * largest:
        return GIVES_ENERGY
    return ""


def listed_instead(fits: MachineFits, finding: MachineFinding) -> str:
    """Name a term of the catalogue that leaves nothing beside a number left free; empty if none does.

    The search for names had that number held, where nothing of the catalogue may stand out. A term with a
    shape is as free as a law is, and no simpler.
    """
    training, held_out = fits.blocks()
    own = finding.final.terms
    search = TermSearch(training, fits.candidates, fits.shapes, fits.priors, fits.nonnegative)
    columns = fits.columns(own)
    before = search.losses(columns)
    looked_at = {trial.term.choice for step in finding.steps for trial in step.trials}
    simple = [choice for choice in fits.candidates if choice in looked_at and term_of(choice).shape is None]
    if not simple:
        return ""
    best = max((search.best_shape(one, columns, before) for one in simple), key=lambda one: one.gain)
    without, with_it = (fits.fit(terms, settle=False) for terms in (own, (*own, best.term)))
    fall = fall_of_gap(held_out, without, with_it, finding.seed)
    is_all = fall.is_real and fall.after <= held_out.largest_by_chance
    return best.term.choice.name if is_all else ""


def _inertia_left(law: MachineLaw) -> float:
    """Inertia with a law over that without it; 1 where the force is what is predicted."""
    if law.model.base.response is Response.FORCE:
        return 1.0
    without, with_it = (1.0 + model.nuisance("inertia") for model in (law.without, law.model))
    return with_it / without if without > 0.0 else 1.0
