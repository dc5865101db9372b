"""Figures 2, 3 and 4: response to a tap, peak force and sliding distance, error of equations (4)-(6).

The paper's text, not its images, was at hand: each figure shows what the text needs at that place. 2 is the
simulated response of (1)-(3), 3 the two figures that (4) and (5) describe, against velocity and friction, and
4 the error of mu_s by (4), (5), (6) with sensor noise and 3 % scatter of mu_k/mu_s, and the weights of (6).
Plant: the reference plant, with which the printed coefficients come back.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from impactcell.figures._style import COLOURS, DASHES, GREY, MARKERS, write_figures
from impactcell.physics import Plant, TapEventKind, TapInput, simulate_tap
from impactcell.prediction import Model, Prior, calibrate, estimate, printed_predictor
from impactcell.prediction.equations import force_weight
from impactcell.prediction.mass_interpolation import MassInterpolation
from impactcell.records import Capture, Channel, Samples

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MASS_KG = 18.9
"""Of the paper's part, steel on carbide."""
RATIO = 0.76
"""mu_k / mu_s with which equations (4) and (5) come back from (1)-(3); own fit."""
FRICTIONS = (0.15, 0.20, 0.25)
"""mu_s: ends and middle of the paper's range."""
NOISE_N, NOISE_M, RATE_HZ = 0.4, 1.5e-6, 1e4
"""Standard deviations of force (N) and position (m) and sampling rate of the prototype's sensors."""
SHOTS = 40
"""Taps for each velocity of figure 4: its mean errors are known to some 0.3 %."""
REPORTED_PERCENT = 3.6
"""Average error of (6) above 3000 mm/min that the paper reports."""


def draw(directory: Path) -> list[Path]:
    """Write figures 2, 3 and 4 as PNG and SVG."""
    return write_figures(
        directory,
        (
            ("figure-2-response", (6.7, 5.0), response),
            ("figure-3-peak-force-and-sliding-distance", (6.7, 3.2), force_and_distance),
            ("figure-4-error-of-the-estimate", (6.7, 3.2), errors),
        ),
    )


def plant(mu_s: float, ratio: float = RATIO) -> Plant:
    """Give the reference plant another friction."""
    viscous = {"viscous_friction": {"viscous_coefficient_n_s_per_m": 85.0}}
    return Plant(6.5e5, 465.0, mu_s, ratio * mu_s, effects=viscous)


def tap(velocity_mm_per_min: float) -> TapInput:
    """Strike the reference part; the actuator halts as it loses it."""
    return TapInput(velocity_mm_per_min / 6e4, MASS_KG, halts_at_separation=True)


def response(figure: "Figure") -> None:
    """Draw contact force, velocity and position of one tap at three frictions."""
    top, middle, bottom = figure.subplots(3, 1, sharex=True)
    times = np.linspace(-3e-3, 0.115, 2400)
    for mu, colour, dash in zip(FRICTIONS, COLOURS, DASHES, strict=True):
        motion = simulate_tap(plant(mu), tap(4000))
        traces = motion.sample(times)
        line = {"color": colour, "linestyle": dash}
        top.plot(1e3 * times, traces.force_n, label=rf"$\mu_s$ = {mu:.2f}", **line)
        middle.plot(1e3 * times, 1e3 * traces.velocity_m_s, **line)
        bottom.plot(1e3 * times, 1e3 * traces.position_m, **line)
        bottom.plot([1e3 * motion.stop_s], [1e3 * motion.displacement_m], "o", color=colour, markersize=4)
        peak = np.argmax(traces.force_n)
        top.plot([1e3 * times[peak]], [motion.peak_force_n], "o", color=colour, markersize=4)
    last = simulate_tap(plant(FRICTIONS[0]), tap(4000))
    traces = last.sample(times)
    driven = times <= last.separation_s
    bottom.plot(1e3 * times[driven], 1e3 * traces.actuator_m[driven], color=GREY, linestyle=":")
    bottom.annotate("actuator", (12.0, 0.8), (24.0, 0.4), color=GREY, va="center",
                    arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.6})  # fmt: skip
    driven_at = 1e3 * tap(4000).velocity_m_s
    middle.plot([0.0, 1e3 * last.separation_s], [driven_at, driven_at], color=GREY, linestyle=":")
    middle.annotate("actuator", (14.0, driven_at), (24.0, 30.0), color=GREY, va="center",
                    arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.6})  # fmt: skip
    separation_s = [event.time_s for event in last.events if event.kind is TapEventKind.SEPARATION][-1]
    for axis in (top, middle, bottom):
        axis.axvline(1e3 * separation_s, color=GREY, linewidth=0.6, linestyle=":")
    top.annotate(
        "contact is lost", (1e3 * separation_s, 150), xytext=(4, 0), textcoords="offset points", color=GREY
    )
    top.set_ylabel("contact force / N")
    middle.set_ylabel("velocity / (mm/s)")
    bottom.set_ylabel("position / mm")
    bottom.set_xlabel("time since first contact / ms")
    top.legend(loc="upper right")
    figure.suptitle(f"One tap at 4000 mm/min, {MASS_KG} kg", fontsize=9)


