"""What is to be said of the open-loop simulation of held-out records beside its figures."""

from impactcell.campaign import Coordinate
from impactcell.discrepancy.machine import MachineFinding, OpenLoopError, Response


def notes_of_simulation(finding: MachineFinding, errors: tuple[OpenLoopError, OpenLoopError]) -> list[str]:
    """Say where a simulation errs more with what is named than without.

    Parameters
    ----------
    finding : MachineFinding
    errors : (OpenLoopError, OpenLoopError)
        Without and with what is named.
    """
    before, after = (error.rmse for error in errors)
    if not finding.established or after <= before:
        return []
    base = finding.base
    if base.response is Response.FORCE:
        unit, why = ("N m" if base.coordinate is Coordinate.ROTATION else "N"), ""
    else:
        unit = "rad" if base.coordinate is Coordinate.ROTATION else "m"
        why = ": the forces agree better, but a small constant force, which differs between records, adds up"
    said = f"Simulated open loop, held-out records are {after:.3g} {unit} off with it, {before:.3g} without"
    return [f"{said}{why}."]
