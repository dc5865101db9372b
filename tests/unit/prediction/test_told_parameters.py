"""A parameter of the contact whose standard deviation is near its value is told by nothing."""

from dataclasses import replace
from pathlib import Path

import pytest

from impactcell.prediction.told_parameters import parameters_in_words, untold
from impactcell.settings.model_file import read_model

MODEL = read_model(Path("config/models/prototype.yaml"))


@pytest.mark.parametrize(
    ("name", "std", "value"),
    [
        ("stiffness_std_n_per_m", "stiffness_n_per_m", MODEL.plant.stiffness_n_per_m),
        ("damping_std_n_s_per_m", "damping_n_s_per_m", MODEL.plant.damping_n_s_per_m),
        ("ratio_std", "ratio", MODEL.ratio),
    ],
)
def test_a_parameter_is_told_up_to_a_share_of_its_value(name: str, std: str, value: float) -> None:
    for share, names in ((0.25, ()), (0.35, (std,)), (float("nan"), (std,)), (float("inf"), (std,))):
        model = replace(MODEL, prior=replace(MODEL.prior, **{name: share * value}))
        assert untold(model) == names
        assert untold(model, replace(MODEL.prior, **{name: 0.4 * value})) == (
            names if not share < 0.4 else ()
        ), "what the model in service knows no better is no reason to keep it"


def test_damping_of_none_is_told_by_how_little_it_can_be() -> None:
    """Where a law takes the place of b its interval ends at 0, and its width is more than b itself."""
    plant = replace(MODEL.plant, stiffness_n_per_m=4.2e5, damping_n_s_per_m=0.112)
    none = replace(MODEL, plant=plant, prior=replace(MODEL.prior, damping_std_n_s_per_m=0.252))
    assert untold(none) == ()
    assert untold(replace(none, prior=replace(none.prior, damping_std_n_s_per_m=50.0))) == (
        "damping_n_s_per_m",
    )


def test_a_parameter_is_said_with_what_95_per_cent_hold() -> None:
    wide = replace(MODEL, prior=replace(MODEL.prior, stiffness_std_n_per_m=2.5e10))
    said = parameters_in_words(wide, ("stiffness_n_per_m",))
    assert said.startswith("k ")
    assert said.endswith(" ± 5e+10 N/m (± is 95 %)")
