"""What is to be said of the open-loop simulation of held-out records beside its figures."""

from impactcell.discrepancy.machine import MachineFinding, OpenLoopError, drifts

DRIFTS = (
    "Nothing pulls back here, and the smallest constant force adds up: in the simulation each held-out "
    "record has one of its own, with what is named and without."
)
"""What is said where the zero of the force is each held-out record's own."""
BY_RECORD = (
    "Each record has a constant force of its own, held-out ones as well: gaps and simulation are of what it "
    "leaves, with what is named and without."
)
"""The same where the base model says so."""


def notes_of_simulation(finding: MachineFinding, errors: tuple[OpenLoopError, OpenLoopError]) -> list[str]:
    """Say what a simulation takes from held-out records, and where it errs more with what is named.

    Parameters
    ----------
    finding : MachineFinding
    errors : (OpenLoopError, OpenLoopError)
        Without and with what is named.
    """
    before, after = (error.rmse for error in errors)
    base = finding.base
    notes = []
    if base.force_offset_by_record:
        notes.append(BY_RECORD)
    elif drifts(base):
        notes.append(DRIFTS)
    if finding.established and after > before:
        notes.append(
            f"Simulated open loop, held-out records are {after:.3g} {base.unit} off with it, {before:.3g} "
            "without."
        )
    return notes
