"""Words of the module's window become a `Capture`. Pure, never fails.

What is wrong with a value is said in `faults`, each naming cell, cycle and register; the value itself is then
left out (nan, None), so that nothing wrong is ever passed on as measured.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from impactcell.fieldbus.cycles.status_block import integer, number
from impactcell.fieldbus.registers import RegisterMap, Value, Words
from impactcell.numerics.local_polynomial import median
from impactcell.records import Capture, Channel, Samples, Summary, uniform_times

LIGHTEST_KG, HEAVIEST_KG = 0.01, 1e5
"""What a part can weigh; anything else is a wrong register, and would cost the estimators much time."""
FARTHEST = 1e9
"""No time, length, velocity, rate or figure of a tap is as large, in SI; none above 0 as small as one over it
[SI]."""
FINEST = 1e12
"""Sampling steps from first contact from which on two of them need not differ any more as doubles."""
LATEST_NS = 2**63 - 1
"""The year 2262."""
OUT_OF_SCALE = 5.0
"""Factor between the module's own figure and its samples: no tap explains it, every wrong unit exceeds it."""
TIME_AXES = 16
"""Time axes that are kept, of some 160 kB: a map has up to three, and cells of one kind share theirs."""
_MEASURED = ("peak_force", "sliding_distance", "force_count", "position_count", "sample_count")
"""Registers of a header that are all 0 where there was no tap."""
AT_REST = 20
"""One sample in so many, at either end: their median is where the part lay, and no noise is a slide [1]."""


def sample_counts(registers: RegisterMap, header: Mapping[str, Value]) -> dict[str, int]:
    """Return how many samples of each array are used: what the header says, at most what the map has.

    Where nothing says it, all of an array is used.
    """
    return {
        name: min(max(_count(registers, header, name)[1], 0), registers[name].count)
        for name in registers.arrays
    }


def tells_of_a_tap(header: Mapping[str, Value]) -> bool:
    """Whether a header says that anything was measured; one that holds no figure of a tap says nothing."""
    measured = [header[name] for name in _MEASURED if name in header]
    return not measured or any(measured)


def _count(registers: RegisterMap, header: Mapping[str, Value], name: str) -> tuple[str, int]:
    """Which register says how many samples of an array are used, and what it says."""
    for register in (f"{name}_count", "sample_count"):
        if register in registers:
            return register, integer(header.get(register, 0))
    return name, registers[name].count


def excessive_counts(registers: RegisterMap, header: Mapping[str, Value]) -> dict[str, str]:
    """Return a fault for each array of which more is said to be used than the map has room for, or < 0."""
    faults = {}
    for name in registers.arrays:
        register, count = _count(registers, header, name)
        if not 0 <= count <= registers[name].count:
            where = f"register {register} ({registers[register].address})"
            faults[name] = f"{where}: {count} samples, but the map has room for {registers[name].count}"
    return faults


def empty_capture(cycle: int) -> Capture:
    """Return the capture of a cycle that could not be read: its number, and nothing else."""
    return Capture(cycle=cycle, velocity_m_s=math.nan, mass_kg=math.nan, force=None, position=None)


