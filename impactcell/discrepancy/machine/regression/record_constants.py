"""A constant force of its own in each record: the zero of a sensor or a drive that is set anew each time."""

from dataclasses import replace

import numpy as np

from impactcell.discrepancy.machine.regression.nuisance_priors import OFFSET
from impactcell.discrepancy.machine.regression.weak_form import IndexArray, Rows
from impactcell.records import Samples

MOST = 0.5
"""Share of what remains from which on constants of each record that would take it are told of [1]."""


def without_constants(rows: Rows, part: IndexArray, weight: Samples | None = None) -> Rows:
    """Take from the target and every column what a constant force of each part of the rows explains.

    With c the column of a constant force what is left of y is y - c (c'y / c'c), part by part: least squares
    with a free constant in each (Frisch and Waugh 1933). A row's variance falls by what its own noise moves
    the constant.

    Parameters
    ----------
    rows : Rows
    part : ndarray of int, shape (n,)
        Rows of the same number share a constant.
    weight : ndarray, shape (n,), optional
        By which the constants are found, of rows that are not weighed themselves.
    """
    constant = rows.columns[OFFSET]
    finding = constant if weight is None else weight**2 * constant
    squares = np.bincount(part, finding * constant)
    share = finding / np.where(squares > 0.0, squares, 1.0)[part]

    def left(values: Samples) -> Samples:
        taken: Samples = values - constant * np.bincount(part, share * values)[part]
        return taken

    return replace(
        rows,
        target=left(rows.target),
        columns={name: left(values) for name, values in rows.columns.items()},
        variance=rows.variance * np.maximum(1.0 - share * constant, 0.0),
    )


def constants_note(share: float) -> list[str]:
    """Say what constants of each record would take of what remains, if it is most of it."""
    if share < MOST:
        return []
    note = (
        f"A constant force of its own in each record would take {100.0 * share:.0f} % of what remains: "
        "force_offset: {std: free, each: record} among the nuisances of the base model leaves it open."
    )
    return [note]
