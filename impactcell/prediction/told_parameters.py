"""Which parameters of a model's contact are told, and in what words: so wide a prior is none."""

import math
from collections.abc import Collection
from typing import Final

from impactcell.prediction.model import Model, Prior
from impactcell.records.uncertainty import plus_minus

LARGEST_SHARE: Final = 0.3
"""Standard deviation over the value above which nothing tells a parameter: by then zero itself is hardly
three of them away, and a tap is fitted as if nothing were known. Own choice: k and b of a campaign that tells
them are known ten times better."""
SMALLEST_DAMPING_RATIO: Final = 0.01
"""Of a part of 1 kg: damping below it is as good as none, as where a law takes its place, and so has no size
of its own that its standard deviation could be compared with."""


def parameters_in_words(model: Model, names: Collection[str] | None = None) -> str:
    """Say the parameters of the contact, or those named, with what is told of their standard deviations."""
    plant, prior = model.plant, model.prior
    stiffness = plus_minus(plant.stiffness_n_per_m, prior.stiffness_std_n_per_m, ".6g", ".2g")
    damping = plus_minus(plant.damping_n_s_per_m, prior.damping_std_n_s_per_m, ".5g", ".2g")
    ratio = plus_minus(model.ratio, prior.ratio_std, ".4f", ".2g")
    words = {
        "stiffness_n_per_m": f"k {stiffness} N/m",
        "damping_n_s_per_m": f"b {damping} N s/m",
        "ratio": f"mu_k/mu_s {ratio}",
    }
    told = [said for name, said in words.items() if names is None or name in names]
    return f"{', '.join(told)} (± is 95 %)"


def untold(model: Model, before: Prior | None = None) -> tuple[str, ...]:
    """Name the parameters of the contact that nothing tells; none that `before` knew no better."""
    plant = model.plant
    light_damping = SMALLEST_DAMPING_RATIO * 2.0 * math.sqrt(plant.stiffness_n_per_m * 1.0)
    magnitudes = {
        "stiffness_n_per_m": plant.stiffness_n_per_m,
        "damping_n_s_per_m": max(plant.damping_n_s_per_m, light_damping),
        "ratio": model.ratio,
    }
    stds, known = _stds(model.prior), {} if before is None else _stds(before)
    return tuple(
        name
        for name, magnitude in magnitudes.items()
        if not stds[name] <= max(LARGEST_SHARE * magnitude, known.get(name, 0.0))
    )


def _stds(prior: Prior) -> dict[str, float]:
    return {
        "stiffness_n_per_m": prior.stiffness_std_n_per_m,
        "damping_n_s_per_m": prior.damping_std_n_s_per_m,
        "ratio": prior.ratio_std,
    }
