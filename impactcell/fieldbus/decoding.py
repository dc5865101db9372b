"""Words of the module's window and status block become a `Capture` and a `StatusBlock`. Pure, never fails.

What is wrong with a value is said in `faults`, each naming cell, cycle and register; the value itself is then
left out (nan, None), so that nothing wrong is ever passed on as measured.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from impactcell.fieldbus.registers import Register, RegisterMap, Value, Words
from impactcell.records import BatchAnnouncement, Capture, Channel, Summary, uniform_times


@dataclass(frozen=True, slots=True)
class PositioningStatus:
    """What the module says of positioning; see the map for the codes.

    Attributes
    ----------
    state, result : str
        Names of the codes of `positioning_state` and `command_result`.
    position_m, target_m : float
        Where the part lies, and where the PLC wants it.
    target_sequence : int
        Raised by the PLC with each new target.
    mass_kg : float
        nan where the PLC does not know it.
    accepted_command : int
        Sequence number of the last command that the module looked at.
    cycle : int
        Cycle made by that command, 0 for none.
    """

    state: str
    result: str
    position_m: float
    target_m: float
    target_sequence: int
    mass_kg: float
    accepted_command: int
    cycle: int


@dataclass(frozen=True, slots=True)
class StatusBlock:
    """The status block of one poll."""

    state: str
    session: int
    cycle_counter: int
    ring: tuple[int, ...]
    batch: BatchAnnouncement | None
    positioning: PositioningStatus | None


STATUS_REGISTERS = (
    "state", "session", "cycle_counter", "ring_cycle",
    "batch_sequence", "batch_from_cycle", "batch_announced",
    "positioning_state", "command_result", "part_position", "target_position", "target_sequence", "part_mass",
    "command_accepted", "command_cycle", "status_crc32",
)  # fmt: skip
"""Registers of a poll, where the map has them."""

LIGHTEST_KG, HEAVIEST_KG = 0.01, 1e5
"""What a part can weigh; anything else is a wrong register, and would cost the estimators much time."""
LATEST_NS = 2**63 - 1
"""The year 2262."""
OUT_OF_SCALE = 5.0
"""Factor between the module's own figure and its samples: no tap explains it, every wrong unit exceeds it."""

_BATCH = ("batch_sequence", "batch_from_cycle", "batch_announced")
_POSITIONING = STATUS_REGISTERS[7:-1]
"""Those of a positioning cell."""


def _code_name(register: Register, value: Value) -> str:
    code = int(value) if isinstance(value, int | float) else -1
    return register.codes.get(code, f"unknown ({code})")


def integer(value: Value) -> int:
    """Give a value that is an integer; 0 for any other."""
    return value if isinstance(value, int) else 0


def _number(value: Value) -> float:
    return float(value) if isinstance(value, int | float) else math.nan


def decode_status(registers: RegisterMap, values: Mapping[str, Value]) -> StatusBlock:
    """Put the decoded registers of `STATUS_REGISTERS` together."""
    batch = positioning = None
    if all(name in values for name in _BATCH):
        batch = BatchAnnouncement(
            integer(values["batch_sequence"]),
            integer(values["batch_from_cycle"]),
            str(values["batch_announced"]),
        )
    if all(name in values for name in _POSITIONING):
        positioning = PositioningStatus(
            state=_code_name(registers["positioning_state"], values["positioning_state"]),
            result=_code_name(registers["command_result"], values["command_result"]),
            position_m=_number(values["part_position"]),
            target_m=_number(values["target_position"]),
            target_sequence=integer(values["target_sequence"]),
            mass_kg=_number(values["part_mass"]),
            accepted_command=integer(values["command_accepted"]),
            cycle=integer(values["command_cycle"]),
        )
    return StatusBlock(
        state=_code_name(registers["state"], values["state"]),
        session=integer(values["session"]),
        cycle_counter=integer(values["cycle_counter"]),
        ring=tuple(int(cycle) for cycle in np.atleast_1d(np.asarray(values["ring_cycle"]))),
        batch=batch,
        positioning=positioning,
    )


def sample_counts(registers: RegisterMap, header: Mapping[str, Value]) -> dict[str, int]:
    """Return how many samples of each array are used: what the header says, at most what the map has."""
    return {
        name: min(integer(header.get(f"{name}_count", 0)), registers[name].count)
        for name in ("force", "position", "actuator")
        if name in registers
    }


