"""What records need to have for a base model to be held against them."""

from collections.abc import Sequence

from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.terms.base_model import BaseModel
from impactcell.errors import CampaignError

LONGEST_DELAY = 0.25
"""Share of a record up to which a delay may be stated: no force goes with so much of it. Our choice."""
LEAST_FOR_THIRDS = 2.0
"""Blocks in the longest record up to which no third of any can be a block."""


def check_delay(base: BaseModel, records: Sequence[UniformRecord]) -> None:
    """See that records have the force that a stated delay asks for.

    Raises
    ------
    CampaignError
        The delay is of the size of a record.
    """
    delay_s = base.delay_s.value
    shortest = min(records, key=lambda record: float(record.time_s[-1]))
    length_s = float(shortest.time_s[-1])
    if abs(delay_s) > LONGEST_DELAY * length_s:
        raise CampaignError(
            f"the base model's delay_s is {delay_s:.3g} s, and shot {shortest.shot} lasts {length_s:.3g} s: "
            f"no force of so much {'later' if delay_s > 0.0 else 'earlier'} is in it; state delay_s in "
            "seconds, 0.003 for 3 ms"
        )


def check_columns(base: BaseModel, records: Sequence[UniformRecord]) -> None:
    """See that every shot has the columns of `shots.csv` that the base model goes by.

    Raises
    ------
    CampaignError
        One lacks one.
    """
    for choice in base.terms:
        lacking = [str(record.shot) for record in records if choice.covariate not in record.covariates]
        if choice.covariate and lacking:
            raise CampaignError(
                f"{choice.identifier} goes by the column {choice.covariate!r} of shots.csv, which shots "
                f"{', '.join(lacking)} do not state"
            )


def check_blocks(fits: MachineFits) -> None:
    """See that there is something to fit and something held out.

    Raises
    ------
    CampaignError
        There is not.
    """
    thirds = fits.held is None
    longest_s = max(float(record.time_s[-1]) for record in fits.records)
    if thirds and longest_s < LEAST_FOR_THIRDS * fits.block_s:
        raise _too_short(fits)
    if not fits.rows().target.size:
        raise CampaignError(
            "nowhere does the part move faster than the noise of its position shows: record a larger or "
            "faster motion, or state noise_std_m (of a rotation noise_std_rad) in campaign.yaml if it is less"
        )
    training, held_out = fits.blocks()
    if len(training) and len(held_out):
        return
    used = "held out" if len(training) else "fitted"
    records = [
        record
        for place, record in enumerate(fits.records)
        if fits.held is None or (place in fits.held) is (used == "held out")
    ]
    needed_s = fits.block_s * (3.0 if thirds else 1.0)
    if max(float(record.time_s[-1]) for record in records) >= needed_s:
        which = "the last third of each record"
        if not thirds:
            which = f"shots {', '.join(str(record.shot) for record in records)}"
        or_gaps = ", or too briefly between gaps in time," if any(record.gaps for record in records) else ""
        raise CampaignError(
            f"what is {used} ({which}) moves too little{or_gaps} for a block of {fits.block_s:.3g} s: hold "
            f"{'whole' if thirds else 'other'} records out (--test), or record a larger or faster motion"
        )
    raise _too_short(fits)


def _too_short(fits: MachineFits) -> CampaignError:
    """Say that records are too short for blocks."""
    thirds = fits.held is None
    return CampaignError(
        f"the records are too short for blocks of {fits.block_s:.3g} s"
        f"{', of which the last third of each is held out' if thirds else ''}: "
        f"{'hold whole records out (--test), ' if thirds else ''}make them longer, or say a shorter "
        "`block_s` in the base model"
    )
