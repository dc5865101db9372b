"""Every published quantity, once: name, unit, type, range, where it is read off, column, history.

From this table come the OPC UA nodes and their NodeSet2 file, the journal's columns of these quantities,
what has a history, and what the page shows of a cell. Values are SI in the program and in the journal; the
unit here is that of the node.

To publish one more: add it at the end of its folder's block with the next free `number`, then write the
NodeSet2 file anew (`python -m impactcell.scada.nodeset`). A number that has been used is never used again.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

from impactcell.records import MM_PER_MIN, ModuleStatus, Quality, Snapshot
from impactcell.records.quantity import DataType, Quantity, Range, Ranges, Unit

FOLDERS: Final[Mapping[str, tuple[int, str]]] = {
    "Friction": (5001, "Friction of the last cycle."),
    "Wear": (5002, "Friction followed over time, at the reference batch."),
    "Batch": (5003, "The present batch of material against the reference batch."),
    "Signature": (5004, "Kinetic friction along the stroke of the last cycle."),
    "Positioning": (5005, "The positioning task that runs, if one does."),
    "Module": (5006, "The link to the module."),
    "Model": (5007, "The model that the estimators use."),
}
"""Folders of a cell: identifier in the NodeSet2 file, description."""


ONE: Final = Unit("C62", "", "one")
PER_1000: Final = replace(ONE, per_si=1e3)
"""A rate in 1 per cycle, shown per 1000 cycles."""
NEWTON: Final = Unit("NEW", "N", "newton")
MILLIMETRE: Final = Unit("MMT", "mm", "millimetre", 1e3)
"""1000 to the metre (SI prefix milli)."""
MICROMETRE: Final = Unit("4H", "µm", "micrometre (micron)", 1e6)
"""1e6 to the metre (SI prefix micro)."""
MILLIMETRE_PER_MINUTE: Final = Unit("H81", "mm/min", "millimetre per minute", 1.0 / MM_PER_MIN)
"""1000 mm in a metre times 60 s in a minute."""
MILLISECOND: Final = Unit("C26", "ms", "millisecond", 1e3)
"""1000 to the second (SI prefix milli)."""


def _friction_range(ranges: Ranges) -> Range:
    return 0.0, ranges.friction


def _shift_range(ranges: Ranges) -> Range:
    return -ranges.friction, ranges.friction


def _rate_range(ranges: Ranges) -> Range:
    return -ranges.friction / PER_1000.per_si, ranges.friction / PER_1000.per_si


def _rate_std_range(ranges: Ranges) -> Range:
    return 0.0, ranges.friction / PER_1000.per_si


def _velocity_range(ranges: Ranges) -> Range:
    return 0.0, ranges.velocity_m_s


def _remaining_range(ranges: Ranges) -> Range:
    span_m = ranges.target_m[1] - ranges.target_m[0]
    return -span_m, span_m


def _up_to(highest: float) -> Callable[[Ranges], Range]:
    return lambda _: (0.0, highest)


def _wear_quality(snapshot: Snapshot) -> Quality:
    return snapshot.wear.quality


def _batch_quality(snapshot: Snapshot) -> Quality:
    return snapshot.batch.quality


def _signature_quality(snapshot: Snapshot) -> Quality:
    return snapshot.signature.quality


def _mu_s_quality(snapshot: Snapshot) -> Quality:
    return snapshot.friction.mu_s.quality


_Q = Quantity
# fmt: off
CYCLE: Final[tuple[Quantity[Snapshot], ...]] = (
    _Q("Friction/StaticFriction", 6001,
       "Coefficient of static friction of the last cycle, by the estimator in use.",
       ("Static friction µs", "Haftreibung µs"),
       lambda s: s.friction.mu_s.value, _mu_s_quality, ONE, _friction_range,
       column="mu_s", quality_column="mu_s_quality", has_history=True),
    _Q("Friction/StaticFrictionStdDev", 6004, "One standard deviation of StaticFriction.",
       ("Standard deviation of µs", "Standardabweichung von µs"),
       lambda s: s.friction.mu_s.std, _mu_s_quality, ONE, _friction_range,
       column="mu_s_std", quality_column="mu_s_quality", has_history=True),
    _Q("Friction/StaticFrictionByForce", 6007, "Coefficient of static friction from the peak force alone.",
       ("µs from the peak force", "µs aus der Spitzenkraft"),
       lambda s: s.friction.by_force.value, lambda s: s.friction.by_force.quality, ONE, _friction_range,
       column="by_force", quality_column="by_force_quality"),
    _Q("Friction/StaticFrictionByDistance", 6010,
       "Coefficient of static friction from the sliding distance alone.",
       ("µs from the distance", "µs aus dem Gleitweg"),
       lambda s: s.friction.by_distance.value, lambda s: s.friction.by_distance.quality, ONE, _friction_range,
       column="by_distance", quality_column="by_distance_quality"),
    _Q("Friction/KineticFriction", 6013, "Coefficient of kinetic friction of the last cycle.",
       ("Kinetic friction µk", "Gleitreibung µk"),
       lambda s: s.friction.mu_k.value, lambda s: s.friction.mu_k.quality, ONE, _friction_range,
       column="mu_k", quality_column="mu_k_quality", has_history=True),
    _Q("Friction/PeakForce", 6016, "Largest contact force of the last cycle.",
       ("Peak force", "Spitzenkraft"),
       lambda s: s.friction.peak_force_n, None, NEWTON, lambda r: (0.0, r.force_n), column="peak_force_n"),
    _Q("Friction/SlidingDistance", 6019, "Distance the part slid between loss of contact and rest.",
       ("Sliding distance", "Gleitweg"),
       lambda s: s.friction.sliding_distance_m, None, MICROMETRE, lambda r: (0.0, r.sliding_distance_m),
       column="sliding_distance_m"),
    _Q("Friction/ActuationVelocity", 6022, "Commanded velocity of the actuator.",
       ("Tap velocity", "Stoßgeschwindigkeit"),
       lambda s: s.velocity_m_s, None, MILLIMETRE_PER_MINUTE, _velocity_range),
    _Q("Friction/CycleNumber", 6025, "Number of the last cycle, as the module counts.",
       ("Cycle", "Zyklus"),
       lambda s: s.cycle, data_type=DataType.UINT32),
    _Q("Friction/StaticFrictionByForceStdDev", 6112, "One standard deviation of StaticFrictionByForce.",
       ("Standard deviation of µs from the force", "Standardabweichung von µs aus der Kraft"),
       lambda s: s.friction.by_force.std, lambda s: s.friction.by_force.quality, ONE, _friction_range,
       column="by_force_std", quality_column="by_force_quality"),
    _Q("Friction/StaticFrictionByDistanceStdDev", 6115,
       "One standard deviation of StaticFrictionByDistance.",
       ("Standard deviation of µs from the distance", "Standardabweichung von µs aus dem Gleitweg"),
       lambda s: s.friction.by_distance.std, lambda s: s.friction.by_distance.quality, ONE, _friction_range,
       column="by_distance_std", quality_column="by_distance_quality"),
    _Q("Friction/KineticFrictionStdDev", 6118, "One standard deviation of KineticFriction.",
       ("Standard deviation of µk", "Standardabweichung von µk"),
       lambda s: s.friction.mu_k.std, lambda s: s.friction.mu_k.quality, ONE, _friction_range,
       column="mu_k_std", quality_column="mu_k_quality", has_history=True),

    _Q("Wear/Level", 6026, "Static friction at the reference batch, filtered over cycles.",
       ("Level at the reference batch", "Niveau bei der Bezugscharge"),
       lambda s: s.wear.level, _wear_quality, ONE, _friction_range,
       column="wear_level", quality_column="wear_quality", has_history=True),
    _Q("Wear/LevelStdDev", 6029, "One standard deviation of Level.",
       ("Standard deviation of the level", "Standardabweichung des Niveaus"),
       lambda s: s.wear.level_std, _wear_quality, ONE, _friction_range,
       column="wear_level_std", quality_column="wear_quality", has_history=True),
    _Q("Wear/Limit", 6032, "Level at which the cell counts as worn.",
       ("Limit", "Grenze"),
       lambda s: s.wear.limit, None, ONE, _friction_range),
    _Q("Wear/RatePer1000Cycles", 6035, "Change of Level in 1000 cycles.",
       ("Change in 1000 cycles", "Änderung in 1000 Zyklen"),
       lambda s: s.wear.rate_per_cycle, _wear_quality, PER_1000, _rate_range,
       column="wear_rate_per_cycle", quality_column="wear_quality"),
    _Q("Wear/CyclesToLimit", 6038, "Cycles until Level reaches Limit; +Infinity where it does not.",
       ("Cycles left", "Zyklen übrig"),
       lambda s: s.wear.cycles_to_limit, _wear_quality, ONE, _up_to(1e9),
       column="cycles_to_limit", quality_column="wear_quality"),
    _Q("Wear/CyclesToLimitLow", 6041, "Lower end of the 95 % interval of CyclesToLimit.",
       ("Cycles left, at least (95 %)", "Zyklen übrig, mindestens (95 %)"),
       lambda s: s.wear.cycles_to_limit_low, _wear_quality, ONE, _up_to(1e9)),
    _Q("Wear/CyclesToLimitHigh", 6044, "Upper end of the 95 % interval of CyclesToLimit.",
       ("Cycles left, at most (95 %)", "Zyklen übrig, höchstens (95 %)"),
       lambda s: s.wear.cycles_to_limit_high, _wear_quality, ONE, _up_to(1e9)),
    _Q("Wear/LevelCommonStdDev", 6103,
       "One standard deviation of what may be wrong in Level alike in all cycles, beside LevelStdDev.",
       ("Level: error that all cycles share (95 %)", "Niveau: gemeinsamer Fehler aller Zyklen (95 %)"),
       lambda s: s.wear.level_common_std, _wear_quality, ONE, _friction_range,
       column="wear_level_common_std", quality_column="wear_quality"),
    _Q("Wear/RatePer1000CyclesStdDev", 6121, "One standard deviation of RatePer1000Cycles.",
       ("Standard deviation of the change", "Standardabweichung der Änderung"),
       lambda s: s.wear.rate_std, _wear_quality, PER_1000, _rate_std_range),

    _Q("Batch/BatchId", 6047, "Name of the present batch.",
       ("Batch", "Charge"),
       lambda s: s.batch.batch_id, data_type=DataType.STRING, column="batch_id"),
    _Q("Batch/Offset", 6048, "Static friction of the present batch less that of the reference batch.",
       ("Offset to the reference batch", "Abstand zur Bezugscharge"),
       lambda s: s.batch.offset, _batch_quality, ONE, _shift_range,
       column="batch_offset", quality_column="batch_quality", has_history=True),
    _Q("Batch/OffsetStdDev", 6051, "One standard deviation of Offset.",
       ("Standard deviation of the offset", "Standardabweichung des Abstands"),
       lambda s: s.batch.offset_std, _batch_quality, ONE, _friction_range,
       column="batch_offset_std", quality_column="batch_quality", has_history=True),
    _Q("Batch/LastShift", 6054,
       "Size of the last shift between batches, as estimated by now; BatchShift has it as it was found.",
       ("Last shift, as estimated by now", "Letzter Sprung, nach jetziger Schätzung"),
       lambda s: s.batch.last_shift, _batch_quality, ONE, _shift_range),
    _Q("Batch/LastShiftCycle", 6057, "First cycle after the last shift; 0 before the first.",
       ("Last shift at cycle", "Letzter Sprung bei Zyklus"),
       lambda s: s.batch.last_shift_cycle, data_type=DataType.UINT32),
    _Q("Batch/LastShiftStdDev", 6124, "One standard deviation of LastShift.",
       ("Standard deviation of the last shift", "Standardabweichung des letzten Sprungs"),
       lambda s: s.batch.last_shift_std, _batch_quality, ONE, _friction_range),

    _Q("Signature/Position", 6058, "Distance slid since loss of contact, on the fixed grid of the cell.",
       ("Distance slid", "Gleitweg"),
       lambda s: s.signature.position_m, _signature_quality, MILLIMETRE,
       lambda r: (0.0, r.sliding_distance_m), is_array=True),
    _Q("Signature/Friction", 6061,
       "Kinetic friction at each Position; NaN where the part did not get that far.",
       ("Friction along the slide", "Reibung entlang des Gleitwegs"),
       lambda s: s.signature.friction, _signature_quality, ONE, _friction_range, is_array=True),
    _Q("Signature/TSquared", 6064, "Hotelling's T squared of the leading components.",
       ("Distance from the learned cycles (T²)", "Abstand von den gelernten Zyklen (T²)"),
       lambda s: s.signature.t_squared, None, ONE, _up_to(1e6), column="t_squared"),
    _Q("Signature/Spe", 6067, "Squared prediction error, in units of the noise.",
       ("Not explained by them (SPE)", "Von ihnen nicht erklärt (SPE)"),
       lambda s: s.signature.spe, None, ONE, _up_to(1e6), column="spe"),
    _Q("Signature/TSquaredLimit", 6106, "TSquared from which on it makes a cycle deviant by itself.",
       ("T² that by itself is deviant", "T², ab dem es allein abweicht"),
       lambda s: s.signature.t_squared_limit, None, ONE, _up_to(1e6)),
    _Q("Signature/SpeLimit", 6109, "Spe from which on it makes a cycle deviant by itself.",
       ("SPE that by itself is deviant", "SPE, ab dem es allein abweicht"),
       lambda s: s.signature.spe_limit, None, ONE, _up_to(1e6)),

    _Q("Positioning/Target", 6070, "Where the part is to go, along +1.",
       ("Target", "Ziel"),
       lambda s: s.positioning.target_m, None, MILLIMETRE, lambda r: r.target_m),
    _Q("Positioning/Remaining", 6073, "Distance that is left to Target.",
       ("Remaining", "Rest"),
       lambda s: s.positioning.remaining_m, None, MILLIMETRE, _remaining_range),
    _Q("Positioning/NextVelocity", 6076, "Velocity of the tap that comes next.",
       ("Velocity of the next tap", "Geschwindigkeit des nächsten Stoßes"),
       lambda s: s.positioning.next_velocity_m_s, None, MILLIMETRE_PER_MINUTE, _velocity_range),
    _Q("Positioning/NextStroke", 6079, "Stroke of the tap that comes next.",
       ("Stroke of the next tap", "Hub des nächsten Stoßes"),
       lambda s: s.positioning.next_stroke_m, None, MILLIMETRE, lambda r: (0.0, r.stroke_m)),

    _Q("Model/Name", 6088, "Name of the model.",
       ("Model", "Modell"),
       lambda s: s.model_name, data_type=DataType.STRING, column="model_name"),
    _Q("Model/Gap", 6089, "Misfit of model and measurement; 1 is the noise of the sensors.",
       ("Gap", "Abweichung"),
       lambda s: s.gap, lambda s: s.gap_quality, ONE, _up_to(1e3),
       column="gap", quality_column="gap_quality"),
)
"""Quantities that each cycle writes."""

MODULE: Final[tuple[Quantity[ModuleStatus], ...]] = (
    _Q("Module/Connected", 6082, "True while the module answers.",
       ("Module answers", "Modul antwortet"),
       lambda m: m.connected, data_type=DataType.BOOLEAN),
    _Q("Module/CyclesReceived", 6083, "Cycles received since the service started.",
       ("Cycles received", "Zyklen empfangen"),
       lambda m: m.received, data_type=DataType.UINT32),
    _Q("Module/CyclesMissed", 6084, "Cycles the module counted but the service never saw or stored.",
       ("Cycles missed", "Zyklen verpasst"),
       lambda m: m.missed, data_type=DataType.UINT32),
    _Q("Module/RoundTripTime", 6085, "Time between a request to the module and its answer.",
       ("Round trip", "Antwortzeit"),
       lambda m: m.round_trip_s, None, MILLISECOND, _up_to(1.0)),
)
"""Quantities of the link, which change without a cycle too."""
# fmt: on

POSITIONING: Final = tuple(quantity for quantity in CYCLE if quantity.path.startswith("Positioning/"))
"""Those that change between cycles, too."""
BY_PATH: Final[Mapping[str, Quantity[Snapshot]]] = {quantity.path: quantity for quantity in CYCLE}
"""Quantities that each cycle writes, by path."""
HISTORY: Final = tuple(quantity.path for quantity in CYCLE if quantity.has_history)
"""Paths of the quantities whose past can be read."""
BY_COLUMN: Final[Mapping[str, Quantity[Snapshot]]] = {q.column: q for q in CYCLE if q.column is not None}
"""Quantities that the journal keeps, by column."""
QUALITY_BY_COLUMN: Final[Mapping[str, Callable[[Snapshot], Quality]]] = {
    q.quality_column: q.quality for q in CYCLE if q.quality_column is not None and q.quality is not None
}
"""Their qualities, by column."""
