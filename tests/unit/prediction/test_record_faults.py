"""What a fit says of its record. Truth: the whole least squares problem by numpy, and numpy's gradient."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from impactcell.features import extract
from impactcell.physics import Plant
from impactcell.prediction.block_residuals import rates_of_change
from impactcell.prediction.capture_blocks import linearised_model
from impactcell.prediction.linearised_model import STEPS_OUT, LinearisedModel, parameters_of
from impactcell.records import Samples, as_recorded
from tests.taps import VISCOUS, Tap

PLANT = Plant(6.5e5, 465.0, 0.2, 0.152, effects=VISCOUS)
SOME = np.random.default_rng(4)


@given(
    arrays(np.float64, st.integers(2, 40), elements=st.floats(-10.0, 10.0)),
    st.integers(0, 2**32 - 1),
)
def test_rates_of_change_are_those_of_numpy(values: Samples, seed: int) -> None:
    times = np.cumsum(np.random.default_rng(seed).uniform(0.5, 2.0, len(values)))
    assert rates_of_change(times, values) == pytest.approx(np.gradient(values, times), abs=1e-12)


def test_a_single_value_has_no_rate() -> None:
    assert rates_of_change(np.zeros(1), np.ones(1)).tolist() == [0.0]
    assert rates_of_change(np.zeros(0), np.ones(0)).tolist() == []


def model_of_a_tap() -> tuple[LinearisedModel, Samples]:
    capture = Tap(0.05).capture(np.random.default_rng(1), force_hz=1e5)
    response = linearised_model(extract(as_recorded(capture)), PLANT)
    return response, np.append(parameters_of(PLANT), [0.3, -0.2, 0.1, 0.4, -0.5])


def whole_problem(response: LinearisedModel, theta: Samples) -> tuple[Samples, Samples]:
    """Residuals and derivative without any disturbance, from the traces."""
    force, position = response.linearise(theta).traces
    copies, split = len(theta) + 1, len(response.force_time_s)
    model = np.hstack([force.reshape(copies, split), position.reshape(copies, -1)])
    derivative = (model[:1] - model[1:]) * response._weights / STEPS_OUT[:, None]
    return (response._values - model[0]) * response._weights, derivative


@pytest.mark.parametrize("known", [0, 2])
def test_products_with_disturbances_are_those_of_the_whole_problem(known: int) -> None:
    """Each size of a disturbance in the fit is one more unknown, and one more row for its prior."""
    response, theta = model_of_a_tap()
    n = len(response._values)
    scale = np.where(np.arange(n) < len(response.force_time_s), 2.0, 1e-5)
    inside, outside = SOME.normal(size=(known, n)) * scale, SOME.normal(size=(3, n)) * scale
    for shape in inside:
        response = response.disturbed_by(shape)
    residual, derivative = whole_problem(response, theta)
    columns = np.vstack([(inside * response._weights).T, np.eye(known)])

    def left(rows: Samples) -> Samples:
        """Give what no sizes of the disturbances in the fit explain."""
        target = np.vstack([rows.T, np.zeros((known, len(rows)))])
        return np.asarray(target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0])

    fitted = response.linearise(theta)
    by_residual, by_derivative, by_each_other = response.products_with(outside, fitted)
    shapes = outside * response._weights
    assert by_residual == pytest.approx(left(shapes).T @ left(residual[None])[:, 0], rel=1e-9)
    assert by_derivative == pytest.approx(left(shapes).T @ left(derivative), rel=1e-6)  # differences
    assert by_each_other == pytest.approx(left(shapes).T @ left(shapes), rel=1e-9)


def test_the_size_of_a_disturbance_in_a_fit_is_that_of_the_whole_problem() -> None:
    response, theta = model_of_a_tap()
    shape = SOME.normal(size=len(response._values)) * 1e-4
    disturbed = response.disturbed_by(shape)
    residual, _ = whole_problem(response, theta)
    column = np.append(shape * response._weights, 1.0)
    size = float(column @ np.append(residual, 0.0)) / float(column @ column)
    assert response.size_of(shape, disturbed.linearise(theta).residual) == pytest.approx(size, abs=1e-9)
