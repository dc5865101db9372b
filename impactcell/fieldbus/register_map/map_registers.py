"""The names that a register map can use: what is required and why, and what needs what. Pure."""

import difflib
from collections.abc import Container, Iterable, Iterator, Mapping
from typing import Final

REQUIRED: Final = {
    "cycle_counter": "it tells of a new cycle",
    "velocity": "equations (4) and (5) need it",
}
"""Registers without which nothing can be made of any module, and what each gives."""

NEEDED_BY: Final[Mapping[str, tuple[tuple[tuple[str, ...], str], ...]]] = {
    "ring_cycle": (
        (("slot_select",), "a cycle of the ring is put into the window"),
        (("window_cycle",), "the window shows the cycle that was asked for"),
    ),
    "slot_select": ((("ring_cycle",), "where each cycle is, and which are lost"),),
    "window_sequence": ((("window_sequence_after",), "the window did not change while it was read"),),
    "window_sequence_after": ((("window_sequence",), "the window was at rest when it was read"),),
    "capture_crc32": ((("window_cycle",), "the CRC covers which cycle it is"),),
    "status_crc32": ((("state",), "the status block, and what its CRC covers, begins with it"),),
    "acknowledge_session": ((("acknowledge_cycle",), "which cycles of the session are stored"),),
    "force": ((("force_rate", "sample_rate"), "time of the force samples"),),
    "position": ((("position_rate", "sample_rate"), "time of the position samples"),),
    "actuator": ((("actuator_rate", "sample_rate"), "time of the actuator samples"),),
}
"""What else a map with a register has to have: one of some names, and what that proves or gives."""

MEASURED: Final = ("force", "position", "peak_force", "sliding_distance")
"""What a tap shows of friction: a map has one of these at least."""

ARRAYS: Final = ("force", "position", "actuator")
"""The sampled channels, in the order in which a CRC covers them."""

HEADER: Final = (
    "window_sequence", "window_slot", "window_session", "window_cycle", "capture_ready", "cycle_time",
    "direction", "velocity", "mass", "stroke", "dwell", "start_position", "peak_force", "sliding_distance",
    "batch_id", "sample_rate", "force_rate", "position_rate", "actuator_rate",
    "sample_start", "force_start", "position_start", "actuator_start",
    "sample_count", "force_count", "position_count", "actuator_count", "capture_crc32",
)  # fmt: skip
"""What is read with each cycle, beside its samples."""

CONSTANTS: Final = (
    "velocity", "mass", "stroke", "direction", "sample_rate", "force_rate", "position_rate", "actuator_rate",
    "sample_start", "force_start", "position_start", "actuator_start",
)  # fmt: skip
"""What a map may give as a number, for a module where it is always the same."""

SHOWN: Final = (
    "positioning_state", "command_result", "part_position", "target_position", "target_sequence", "part_mass",
    "command_accepted", "command_cycle",
)  # fmt: skip
"""Registers in which the module shows part, target and outcome; without one none of them is looked at."""

_STATUS: Final = (
    "module_name", "serial_number", "map_version", "firmware_version",
    "state", "newest_slot", "session", "cycle_counter", "acknowledged_cycle", "overwritten_count",
    "ring_cycle", "status_crc32", "batch_sequence", "batch_from_cycle", "batch_announced", *SHOWN,
)  # fmt: skip
"""What the module says of itself, of what is to come and of positioning."""

WRITTEN: Final = (
    "slot_select", "acknowledge_session", "acknowledge_cycle", "command_velocity", "command_stroke",
    "command_direction", "command_abort", "command_sequence",
)  # fmt: skip
"""What the service writes."""

TEXTS: Final = (
    "module_name", "serial_number", "map_version", "firmware_version", "batch_id", "batch_announced"
)  # fmt: skip
"""What may be a text; all else is a number."""

NAMES: Final = (*HEADER, *ARRAYS, "window_sequence_after", *_STATUS, *WRITTEN)
"""All names that are used."""


def missing_registers(names: Container[str]) -> Iterator[str]:
    """Say which registers a map lacks, and what each is needed for.

    >>> list(missing_registers({"cycle_counter", "velocity", "force"}))
    ['register force_rate or sample_rate is missing: time of the force samples']
    """
    for name, why in REQUIRED.items():
        if name not in names:
            yield f"register {name} is missing: {why}"
    for name, needs in NEEDED_BY.items():
        for alternatives, why in needs if name in names else ():
            if not any(each in names for each in alternatives):
                yield f"register {' or '.join(alternatives)} is missing: {why}"
    if not any(name in names for name in MEASURED):
        yield f"register {' or '.join(MEASURED)} is missing: nothing else tells of friction"


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
