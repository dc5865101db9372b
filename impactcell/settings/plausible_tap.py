"""What of a cell is hardly meant as it stands: a mass in grams, a stiffness in N/mm, taps without motion."""

import math
from collections.abc import Iterator
from typing import Final

from impactcell.records import MM_PER_MIN
from impactcell.records.plausible_range import STROKE, PlausibleRange
from impactcell.settings.cells import CellConfig

MASS: Final = PlausibleRange("a mass", "kg", 0.01, 1e3, {"g": 1e-3, "t": 1e3})
VELOCITY: Final = PlausibleRange(
    "a velocity", "mm/min", 60.0, 6e4, {"mm/s": 60.0, "m/min": 1e3, "m/s": 1.0 / MM_PER_MIN}
)
STIFFNESS: Final = PlausibleRange("a stiffness", "N/m", 1e4, 1e9, {"N/mm": 1e3, "N/µm": 1e6})
DAMPING: Final = PlausibleRange("a damping", "N s/m", 1.0, 1e5, {"N s/mm": 1e3, "N s/µm": 1e6})
FRICTION: Final = PlausibleRange("a friction coefficient", "", 0.01, 1.5, {"%": 0.01})
TRAVEL: Final = PlausibleRange("a travel", "mm", 0.1, 1e3, {"m": 1e3, "µm": 1e-3}, "parts")
TIMEOUT: Final = PlausibleRange("a timeout", "ms", 5.0, 6e4, {"s": 1e3, "µs": 1e-3}, "links")
"""Ranges beyond which a value was hardly meant, with the units that it may have been said in. Our choice."""
IN_THE_MAP: Final = ("module", "register_map")
"""Where the cell file names what stands in the register map."""
IN_THE_MODEL: Final = ("model",)
"""Where it names what stands in the model file."""


def doubted_values(cell: CellConfig) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield the place in the cell file and the doubt for each value that is hardly meant."""
    settings, plant, constants = cell.settings, cell.model.plant, cell.register_map.constants
    actuator, positioning = settings.actuator, settings.positioning
    said: tuple[tuple[tuple[str, ...], PlausibleRange, float | None], ...] = (
        (("part", "mass_kg"), MASS, settings.part.mass_kg),
        (("actuator", "stroke_mm"), STROKE, actuator.stroke_mm),
        (("actuator", "max_stroke_mm"), STROKE, actuator.max_stroke_mm),
        (("actuator", "max_velocity_mm_per_min"), VELOCITY, actuator.max_velocity_mm_per_min),
        (("alarms", "wear_limit"), FRICTION, settings.alarms.wear_limit),
        (("positioning", "travel_mm"), TRAVEL, positioning.travel_mm if positioning else None),
        (("module", "timeout_ms"), TIMEOUT, settings.module.timeout_ms),
        (IN_THE_MAP, MASS, constants.get("mass")),
        (IN_THE_MAP, STROKE, 1e3 * constants["stroke"] if "stroke" in constants else None),
        (IN_THE_MODEL, STIFFNESS, plant.stiffness_n_per_m),
        (IN_THE_MODEL, DAMPING, plant.damping_n_s_per_m or None),
        (IN_THE_MODEL, FRICTION, plant.mu_s),
        (IN_THE_MODEL, FRICTION, plant.mu_k),
    )
    owners = {IN_THE_MAP: f"{cell.register_map.name}: ", IN_THE_MODEL: f"model '{cell.model.name}': "}
    for place, plausible, value in said:
        doubt = "" if value is None else plausible.doubt(value)
        if doubt:
            yield place, owners.get(place, "") + doubt


def immovable(cell: CellConfig) -> str:
    """Say that no tap can move the part; empty where one may, or where the module tells mass and stroke.

    While the part sticks an actuator at v pushes with k v t + b v, after its stroke s with k s + b v, and
    static friction holds mu_s m g: equations (1) and (3) of the source paper.
    """
    settings, plant, constants = cell.settings, cell.model.plant, cell.register_map.constants
    mass_kg = settings.part.mass_kg or constants.get("mass", math.nan)
    stroke_m = 1e-3 * (settings.actuator.stroke_mm or math.nan)
    if math.isnan(stroke_m):
        stroke_m = constants.get("stroke", math.nan)
    velocity_m_s = settings.actuator.max_velocity_mm_per_min * MM_PER_MIN
    pushes_n = plant.stiffness_n_per_m * stroke_m + plant.damping_n_s_per_m * velocity_m_s
    holds_n = plant.mu_s * mass_kg * plant.gravity_m_s2
    if not pushes_n < holds_n:
        return ""
    return (
        f"no tap moves the part: the fastest pushes with k s + b v = {pushes_n:.4g} N at most, static "
        f"friction holds mu_s m g = {holds_n:.4g} N; see mass, stroke, velocity and the model's stiffness, "
        "and their units"
    )
