"""What another model changes in a cell, parameter by parameter."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from impactcell.physics.law_table import NOMINAL_PARAMETERS
from impactcell.prediction import Model
from impactcell.records.uncertainty import TOLD_STDS

Value = float | Sequence[float]


@dataclass(frozen=True, slots=True)
class ParameterChange:
    """A parameter by its name, an effect's after the effect's; None for what is not there."""

    parameter: str
    before: Value | None
    after: Value | None
    ci95: list[float] | None

    @property
    def sentence(self) -> str:
        """Say it in a line."""
        ends = self.ci95
        interval = "" if ends is None else f" (95 %: {_text(ends[0])} to {_text(ends[1])})"
        return f"{self.parameter}: {_text(self.before)} -> {_text(self.after)}{interval}"


def model_changes(before: Model, after: Model) -> list[ParameterChange]:
    """List the parameters of the plant and its effects that differ, with the 95 % intervals of the second."""
    old, new = dict(_parameters(before)), dict(_parameters(after))
    return [
        ParameterChange(name, old.get(name), new.get(name), _interval(after, name))
        for name in dict.fromkeys((*old, *new))
        if not _is_same(old.get(name), new.get(name))
    ]


def _parameters(model: Model) -> Iterator[tuple[str, Value]]:
    for name in NOMINAL_PARAMETERS:
        yield name, getattr(model.plant, name)
    for effect, parameters in model.plant.effects.items():
        for name, value in parameters.items():
            yield f"{effect}.{name}", list(value) if isinstance(value, Sequence) else value


def _is_same(old: Value | None, new: Value | None) -> bool:
    return old == new or (
        isinstance(old, float) and isinstance(new, float) and math.isclose(old, new, rel_tol=1e-9)
    )


def _interval(model: Model, name: str) -> list[float] | None:
    """Give the 95 % interval of a parameter; of the contact's own, what the model's prior says of them."""
    stds = {
        "stiffness_n_per_m": model.prior.stiffness_std_n_per_m,
        "damping_n_s_per_m": model.prior.damping_std_n_s_per_m,
    }
    if name in stds:
        value, told = getattr(model.plant, name), TOLD_STDS * stds[name]
        return [max(value - told, 0.0), value + told] if math.isfinite(told) else None
    effect, _, parameter = name.rpartition(".")
    ends = model.intervals.get(effect, {}).get(parameter)
    return None if ends is None else list(ends)


def _text(value: Value | None) -> str:
    if value is None:
        return "none"
    return f"{value:.6g}" if isinstance(value, float | int) else ", ".join(f"{v:.6g}" for v in value)
