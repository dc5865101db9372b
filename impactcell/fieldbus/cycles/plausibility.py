"""Whether what a module shows can be meant as the map says, or as the other word order says. Pure.

A wrong word order is no error that Modbus could see: a cycle counter counts 65536, 131072, ..., and a
velocity is some tiny number. But several registers together prove it: checksums, a ring that holds the cycles
up to the counter, a date, and quantities that lie where a tap can be.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from impactcell.fieldbus.cycles.capture_ring import cycles_after
from impactcell.fieldbus.cycles.decoding import HEAVIEST_KG, LIGHTEST_KG
from impactcell.fieldbus.register_image import RegisterImage
from impactcell.fieldbus.registers import RegisterMap, Value, registers_crc32

OTHER_ORDER: Final[Mapping[str, str]] = {"big": "little", "little": "big"}
EARLIEST_NS, LATEST_NS = 946_684_800 * 10**9, 4_102_444_800 * 10**9
"""From 2000 to 2100: when a cycle can have been made, by a clock that is set."""
_RANGES: Final[Mapping[str, tuple[float, float, float]]] = {
    "velocity": (1e-5, 100.0, 1e-5),
    "stroke": (1e-7, 1e3, math.inf),
    "mass": (LIGHTEST_KG, HEAVIEST_KG, math.nan),
    "force_rate": (1.0, 1e8, 1.0),
    "position_rate": (1.0, 1e8, 1.0),
}
"""Least and largest that a register of a header can show, SI, and what it may show beside that."""


def wrong_word_order(registers: RegisterMap, *images: RegisterImage) -> str | None:
    """Say that the word order is wrong, where that is proved: as it is some of it cannot be, swapped all can.

    Parameters
    ----------
    registers : RegisterMap
        As it is used.
    *images : RegisterImage
        The status block and, where a cycle has been made, the header of a capture.

    Returns
    -------
    str or None
        What cannot be, and the way out.
    """
    impossible = [text for possible, text in _evidence(registers, images) if not possible]
    if not impossible:
        return None
    swapped = {
        name: replace(register, word_order=OTHER_ORDER[register.word_order])
        for name, register in registers.registers.items()
    }
    if not all(possible for possible, _ in _evidence(RegisterMap(registers.name, swapped), images)):
        return None
    return (
        f"{'; '.join(impossible)}: the word order is wrong, "
        f"with `word_order: {swapped['cycle_counter'].word_order}` all of it can be"
    )


def _evidence(registers: RegisterMap, images: Sequence[RegisterImage]) -> Iterator[tuple[bool, str]]:
    """Yield for each thing that can be judged whether it is possible, and what it says."""
    shown = {
        name: (register.decode(image.words(register, register.end)), image)
        for image in images
        for name in image.values
        for register in [registers[name]]
    }

    def value(name: str) -> Value | None:
        return shown[name][0] if name in shown else None

    if value("status_crc32"):
        crc, image = shown["status_crc32"]
        words = image.words(registers["state"], registers["status_crc32"].address)
        yield crc == registers_crc32(words), "status_crc32 does not fit"
    counter, ring = value("cycle_counter"), value("ring_cycle")
    if isinstance(counter, int) and counter and isinstance(ring, np.ndarray):
        held = [int(cycle) for cycle in ring if cycle]
        near = all(cycles_after(cycle, counter) < len(ring) for cycle in held)
        complete = len(held) == len(ring) or counter < len(ring)
        yield near and complete, f"cycle_counter shows {counter} and ring_cycle {held[:3]}"
    cycle_time = value("cycle_time")
    if isinstance(cycle_time, int) and cycle_time:
        yield EARLIEST_NS <= cycle_time < LATEST_NS, f"cycle_time shows {cycle_time} ns"
    for name in _RANGES:
        shows = value(name)
        if isinstance(shows, int | float) and name in registers:
            register = registers[name]
            text = f"{name} shows {shows / register.si_factor:g} {register.unit}"
            yield _is_in_range(name, shows), text.rstrip()


def _is_in_range(name: str, shows: float) -> bool:
    least, most, also = _RANGES[name]
    return least <= shows <= most or shows == also or (math.isnan(also) and math.isnan(shows))
