"""The names that a register map can use: what is required and why, what is optional and for what. Pure."""

import difflib
from collections.abc import Container, Iterable
from typing import Final

REQUIRED: Final = {
    "module_name": "who answers is proved with each connection",
    "map_version": "the layout is proved with each connection",
    "state": "the status block begins with it",
    "session": "a restart of the module is told from a cycle that is asked for again",
    "cycle_counter": "there is a new cycle",
    "ring_cycle": "where each cycle is, and which are lost",
    "slot_select": "a cycle of the ring is put into the window",
    "window_sequence": "the window was at rest when it was read",
    "window_slot": "the window shows the slot that was asked for",
    "window_session": "the window shows a cycle of this session",
    "window_cycle": "the window shows the cycle that was asked for",
    "cycle_time": "when the cycle was made",
    "velocity": "equations (4) and (5) need it",
    "force_rate": "time of the force samples",
    "force_start": "time of the first force sample",
    "force_count": "how many of the force samples are of this cycle",
    "force": "the contact force",
    "position_rate": "time of the position samples",
    "position_start": "time of the first position sample",
    "position_count": "how many of the position samples are of this cycle",
    "position": "the motion of the part",
    "window_sequence_after": "the window did not change while it was read",
}
"""Registers without which no cycle can be read consistently, and what each proves or gives."""

_WITHOUT: Final = {
    "status_crc32": "a wrong bit in the status block is noticed only as news are read twice",
    "capture_crc32": "a wrong bit in header or samples is not noticed, "
    "and a reading that the link interrupts begins anew",
    "acknowledge_cycle": "the module is not told which cycles are stored",
    "peak_force": "the scale of force is not proved, and there is no force without samples",
    "sliding_distance": "the scale of position is not proved, and there is no distance without samples",
    "batch_id": "batches are told from friction alone, or by StartBatch",
    "mass": "the mass is the cell file's",
    "stroke": "the stroke is the cell file's",
}
"""Optional registers, and what is not promised without them."""

_OTHERS: Final = (
    "serial_number", "firmware_version", "newest_slot", "acknowledged_cycle", "overwritten_count",
    "acknowledge_session", "direction", "dwell", "start_position",
    "actuator_rate", "actuator_start", "actuator_count", "actuator",
    "batch_sequence", "batch_from_cycle", "batch_announced",
    "positioning_state", "command_result", "part_position", "target_position", "target_sequence", "part_mass",
    "command_accepted", "command_cycle", "command_velocity", "command_stroke", "command_direction",
    "command_abort", "command_sequence",
)  # fmt: skip
"""Optional registers whose lack takes nothing away but themselves."""

NAMES: Final = (*REQUIRED, *_WITHOUT, *_OTHERS)
"""All names that are used."""


def not_promised(registers: Container[str]) -> tuple[str, ...]:
    """Say what a map cannot promise, for what it lacks.

    >>> not_promised({"capture_crc32", "acknowledge_cycle", "peak_force", "sliding_distance", "batch_id",
    ...               "mass", "stroke"})
    ('no register status_crc32: a wrong bit in the status block is noticed only as news are read twice',)
    """
    return tuple(f"no register {name}: {text}" for name, text in _WITHOUT.items() if name not in registers)


def unknown_names(registers: Iterable[str]) -> tuple[str, ...]:
    """Say which registers of a map are not used, and what their names may have meant.

    >>> unknown_names(["peak_forse", "temperature"])
    ('register peak_forse is not used; did you mean peak_force?', 'register temperature is not used')
    """
    remarks = []
    for name in registers:
        if name not in NAMES:
            near = difflib.get_close_matches(name, NAMES, n=1, cutoff=0.8)
            remarks.append(f"register {name} is not used{f'; did you mean {near[0]}?' if near else ''}")
    return tuple(remarks)