def force_and_distance(figure: "Figure") -> None:
    """Draw both figures against velocity: the model, and (4) and (5) as printed."""
    left, right = figure.subplots(1, 2)
    velocities = np.linspace(2000, 6000, 17)
    curve = np.linspace(2000, 6000, 200)
    paper = MassInterpolation(MASS_KG, ((1.0, printed_predictor()),), inside=True)
    for mu, colour, marker in zip(FRICTIONS, COLOURS, MARKERS, strict=True):
        motions = [simulate_tap(plant(mu), tap(float(v))) for v in velocities]
        forces_n = [motion.peak_force_n for motion in motions]
        points = {"color": colour, "marker": marker, "linestyle": "", "markersize": 3.2}
        left.plot(velocities, forces_n, **points)
        right.plot(velocities, [1e3 * motion.sliding_distance_m for motion in motions], **points)
        left.plot(curve, [paper.peak_force(mu, v / 6e4) for v in curve], color=colour)
        right.plot(curve, [1e3 * paper.sliding_distance(mu, v / 6e4) for v in curve], color=colour)
        right.plot([], [], label=rf"$\mu_s$ = {mu:.2f}, model (1)-(3)", **points)
    right.plot([], [], color=GREY, label="(4), (5) as printed")
    right.legend(loc="upper left")
    left.set_ylabel("peak force / N")
    right.set_ylabel("sliding distance / mm")
    for axis in (left, right):
        axis.set_xlabel("velocity / (mm/min)")
        axis.set_ylim(bottom=0)


def errors(figure: "Figure") -> None:
    """Draw the error of mu_s against velocity, with noise and scatter of mu_k/mu_s, and the weights."""
    left, right = figure.subplots(1, 2, width_ratios=(1.45, 1.0))
    velocities = np.linspace(2000, 6000, 9)
    predictors = calibrate(
        plant(0.2), tap(6000), [MASS_KG], np.linspace(2000, 6000, 17) / 6e4, np.linspace(0.15, 0.25, 17)
    )
    model = Model("figure", plant(0.2), Prior(6500.0, 9.3, 0.03 * RATIO), predictors)
    mean = np.array([_mean_errors(model, float(v)) for v in velocities])
    for column, (label, colour, marker) in enumerate(
        (
            ("(4) peak force", COLOURS[0], "s"),
            ("(5) sliding distance", COLOURS[2], "^"),
            ("(6) combined", "black", "o"),
        )
    ):
        left.plot(velocities, mean[:, column], marker=marker, color=colour, markersize=4, label=label)
    left.axhline(REPORTED_PERCENT, color=GREY, linestyle="--", linewidth=0.9)
    left.annotate(
        f"reported in the paper for (6), v > 3000: {REPORTED_PERCENT} %",
        (6000, REPORTED_PERCENT),
        ha="right",
        va="bottom",
        color=GREY,
    )
    left.set_ylim(0, 4.4)
    left.set_ylabel(r"mean error of $\mu_s$ / %")
    left.legend(loc="lower left")
    mixed = MassInterpolation(MASS_KG, ((1.0, printed_predictor()),), inside=True)
    frictions = np.linspace(0.15, 0.25, 101)
    weights = np.array([force_weight(mixed, mu, 0.075) for mu in frictions])  # the same at every velocity
    right.plot(frictions, weights, color=COLOURS[0], label="peak force")
    right.plot(frictions, 1.0 - weights, color=COLOURS[2], linestyle=DASHES[1], label="sliding distance")
    right.set_ylim(0, 1)
    right.set_ylabel("weight in (6)")
    right.set_xlabel(r"$\mu_s$")
    right.legend(loc="lower left")
    left.set_xlabel("velocity / (mm/min)")


def _mean_errors(model: Model, velocity_mm_per_min: float) -> Samples:
    """Mean error of (4), (5), (6) in percent over frictions and scatters, the same draws at each velocity."""
    rng = np.random.default_rng(4)
    frictions, ratios = rng.uniform(0.16, 0.24, SHOTS), RATIO * (1.0 + 0.03 * rng.standard_normal(SHOTS))
    shares = []
    for mu, ratio in zip(frictions.tolist(), ratios.tolist(), strict=True):
        command = tap(velocity_mm_per_min)
        motion = simulate_tap(plant(mu, ratio), command)
        times = np.arange(1, round((motion.stop_s + 0.02) * RATE_HZ)) / RATE_HZ
        traces = motion.sample(times)
        capture = Capture(
            1,
            command.velocity_m_s,
            MASS_KG,
            Channel(times, traces.force_n + rng.normal(0.0, NOISE_N, len(times)), NOISE_N),
            Channel(times, traces.position_m + rng.normal(0.0, NOISE_M, len(times)), NOISE_M),
        )
        friction = estimate(capture, model)
        coefficients = (friction.by_force, friction.by_distance, friction.combined)
        shares.append([abs(coefficient.value / mu - 1.0) for coefficient in coefficients])
    means: Samples = 100.0 * np.nanmean(np.array(shares), axis=0)
    return means
