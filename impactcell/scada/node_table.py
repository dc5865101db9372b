"""Which figure of a snapshot stands behind which node; the nodes themselves are written in the NodeSet2 file.

Conversion from SI to the unit of the node happens here and nowhere else.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from impactcell.records import Coefficient, ModuleStatus, Quality, Samples, Snapshot
from impactcell.scada.interface import Ranges

MM_PER_M: Final = 1e3
UM_PER_M: Final = 1e6
MM_MIN_PER_M_S: Final = 60e3
MS_PER_S: Final = 1e3

Value = float | int | str | bool | list[float]
Reading = tuple[Value, Quality]
Range = tuple[float, float]

HISTORY: Final = (
    "Friction/StaticFriction",
    "Friction/StaticFrictionStdDev",
    "Friction/KineticFriction",
    "Wear/Level",
    "Wear/LevelStdDev",
    "Batch/Offset",
    "Batch/OffsetStdDev",
)
"""Variables whose past can be read."""


@dataclass(frozen=True, slots=True)
class Row:
    """One variable: how it is read off a snapshot, and its EURange from the ranges of the cell."""

    read: Callable[[Snapshot], Reading]
    eu_range: Callable[[Ranges], Range] | None = None


def _coefficient(
    pick: Callable[[Snapshot], Coefficient], *, std: bool = False
) -> Callable[[Snapshot], Reading]:
    def read(snapshot: Snapshot) -> Reading:
        coefficient = pick(snapshot)
        return (coefficient.std if std else coefficient.value), coefficient.quality

    return read


def _plain(pick: Callable[[Snapshot], float], scale: float = 1.0) -> Callable[[Snapshot], Reading]:
    def read(snapshot: Snapshot) -> Reading:
        value = pick(snapshot) * scale
        return value, Quality.BAD if math.isnan(value) else Quality.GOOD

    return read


def _wear(pick: Callable[[Snapshot], float]) -> Callable[[Snapshot], Reading]:
    return lambda snapshot: (pick(snapshot), snapshot.wear.quality)


def _batch(pick: Callable[[Snapshot], float]) -> Callable[[Snapshot], Reading]:
    return lambda snapshot: (pick(snapshot), snapshot.batch.quality)


def _grid(pick: Callable[[Snapshot], Samples], scale: float = 1.0) -> Callable[[Snapshot], Reading]:
    def read(snapshot: Snapshot) -> Reading:
        values: list[float] = (np.asarray(pick(snapshot), dtype=np.float64) * scale).tolist()
        return values, snapshot.signature.quality

    return read


def _friction(ranges: Ranges) -> Range:
    return 0.0, ranges.friction


def _signed_friction(ranges: Ranges) -> Range:
    return -ranges.friction, ranges.friction


def _velocity(ranges: Ranges) -> Range:
    return 0.0, ranges.velocity_m_s * MM_MIN_PER_M_S


def target_range_mm(ranges: Ranges) -> Range:
    """Range in which `SetTarget` takes a target, millimetres."""
    return ranges.target_m[0] * MM_PER_M, ranges.target_m[1] * MM_PER_M


CYCLE: Final[Mapping[str, Row]] = {
    "Friction/StaticFriction": Row(_coefficient(lambda s: s.friction.mu_s), _friction),
    "Friction/StaticFrictionStdDev": Row(_coefficient(lambda s: s.friction.mu_s, std=True), _friction),
    "Friction/StaticFrictionByForce": Row(_coefficient(lambda s: s.friction.by_force), _friction),
    "Friction/StaticFrictionByDistance": Row(_coefficient(lambda s: s.friction.by_distance), _friction),
    "Friction/KineticFriction": Row(_coefficient(lambda s: s.friction.mu_k), _friction),
    "Friction/PeakForce": Row(_plain(lambda s: s.friction.peak_force_n), lambda r: (0.0, r.force_n)),
    "Friction/SlidingDistance": Row(
        _plain(lambda s: s.friction.sliding_distance_m, UM_PER_M),
        lambda r: (0.0, r.sliding_distance_m * UM_PER_M),
    ),
    "Friction/ActuationVelocity": Row(_plain(lambda s: s.velocity_m_s, MM_MIN_PER_M_S), _velocity),
    "Friction/CycleNumber": Row(lambda s: (s.cycle, Quality.GOOD)),
    "Wear/Level": Row(_wear(lambda s: s.wear.level), _friction),
    "Wear/LevelStdDev": Row(_wear(lambda s: s.wear.level_std), _friction),
    "Wear/Limit": Row(_plain(lambda s: s.wear.limit), _friction),
    "Wear/RatePer1000Cycles": Row(_wear(lambda s: s.wear.rate_per_cycle * 1e3), _signed_friction),
    "Wear/CyclesToLimit": Row(_wear(lambda s: s.wear.cycles_to_limit)),
    "Wear/CyclesToLimitLow": Row(_wear(lambda s: s.wear.cycles_to_limit_low)),
    "Wear/CyclesToLimitHigh": Row(_wear(lambda s: s.wear.cycles_to_limit_high)),
    "Batch/BatchId": Row(lambda s: (s.batch.batch_id, Quality.GOOD)),
    "Batch/Offset": Row(_batch(lambda s: s.batch.offset), _signed_friction),
    "Batch/OffsetStdDev": Row(_batch(lambda s: s.batch.offset_std), _friction),
    "Batch/LastShift": Row(_batch(lambda s: s.batch.last_shift), _signed_friction),
    "Batch/LastShiftCycle": Row(lambda s: (s.batch.last_shift_cycle, Quality.GOOD)),
    "Signature/Position": Row(
        _grid(lambda s: s.signature.position_m, MM_PER_M), lambda r: (0.0, r.sliding_distance_m * MM_PER_M)
    ),
    "Signature/Friction": Row(_grid(lambda s: s.signature.friction), _friction),
    "Signature/TSquared": Row(_plain(lambda s: s.signature.t_squared)),
    "Signature/Spe": Row(_plain(lambda s: s.signature.spe)),
    "Positioning/Target": Row(_plain(lambda s: s.positioning.target_m, MM_PER_M), target_range_mm),
    "Positioning/Remaining": Row(
        _plain(lambda s: s.positioning.remaining_m, MM_PER_M),
        lambda r: (-(r.target_m[1] - r.target_m[0]) * MM_PER_M, (r.target_m[1] - r.target_m[0]) * MM_PER_M),
    ),
    "Positioning/NextVelocity": Row(
        _plain(lambda s: s.positioning.next_velocity_m_s, MM_MIN_PER_M_S), _velocity
    ),
    "Positioning/NextStroke": Row(
        _plain(lambda s: s.positioning.next_stroke_m, MM_PER_M), lambda r: (0.0, r.stroke_m * MM_PER_M)
    ),
    "Model/Name": Row(lambda s: (s.model_name, Quality.GOOD)),
    "Model/Gap": Row(lambda s: (s.gap, s.gap_quality)),
}
"""Variables that each cycle writes."""

MODULE: Final[Mapping[str, Callable[[ModuleStatus], Value]]] = {
    "Module/Connected": lambda m: m.connected,
    "Module/CyclesReceived": lambda m: m.received,
    "Module/CyclesMissed": lambda m: m.missed,
    "Module/RoundTripTime": lambda m: m.round_trip_s * MS_PER_S,
}
"""Variables of the link, which change without a cycle too."""
