"""A function that has no form as a table: a law of a machine that only a spline tells."""

import csv
import io

from impactcell.discrepancy.machine import MachineFinding
from impactcell.discrepancy.report.machine_parameters import SYMBOLS, law_covariates

DIGITS = 6
"""Significant ones of its numbers."""


def law_table_text(finding: MachineFinding) -> str:
    """Write the function with its 95 % band over what it is a function of, SI; empty where none is proposed.

    The band is that of the function less its mean: a constant force or friction of the machine takes that up.
    """
    law = finding.law
    if law is None:
        return ""
    symbols = SYMBOLS[finding.base.coordinate]
    names = [
        f"{name}_{unit.replace('/s', '_per_s').replace(' ', '_').lower()}"
        for name, unit in law_covariates(finding).items()
    ]
    kind = "friction" if "friction" in law.place else "force"
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*names, *(f"{what}_{symbols['F']}" for what in (kind, "low", "high"))])
    for at, curve in law.slices or ((None, law.spline),):
        second = () if at is None else (at,)
        for u, *values in zip(curve.covariate, curve.function, curve.low, curve.high, strict=True):
            writer.writerow([f"{value:.{DIGITS}g}" for value in (u, *second, *values)])
    return text.getvalue()
