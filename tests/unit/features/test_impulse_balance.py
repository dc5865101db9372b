"""Force, position, mass and time of a tap belong together. Truth: the simulator's own plant."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impactcell.api.first_model import fit_first_model
from impactcell.campaign.recorded_campaign import from_captures
from impactcell.errors import PredictionError
from impactcell.features import extract
from impactcell.features.impulse_balance import doubts
from impactcell.records import Capture, Channel
from tests.taps import Tap


def scaled(channel: Channel | None, value: float = 1.0, time: float = 1.0) -> Channel:
    assert channel is not None
    return replace(channel, values=value * channel.values, time_s=time * channel.time_s)


def wrong(tap: Capture, what: str) -> Capture:
    """Take a tap as somebody reads it who has a unit, a scale, a sign or a sampling rate wrong."""
    match what:
        case "force":
            return replace(tap, force=scaled(tap.force, 2.0))
        case "pull":
            return replace(tap, force=scaled(tap.force, -1.0))
        case "position":
            return replace(tap, position=scaled(tap.position, 0.1))
        case "backward":
            return replace(tap, position=scaled(tap.position, -1.0))
        case "mass":
            return replace(tap, mass_kg=1e-3 * tap.mass_kg)
        case "rates":
            return replace(tap, force=scaled(tap.force, 1.0, 2.0), position=scaled(tap.position, 1.0, 2.0))
    raise ValueError(what)


@pytest.mark.parametrize(
    ("what", "told"),
    [("force", "N s"), ("pull", "its sign"), ("position", "N s"), ("backward", "against"), ("mass", "N s"),
     ("rates", "N s")],
)  # fmt: skip
def test_what_cannot_be_is_told_with_the_way_out(what: str, told: str) -> None:
    tap = Tap(0.07, stroke_m=1.5e-3).capture(np.random.default_rng(3))
    assert doubts(extract(tap)) == ()
    (text,) = doubts(extract(wrong(tap, what)))
    assert told in text


@pytest.mark.parametrize("stroke_m", [0.7e-3, 1.5e-3, 3e-3])
@pytest.mark.parametrize("ratio", [0.6, 0.76, 0.95])
def test_no_right_tap_is_doubted(stroke_m: float, ratio: float) -> None:
    draw, judged = np.random.default_rng(4), 0
    for _ in range(12):
        mass_kg, stiffness = draw.uniform(3.0, 40.0), 10.0 ** draw.uniform(5.3, 6.2)
        tap = Tap(
            draw.uniform(0.015, 0.1), draw.uniform(0.08, 0.5), ratio, mass_kg, stroke_m,
            int(draw.choice([-1, 1])), stiffness=stiffness,
            damping=draw.uniform(0.01, 0.25) * math.sqrt(stiffness * mass_kg),
        )  # fmt: skip
        if math.isfinite(tap.motion().separation_s):  # else nothing slides free
            assert doubts(extract(tap.capture(draw))) == ()
            judged += 1
    assert judged > 6


@pytest.mark.slow
@pytest.mark.parametrize("what", ["force", "position", "backward", "rates"])
def test_a_first_model_says_what_cannot_be_before_it_asks_for_more_taps(what: str) -> None:
    draw = np.random.default_rng(6)
    velocities = [0.04, 0.05, 0.06, 0.07]
    taps = [
        wrong(Tap(v, stroke_m=1.5e-3, effects={}).capture(draw, cycle=n), what)
        for n, v in enumerate(velocities, 1)
    ]
    try:
        said = fit_first_model(from_captures(taps, 9.81).campaign, "press-1", "journal").shortcomings[0]
    except PredictionError as fault:
        said = str(fault)
    assert "in 4 of 4 taps, cycle 1 for one, " in said