def excessive_counts(registers: RegisterMap, header: Mapping[str, Value]) -> list[str]:
    """Return a fault for each count that is more than the map has room for."""
    return [
        f"register {name}_count ({registers[f'{name}_count'].address}): {header[f'{name}_count']} samples, "
        f"but the map has room for {registers[name].count}"
        for name in ("force", "position", "actuator")
        if name in registers and integer(header.get(f"{name}_count", 0)) > registers[name].count
    ]


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
    faults = excessive_counts(registers, header)
    excessive = {fault.split("_count", 1)[0].removeprefix("register ") for fault in faults}
    checked = _CheckedHeader(registers, header, faults)
    velocity = checked.positive("velocity", math.nan)
    mass = checked.positive("mass", math.nan, also=math.isnan)
    if not math.isnan(mass) and not LIGHTEST_KG <= mass <= HEAVIEST_KG:
        faults.append(f"register mass ({registers['mass'].address}): {mass:g} kg cannot be")
        mass = math.nan
    time_ns = integer(header["cycle_time"])
    if time_ns > LATEST_NS:
        faults.append(f"register cycle_time ({registers['cycle_time'].address}): {time_ns} ns is no date")
        time_ns = 0
    stroke = checked.positive("stroke", math.inf, also=lambda value: value == math.inf)
    dwell = checked.positive("dwell", math.nan, also=lambda value: value == 0.0 or math.isnan(value))
    direction = integer(header.get("direction", 1))
    if direction not in (-1, 1):
        faults.append(
            f"register direction ({registers['direction'].address}): {direction} instead of 1 or -1"
        )
        direction = 1
    channels = {
        name: None if name in excessive else _channel(registers, header, name, words, faults)
        for name, words in samples.items()
    }
    summary = None
    if "peak_force" in header and "sliding_distance" in header:
        summary = Summary(_number(header["peak_force"]), _number(header["sliding_distance"]))
        for name in ("peak_force", "sliding_distance"):
            if not math.isfinite(_number(header[name])):
                faults.append(f"register {name} ({registers[name].address}): not a number")
        faults += _scale_faults(registers, summary, channels)
    start = _number(header.get("start_position", 0.0))
    return Capture(
        cycle=integer(header["window_cycle"]),
        velocity_m_s=velocity,
        mass_kg=mass,
        force=channels.get("force"),
        position=channels.get("position"),
        actuator=channels.get("actuator"),
        direction=direction,
        stroke_m=stroke,
        time_ns=time_ns,
        batch_id=str(header.get("batch_id", "")) or None,
        dwell_s=dwell,
        start_m=start,
        summary=summary,
    ), faults


def _scale_faults(
    registers: RegisterMap, summary: Summary, channels: Mapping[str, Channel | None]
) -> Iterator[str]:
    """Compare the module's own figures with the samples: a wrong scale or unit puts them far apart."""
    for name, figure, unit, value in (
        ("force", "peak_force", "N", summary.peak_force_n),
        ("position", "sliding_distance", "m", summary.sliding_distance_m),
    ):
        channel = channels.get(name)
        if channel is None or not (math.isfinite(value) and value > 0.0):
            continue
        least, most = channel.values.min(), channel.values.max()
        largest = most if name == "force" else most - least
        if largest > 0.0 and least != most and not 1.0 / OUT_OF_SCALE < value / largest < OUT_OF_SCALE:
            where = f"register {figure} ({registers[figure].address})"
            yield (
                f"{where}: {value:.3g} {unit}, but the samples of {name} show {largest:.3g} {unit}: "
                "scale or unit of one of them is wrong in the map"
            )


def _never(_: float) -> bool:
    return False


@dataclass(frozen=True, slots=True)
class _CheckedHeader:
    """Values of a header that must be positive; what is wrong with one is added to `faults`."""

    registers: RegisterMap
    header: Mapping[str, Value]
    faults: list[str]

    def positive(self, name: str, absent: float, also: Callable[[float], bool] = _never) -> float:
        """Return a value; `absent` where there is none, nan where it is neither above 0 nor `also`."""
        if name not in self.header:
            return absent
        value = _number(self.header[name])
        if also(value) or (math.isfinite(value) and value > 0.0):
            return value
        register = self.registers[name]
        raw = value / register.si_factor
        self.faults.append(f"register {name} ({register.address}): {raw:g} {register.unit} cannot be")
        return math.nan


def _channel(
    registers: RegisterMap, header: Mapping[str, Value], name: str, words: Words, faults: list[str]
) -> Channel | None:
    register = registers[name]
    where = f"register {name} ({register.address})"
    rate_hz = _number(header.get(f"{name}_rate", math.nan))
    start_s = _number(header.get(f"{name}_start", math.nan))
    if not words.size:
        if name != "actuator":  # most modules have none
            faults.append(f"{where}: no samples, {name}_count is 0")
        return None
    if not rate_hz > 0.0 or not math.isfinite(start_s):
        faults.append(f"{where}: no time axis, {name}_rate is {rate_hz:g} Hz")
        return None
    values = np.asarray(register.decode(words), dtype=np.float64)
    time_s = uniform_times(start_s, rate_hz, values.size)
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
