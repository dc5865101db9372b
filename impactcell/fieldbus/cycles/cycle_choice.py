"""Which cycle to read next, from what came of those before; tells of a module that never shows it."""

from dataclasses import replace
from typing import Final

from impactcell.fieldbus.cycles.capture_ring import NextCapture, is_after, is_consistent, next_capture
from impactcell.fieldbus.cycles.cycle_numbers import CycleNumbers
from impactcell.fieldbus.cycles.fetched_capture import NotFetched
from impactcell.fieldbus.cycles.status_block import StatusBlock
from impactcell.fieldbus.registers import RegisterMap
from impactcell.process.cell_logger import CellLogger
from impactcell.records import CycleId

_DISAGREEMENTS: Final = 5
"""So often status block and window may disagree about the oldest cycle; then the next one is tried."""
_NO_SESSION: Final = -1
"""Of a life that is over: no module shows it."""
PATIENCE_S: Final = 10.0
"""So long a status block and what the module shows may contradict each other before it is told: a gateway
that answers out of a store, or a module that starts, is through by then."""


class CycleChoice:
    """Chooses the cycle to read, farther from the ring's end the more of them were overwritten meanwhile."""

    def __init__(self, registers: RegisterMap, log: CellLogger) -> None:
        self._registers = registers
        self._log = log
        self._period = CycleNumbers.of(registers["cycle_counter"].kind).period
        self._overwritten = self._disagreements = 0
        self._contradicted_since_s: float | None = None
        self._told = False
        self._seen: CycleId | None = None

    def target(
        self, last: CycleId | None, status: StatusBlock, now_s: float, *, is_new_life: bool = False
    ) -> NextCapture | None:
        """Choose the cycle to read; None where there is none, or the status block contradicts itself.

        Parameters
        ----------
        last : CycleId or None
            Last cycle taken; None: none ever.
        status : StatusBlock
        now_s : float
        is_new_life : bool
            Whether the module was started anew since `last`, though it may show the same session.
        """
        if not is_consistent(status.cycle_counter, status.ring):
            held = [cycle for cycle in status.ring if cycle]
            shown = f"{min(held)} to {max(held)}" if held else "no cycle at all"
            self._contradict(f"cycle_counter shows {status.cycle_counter}, but ring_cycle {shown}", now_s)
            return None
        skip = self._overwritten // 2 + self._disagreements // _DISAGREEMENTS
        newest = CycleId(status.session, status.cycle_counter)
        goes_on = last is not None and newest.session == last.session and not is_new_life
        if last is not None and goes_on and not is_after(last.cycle, newest.cycle):
            self._seen = newest
        seen = self._seen.cycle if self._seen and last and self._seen.session == last.session else None
        if is_new_life and last is not None:
            last = replace(last, session=_NO_SESSION)
        target = next_capture(last, newest.session, newest.cycle, status.ring, skip, seen, self._period)
        if target is None:
            self._agree()
        return target

    def record_failure(self, target: NextCapture, reason: NotFetched, now_s: float) -> None:
        """Take note of a cycle that was not read."""
        if reason is NotFetched.OVERWRITTEN:
            self._overwritten = min(max(1, 2 * self._overwritten), self._registers.slots)
            return
        cycle = target.cycle_id.cycle
        self._log.debug("%s", reason.value, cycle=cycle)
        self._disagreements += not target.restarted and reason is NotFetched.NOT_SHOWN
        if reason in (NotFetched.NOT_SHOWN, NotFetched.TAKEN):
            self._contradict(f"cycle_counter shows {target.counter}, but {reason.value}", now_s)

    def record_success(self) -> None:
        """Take note of a cycle that was read."""
        self._overwritten, self._disagreements = self._overwritten // 2, 0
        self._agree()

    def _agree(self) -> None:
        self._contradicted_since_s, self._told = None, False

    def _contradict(self, what: str, now_s: float) -> None:
        """Tell, once, of a contradiction that does not pass: no cycle can be read, and nobody would know."""
        if self._contradicted_since_s is None:
            self._contradicted_since_s = now_s
        elif now_s - self._contradicted_since_s >= PATIENCE_S and not self._told:
            self._told = True
            names = ("cycle_counter", "ring_cycle", "window_cycle", "window_slot")
            where = ", ".join(
                f"{name} ({self._registers[name].address})" for name in names if name in self._registers
            )
            self._log.warning(
                "no cycle can be read for %.0f s: %s; see whether %s are right in map %s",
                now_s - self._contradicted_since_s, what, where, self._registers.name,
            )  # fmt: skip