def capture_from_words(
    registers: RegisterMap, header: Mapping[str, Value], samples: Mapping[str, Words]
) -> tuple[Capture, list[str]]:
    """Put a capture together; `samples` holds the words of the used part of each array.

    Returns
    -------
    Capture
        In SI. A sample without a value is left out, a channel without samples is None.
    list of str
        What is wrong with it, register by register.
    """
    header = {**registers.constants, **header}
    excessive = excessive_counts(registers, header)
    faults = list(excessive.values())
    checked = _CheckedHeader(registers, header, faults)
    velocity = checked.positive("velocity", math.nan)
    mass = checked.positive("mass", math.nan, also=math.isnan)
    if not math.isnan(mass) and not LIGHTEST_KG <= mass <= HEAVIEST_KG:
        faults.append(f"{_where(registers, 'mass')}: {mass:g} kg cannot be")
        mass = math.nan
    time_ns = cycle_time_ns(header)
    if not 0 <= time_ns <= LATEST_NS:
        faults.append(f"register cycle_time ({registers['cycle_time'].address}): {time_ns:g} ns is no date")
        time_ns = 0
    stroke = checked.positive("stroke", math.inf, also=lambda value: value == math.inf)
    dwell = checked.positive("dwell", math.nan, also=lambda value: value == 0.0 or math.isnan(value))
    direction = integer(header.get("direction", 1))
    if direction not in (-1, 1):
        faults.append(f"{_where(registers, 'direction')}: {direction} instead of 1 or -1")
        direction = 1
    channels = {
        name: None if name in excessive else _channel(registers, header, name, words, faults)
        for name, words in samples.items()
    }
    summary = _summary(registers, header, faults)
    if summary is not None:
        faults += _scale_faults(registers, summary, channels, stroke)
    start = number(header.get("start_position", 0.0))
    if not abs(start) < FARTHEST:
        faults.append(f"{_where(registers, 'start_position')}: {start:g} m cannot be")
        start = 0.0
    return Capture(
        cycle=integer(header["window_cycle" if "window_cycle" in header else "cycle_counter"]),
        velocity_m_s=velocity,
        mass_kg=mass,
        force=channels.get("force"),
        position=channels.get("position"),
        actuator=channels.get("actuator"),
        direction=direction,
        stroke_m=stroke,
        time_ns=round(time_ns),
        batch_id=str(header.get("batch_id", "")) or None,
        dwell_s=dwell,
        start_m=start,
        summary=summary,
    ), faults


def _summary(registers: RegisterMap, header: Mapping[str, Value], faults: list[str]) -> Summary | None:
    """Take the module's own figures, None where it has none; one that it does not have is nan."""
    names = [name for name in ("peak_force", "sliding_distance") if name in header]
    if not names:
        return None
    values = []
    for name in ("peak_force", "sliding_distance"):
        value = number(header.get(name, math.nan))
        if name in header and not abs(value) < FARTHEST:
            faults.append(f"register {name} ({registers[name].address}): not a number")
            value = math.nan
        low, high = (name in registers and registers[name].full_scale) or (-math.inf, math.inf)
        if value >= high or value <= low < 0.0:  # below 0 is neither figure: there it is not cut off
            faults.append(f"{_where(registers, name)}: {value:g} is at full scale ({low:g} to {high:g})")
            value = math.nan
        values.append(value)
    stds = [
        registers[name].si_std if name in registers else math.nan
        for name in ("peak_force", "sliding_distance")
    ]
    return Summary(*values, *stds)


def _where(registers: RegisterMap, name: str) -> str:
    """Where the map has a value: at an address, or as a constant."""
    place = registers[name].address if name in registers else "a constant of the map"
    return f"register {name} ({place})"


def cycle_time_ns(header: Mapping[str, Value]) -> float:
    """Nanoseconds since 1970 at which a cycle was made; 0 where its header does not say, or says no number.

    A plain code is in nanoseconds, a time with a unit in seconds.
    """
    value = header.get("cycle_time", 0)
    if isinstance(value, float):
        return 0 if math.isnan(value) else 1e9 * value
    return integer(value)


