"""Pictures of a law that nobody had listed: the free-form term with its band, and the law beside it."""

from collections.abc import Sequence
from types import ModuleType

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from impactcell.discrepancy.laws import FittedFunction
from impactcell.discrepancy.report.figures import AFTER, BEFORE, MEASURED, STYLE, svg
from impactcell.discrepancy.workflow import DiscrepancyResult
from impactcell.physics.free_column_forms import printed
from impactcell.records import Samples


def law_figure(result: DiscrepancyResult, said: ModuleType) -> str | None:
    """Free-form term with its band, the law beside it, and where the covariate was met."""
    finding = result.law
    if finding is None or finding.refused:
        return None
    form, law = finding.term.form, finding.proposed
    if finding.slices:
        laws = [
            law.values(np.column_stack([curve.covariate, np.full(curve.covariate.size, w)]))
            for w, curve in finding.slices
            if law is not None
        ]
        return slices_figure(
            finding.slices,
            (laws, "" if law is None else law.functional_form),
            (form.covariate, form.covariate_unit),
            (printed(form.second), form.second_unit),
            form.unit,
            less_mean=False,
            said=said,
        )
    return function_figure(
        finding.function,
        None if law is None else (law.values(finding.function.covariate), law.functional_form),
        finding.term.visited.values,
        (form.covariate, form.covariate_unit, form.unit),
        less_mean=bool(form.constant_is),
        said=said,
    )


def slices_figure(
    slices: Sequence[tuple[float, FittedFunction]],
    laws_and_name: tuple[Sequence[Samples], str],
    first_and_unit: tuple[str, str],
    second_and_unit: tuple[str, str],
    function_unit: str,
    *,
    less_mean: bool,
    said: ModuleType,
) -> str:
    """Draw a function of two covariates along the first at three values of the second, with its bands.

    Parameters
    ----------
    slices : sequence of (float, FittedFunction)
        Values of the second covariate, and the function there.
    laws_and_name : (sequence of ndarray, str)
        Values of a law where the slices have them, and its name; none without one.
    first_and_unit, second_and_unit : (str, str)
    function_unit : str
    less_mean : bool
        The model takes a constant up, so that it is no difference.
    said : module
        `sentences`, or the one of another language.
    """
    (covariate, covariate_unit), (second, second_unit) = first_and_unit, second_and_unit
    scale, unit = (1e3, "mm") if covariate_unit == "m" else (1.0, covariate_unit)
    of_second, unit_of_second = (1e3, "mm") if second_unit == "m" else (1.0, second_unit.strip("1"))
    level = float(np.mean([curve.function for _, curve in slices])) if less_mean else 0.0
    laws, name = laws_and_name
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 3.4))
        axes = figure.subplots()
        axes.axhline(0.0, color="#8a97a3", linewidth=0.8)
        for number, ((w, curve), style) in enumerate(zip(slices, ("-", "--", ":"), strict=True)):
            u = scale * curve.covariate
            at = said.written(f"w = {of_second * w:.3g} {unit_of_second}".rstrip())
            axes.fill_between(
                u, curve.low - level, curve.high - level, color=MEASURED, alpha=0.4, linewidth=0
            )
            axes.plot(u, curve.function - level, style, color=BEFORE, label=f"{said.label('spline')}, {at}")
            if laws:
                axes.plot(u, laws[number], style, color=AFTER, label=f"{name}, {at}")
        what = said.label("s(u, w) less its mean") if less_mean else "s(u, w)"
        axes.set_ylabel(what if function_unit == "1" else f"{what} [{function_unit}]")
        axes.set_xlabel(
            f"u, {said.phrase(covariate)} [{unit}]; w, {said.phrase(second)}; {said.label('95 % bands')}"
        )
        axes.legend(frameon=False, fontsize=8)
        return svg(figure, said)


def function_figure(
    curve: FittedFunction,
    law: tuple[Samples, str] | None,
    met: Samples,
    covariate_and_units: tuple[str, str, str],
    *,
    less_mean: bool,
    said: ModuleType,
) -> str:
    """Spline with its band, a law beside it, and where the covariate was met.

    Parameters
    ----------
    curve : FittedFunction
    law : (ndarray, str) or None
        Values of the law where the curve has them, and its name.
    met : ndarray
        Values of the covariate.
    covariate_and_units : (str, str, str)
        Covariate, its unit and that of the function.
    less_mean : bool
        The model takes a constant up, so that it is no difference: both are drawn about their means.
    said : module
        `sentences`, or the one of another language.
    """
    covariate, covariate_unit, function_unit = covariate_and_units
    level = float(np.mean(curve.function)) if less_mean else 0.0
    scale, unit = (1e3, "mm") if covariate_unit == "m" else (1.0, covariate_unit)
    u = scale * curve.covariate
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 3.4))
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(4, 1))
        above.axhline(0.0, color="#8a97a3", linewidth=0.8)
        above.fill_between(u, curve.low - level, curve.high - level, color=MEASURED, alpha=0.5, linewidth=0)
        above.plot(u, curve.function - level, color=BEFORE, label=said.label("spline, 95 % band"))
        if law is not None:
            function, name = law
            shift = float(np.mean(function)) if less_mean else 0.0
            above.plot(u, function - shift, "--", color=AFTER, label=name)
        what = said.label("s(u) less its mean") if less_mean else "s(u)"
        above.set_ylabel(what if function_unit == "1" else f"{what} [{function_unit}]")
        above.legend(frameon=False, fontsize=8)
        below.hist(scale * met, bins=60, color=MEASURED)
        below.set_yticks([])
        below.set_xlabel(f"u, {said.phrase(covariate)} [{unit}]; {said.label('below: where samples lie')}")
        return svg(figure, said)
