"""The header of a capture: whether the window was at rest, which cycle it is of, and what identifies it."""

from collections.abc import Mapping

from impactcell.fieldbus.cycles.cycle_numbers import CycleNumbers
from impactcell.fieldbus.cycles.status_block import integer
from impactcell.fieldbus.register_image import RegisterImage
from impactcell.fieldbus.registers import Register, RegisterMap, Value
from impactcell.records import CycleId


class CaptureHeader:
    """Reads what identifies a capture out of its header.

    Parameters
    ----------
    registers : RegisterMap
    numbers : CycleNumbers
        How the module counts its cycles.
    """

    def __init__(self, registers: RegisterMap, numbers: CycleNumbers) -> None:
        self._numbers = numbers
        self._spans = _spans(registers)

    def identity(self, image: RegisterImage) -> bytes:
        """Words of a header that stay the same while its capture does."""
        return b"".join(image.words(first, end).tobytes() for first, end in self._spans)

    def shown(self, header: Mapping[str, Value], wanted: CycleId) -> CycleId:
        """Which cycle a header is of, as far as it says; `wanted` is the one that is looked for."""
        name = "window_cycle" if "window_cycle" in header else "cycle_counter"
        cycle = self._numbers.number(integer(header[name]), near=wanted.cycle)
        return CycleId(integer(header.get("window_session", wanted.session)), cycle)


def at_rest(header: Mapping[str, Value]) -> bool:
    """Whether the window was at rest, as far as the module says."""
    sequence = header.get("window_sequence", 0)
    return isinstance(sequence, int) and sequence % 2 == 0 and header.get("capture_ready", 1) == 1


def _spans(registers: RegisterMap) -> list[tuple[Register, int]]:
    """Give pieces of what identifies a capture, each from a register to an address."""
    spans: list[tuple[Register, int]] = []
    for register in registers.header():
        if register.name in ("window_sequence", "capture_ready"):
            continue
        if spans and spans[-1][0].table == register.table and spans[-1][1] == register.address:
            spans[-1] = spans[-1][0], register.end
        else:
            spans.append((register, register.end))
    return spans
