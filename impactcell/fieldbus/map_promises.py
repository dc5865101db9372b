"""What cannot be promised of a module for what its map lacks, as `check`, `probe` and the log say it."""

from collections.abc import Iterator
from typing import Final

from impactcell.fieldbus.register_map.register_types import SI_FACTOR
from impactcell.fieldbus.registers import RegisterMap
from impactcell.records import MM_PER_MIN

_WITHOUT: Final = {
    "ring_cycle": "one cycle is held: those made while it is not read are lost, and counted",
    "session": "a restart of the module is told only by a cycle counter that goes back, or, after an "
    "outage, while its ring holds the last cycle; where no clock tells, not before the next cycle",
    "window_cycle": "that samples and figures are of the cycle counted last is the module's word: it has to "
    "show them before it counts",
    "cycle_time": "the time of a cycle is when it was read",
    "status_crc32": "a wrong bit in the status block is noticed only as news are read twice",
    "acknowledge_cycle": "the module is not told which cycles are stored",
    "batch_id": "batches are told from friction alone, or by StartBatch",
    "mass": "the mass is the cell file's",
    "stroke": "the stroke is the cell file's",
}
"""Optional registers, and what is not promised without them, whatever else there is."""

_ONLY_FIGURES: Final = (
    "no registers force and position: mu_s comes from equations (4) to (6) and the module's own figures, "
    "mu_k through mu_k/mu_s of the model; there is no waveform, so no signature along the stroke, no gap of "
    "the model, and nothing for `discrepancy`"
)


_STEP_NOT_SEEN_M_S: Final = 2.0 * MM_PER_MIN
"""Steps of the velocity above which their rounding is told, m/s: half of one is 5e-4 of a slow tap of
2000 mm/min, and a force of 100 N shows its scale to 2e-4 (noise of 0.5 N, a thousand samples). Our choice."""


def not_promised(registers: RegisterMap) -> tuple[str, ...]:
    """Say what a map cannot promise, for what it lacks, a sentence each."""
    return tuple(_sentences(registers))


def _sentences(registers: RegisterMap) -> Iterator[str]:
    if not any(each.expect is not None for each in registers.registers.values()):
        yield "no register with `expect`: whoever answers is taken for the module"
    for name, text in _WITHOUT.items():
        if name not in registers and name not in registers.constants:
            yield f"no register {name}: {text}"
    if "session" in registers and "window_session" not in registers:
        yield "no register window_session: a capture from before a restart is not told by it"
    yield from _of_captures(registers)
    if not registers.arrays:
        yield _ONLY_FIGURES
    for name in ("force", "position"):
        if registers.arrays and name not in registers:
            yield f"no register {name}: no waveform estimate, and mu_s is uncertain"
    yield from _of_figures(registers)
    yield from _of_velocity(registers)
    for name in registers.arrays:
        if not any(
            each in registers or each in registers.constants for each in (f"{name}_start", "sample_start")
        ):
            yield f"no register {name}_start: its first sample is taken for the first contact"


def _of_captures(registers: RegisterMap) -> Iterator[str]:
    """Say what does not prove that a capture is whole, and of one cycle."""
    if "capture_crc32" in registers:
        return
    if "window_sequence" in registers:
        yield (
            "no register capture_crc32: a wrong bit in header or samples is not noticed, "
            "and a reading that the link interrupts begins anew"
        )
    else:
        yield (
            "no registers capture_crc32 and window_sequence: each capture is read twice, and used where both "
            "readings agree; one that the module leaves half written for that long is not noticed"
        )


def _of_velocity(registers: RegisterMap) -> Iterator[str]:
    """Say that k, b and mu_s follow a velocity that is rounded, which nothing else tells of."""
    velocity = registers.registers.get("velocity")
    if velocity is None or not registers.arrays or velocity.kind in ("f32", "f64"):
        return
    step_m_s = velocity.scale * SI_FACTOR.get(velocity.unit, 1.0)
    if step_m_s > _STEP_NOT_SEEN_M_S:
        yield (
            f"register velocity goes in steps of {step_m_s / MM_PER_MIN:.3g} mm/min: k, b, mu_k/mu_s and "
            "mu_s err by what is rounded off, beyond their ±; finer steps, or a commanded velocity that is a "
            "whole number of them, avoid it"
        )


def _of_figures(registers: RegisterMap) -> Iterator[str]:
    """Say what is lacking of the module's own figures."""
    for name, channel, quantity in (
        ("peak_force", "force", "force"),
        ("sliding_distance", "position", "distance"),
    ):
        if name not in registers and channel in registers:
            yield (
                f"no register {name}: the scale of {channel} is not proved, "
                f"and there is no {quantity} without samples"
            )
        elif name not in registers:
            yield f"no register {name}: equation {'(4)' if name == 'peak_force' else '(5)'} cannot be used"
        elif channel not in registers and registers[name].std is None:
            yield f"register {name} has no `std`: an error of 1 % is assumed, which is uncertain"