def _scale_faults(
    registers: RegisterMap, summary: Summary, channels: Mapping[str, Channel | None], stroke: float
) -> Iterator[str]:
    """Compare the module's own figures with the samples: a wrong scale or unit puts them far apart.

    A part slides by itself only after it was pushed, along a part of the stroke or along all of it; where the
    module does not know its stroke, all of the motion may have been that.
    """
    pushed = stroke if math.isfinite(stroke) else math.inf
    for name, figure, unit, value, beside in (
        ("force", "peak_force", "N", summary.peak_force_n, 0.0),
        ("position", "sliding_distance", "m", summary.sliding_distance_m, pushed),
    ):
        channel = channels.get(name)
        if channel is None or not (math.isfinite(value) and value > 0.0):
            continue
        least, most = channel.values.min(), channel.values.max()
        largest = most if name == "force" else most - least
        if least == most or largest <= 0.0:
            continue
        lasting = most if name == "force" else _displacement(channel.values)
        if not (lasting - beside) / OUT_OF_SCALE < value < OUT_OF_SCALE * largest:
            where = f"register {figure} ({registers[figure].address})"
            yield (
                f"{where}: {value:.3g} {unit}, but the samples of {name} show {largest:.3g} {unit}: "
                "scale or unit of one of them is wrong in the map"
            )


def _displacement(position: Samples) -> float:
    """How far a part lies from where it lay, in metres."""
    few = max(len(position) // AT_REST, 1)
    return abs(median(position[-few:]) - median(position[:few]))


def _never(_: float) -> bool:
    return False


@dataclass(frozen=True, slots=True)
class _CheckedHeader:
    """Values of a header that must be positive; what is wrong with one is added to `faults`."""

    registers: RegisterMap
    header: Mapping[str, Value]
    faults: list[str]

    def positive(self, name: str, absent: float, also: Callable[[float], bool] = _never) -> float:
        """Return a value; `absent` where there is none, nan where it cannot be, nor is `also`."""
        if name not in self.header:
            return absent
        value = number(self.header[name])
        if also(value) or 1.0 / FARTHEST < value < FARTHEST:
            return value
        shown = f"{value:g}"
        if name in self.registers:
            register = self.registers[name]
            shown = f"{value / register.si_factor:g} {register.unit}"
        self.faults.append(f"{_where(self.registers, name)}: {shown} cannot be")
        return math.nan


@lru_cache(maxsize=TIME_AXES)
def _uniform_times(start_s: float, rate_hz: float, count: int) -> Samples:
    """Sample times as `uniform_times` gives them, made once for all cycles that have the same."""
    return uniform_times(start_s, rate_hz, count)


def _channel(
    registers: RegisterMap, header: Mapping[str, Value], name: str, words: Words, faults: list[str]
) -> Channel | None:
    register = registers[name]
    where = f"register {name} ({register.address})"
    rate_hz = number(header.get(f"{name}_rate", header.get("sample_rate", math.nan)))
    start_s = number(header.get(f"{name}_start", header.get("sample_start", 0.0)))
    if not words.size:
        if name != "actuator":  # most modules have none
            faults.append(f"{where}: no samples, {name}_count is 0")
        return None
    if not (1.0 / FARTHEST < rate_hz < FARTHEST and abs(start_s) * rate_hz < FINEST):
        faults.append(f"{where}: no time axis, {name}_rate is {rate_hz:g} Hz, from {start_s:g} s on")
        return None
    values = np.asarray(register.decode(words), dtype=np.float64)
    time_s = _uniform_times(start_s, rate_hz, values.size)
    full_scale = register.full_scale
    least, most = values.min(), values.max()  # nan where one of the samples is
    if full_scale is not None and not (full_scale[0] < least and most < full_scale[1]):
        low, high = full_scale
        clipped = np.count_nonzero((values <= low) | (values >= high))
        if clipped:
            faults.append(f"{where}: {clipped} samples at full scale ({low:g} to {high:g})")
    if not (math.isfinite(least) and math.isfinite(most)):
        finite = np.isfinite(values)
        faults.append(
            f"{where}: {finite.size - np.count_nonzero(finite)} of {finite.size} samples are not a number"
        )
        time_s, values = time_s[finite], values[finite]
        if not values.size:
            return None
        least, most = values.min(), values.max()
    if values.size > 1 and least == most:
        faults.append(f"{where}: constant at {least:g}")
    resolution = None if register.kind in ("f32", "f64") else register.si_factor
    return Channel(time_s, values, full_scale=full_scale, resolution=resolution)
