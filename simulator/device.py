"""The FPGA measuring module as a state machine: time goes in by `update`, registers are read and written.

Nothing here knows of sockets, clocks or files. What the registers mean stands in the map file
(config/maps/fpga-v1.yaml); a map without some of the registers gives a module without what they are for.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np

from impactcell.fieldbus.positioning_registers import is_ahead, last_sequence
from impactcell.fieldbus.registers import RegisterMap, Words
from simulator.announcements import BatchAnnouncer
from simulator.commands import CommandResult, ModuleState, commanded, show_part, show_ready, show_result
from simulator.cycle import RunningTap
from simulator.image import RegisterImage
from simulator.plant import NeverAtRestError, TapInput, simulate_tap
from simulator.process import scheduled_tap, strike_conditions
from simulator.recorder import Recording, record, reported
from simulator.scenario import Scenario
from simulator.tasks import PartSequence

NO_SLOT: Final = 0xFFFF
"""What `newest_slot` shows before the first cycle."""
COMMAND_REGISTERS: Final = (
    "command_accepted", "command_cycle", "command_result", "command_sequence", "command_abort"
)  # fmt: skip
MOST_STEPS_PER_UPDATE: Final = 4
"""Events of the plant between two looks at the registers."""

Truth = Mapping[str, Any]


class Device:
    """One module with its actuator, its part and its sensors.

    Parameters
    ----------
    scenario : Scenario
    registers : RegisterMap
        The layout it speaks.
    session : int
        Number of this start of the module.
    epoch_ns : int
        Time of day at `now_s`; 0 for a module whose clock is not set.
    now_s : float
        The caller's clock at the start, in seconds.
    on_truth : callable, optional
        Given the truth of every cycle as it ends, and the outcome of every positioning task.
    """

    def __init__(
        self,
        scenario: Scenario,
        registers: RegisterMap,
        *,
        session: int = 1,
        epoch_ns: int = 0,
        now_s: float = 0.0,
        on_truth: Callable[[Truth], None] | None = None,
    ) -> None:
        self.scenario = scenario
        self._image = RegisterImage(registers, session)
        self._recording = Recording.of(registers)
        self._last_command = last_sequence(registers)
        self._epoch_ns = epoch_ns
        self._began_s = now_s
        self._now_s = 0.0
        self._on_truth = on_truth
        self._tap: RunningTap | None = None
        self._made = 0
        self._next_s = math.inf if scenario.strikes is None else scenario.strikes.first_s
        self._rested_s = 0.0
        self._busy_until_s = -math.inf
        self._announcements = BatchAnnouncer(scenario, self._image)
        self._parts = PartSequence(scenario, 0.0)
        self._image.put("serial_number", scenario.serial_number)
        self._image.put("firmware_version", 0x0100)
        self._reset()

    def _reset(self) -> None:
        """Set the registers as a start of the module does."""
        self._tap = None
        for name in ("acknowledged_cycle", "overwritten_count", *COMMAND_REGISTERS):
            self._image.put(name, 0)
        self._image.put("newest_slot", NO_SLOT)
        self._show_state(ModuleState.READY)
        show_ready(self._image, self.scenario)
        self._show_part()
        self._announcements.announce(self._made, self.cycle)

    @property
    def cycle(self) -> int:
        """Number of the last complete cycle; 0 before the first."""
        return int(self._image.get("cycle_counter"))

    def update(self, now_s: float) -> None:
        """Bring the module to the caller's time `now_s`; a time that goes back is taken as no time passing.

        After a long gap, or far accelerated, a few cycles are made at a time and the module's own time lags
        behind until the calls that follow.
        """
        target_s = max((now_s - self._began_s) * self.scenario.acceleration, self._now_s)
        for _ in range(MOST_STEPS_PER_UPDATE):
            if self._due_s() > target_s:
                self._now_s = target_s
                return
            self._step()

    def request_came(self, now_s: float) -> None:
        """Be looked at from outside: a schedule that waits for it begins."""
        self.update(now_s)
        if self.scenario.strikes is not None and self._next_s == math.inf:
            self._next_s = self._now_s + self.scenario.strikes.period_s

    @property
    def due_s(self) -> float:
        """The caller's time at which something happens next; inf if nothing will by itself."""
        return self._began_s + self._due_s() / self.scenario.acceleration

    def _due_s(self) -> float:
        if self._tap is not None:
            return self._tap.ends_s
        strikes = self.scenario.strikes
        if strikes is None:
            return self._parts.due_s
        if strikes.cycles is not None and self._made >= strikes.cycles:
            return math.inf
        if strikes.ahead is not None and self._image.unacknowledged >= strikes.ahead:
            return math.inf
        return max(self._next_s, self._rested_s)

    def _step(self) -> None:
        self._now_s = max(self._now_s, self._due_s())
        strikes = self.scenario.strikes
        if self._tap is not None:
            self._finish(self._tap)
        elif strikes is None:
            self._parts.advance(self._now_s)
            self._show_part()
        else:
            # A strike that had to wait is not made up for.
            self._next_s = (self._next_s if strikes.ahead is None else self._now_s) + strikes.period_s
            self._strike(scheduled_tap(self.scenario, strikes, self._made), sequence=0)

    def _strike(self, commanded: TapInput, sequence: int) -> None:
        self._made += 1
        met = strike_conditions(self.scenario, self._made, commanded.start_m, commanded.direction)
        strike = replace(
            commanded,
            dwell_s=self._now_s - self._rested_s,
            shot=self._made,
            shots=max(self._made, 1000),
            batch=self.scenario.batches.index(met.batch),
        )
        try:
            motion = simulate_tap(met.plant, strike)
        except NeverAtRestError:
            self._show_state(ModuleState.FAULT)
            show_result(self._image, sequence, CommandResult.FAULT)
            return
        self._tap = RunningTap(strike, met, motion, self._now_s, sequence)
        self._show_state(ModuleState.CYCLE_RUNNING)

    def _finish(self, ended: RunningTap) -> None:
        """Put the cycle into the ring, now that the part is at rest."""
        scenario = self.scenario
        self._tap = None
        faulty = next((entry.kind for entry in scenario.faulty_captures if entry.cycle == self._made), "")
        samples, rates = record(scenario, ended.motion, self._recording, ended.met.random, faulty)
        time_ns = self._time_ns(ended.began_s)
        header = (
            ended.header(time_ns, self._announcements.batch_id, mass_stated=scenario.part.mass_stated) | rates
        )
        header |= reported(self._image.registers, header, ended.met.random)
        self._rested_s = self._now_s
        self._show_state(ModuleState.READY)
        if scenario.positioning is not None:
            self._parts.moved(ended.position_m, self._now_s)
        cycle = self._image.complete(samples, header)
        if scenario.positioning is not None:
            self._image.put("command_cycle", cycle)
            aborted = bool(self._image.get("command_abort"))
            show_result(self._image, ended.sequence, CommandResult.ABORTED if aborted else CommandResult.DONE)
            self._image.put("command_abort", 0)
            show_ready(self._image, self.scenario)
        self._tell(ended.truth(self._image.session, cycle, time_ns))
        self._show_part()
        self._announcements.announce(self._made, self.cycle)

    def _time_ns(self, own_s: float) -> int:
        return self._epoch_ns and self._epoch_ns + round(own_s / self.scenario.acceleration * 1e9)

    def _tell(self, truth: Truth) -> None:
        if self._on_truth is not None:
            self._on_truth(truth)

    def read(self, table: str, address: int, count: int) -> Words:
        """Return registers; LookupError beyond the map, BlockingIOError while the module is made busy."""
        if self._now_s < self._busy_until_s:
            raise BlockingIOError
        return self._image.read(table, address, count)

    @property
    def identification(self) -> Mapping[int, str]:
        """What the module says to function 43/14."""
        return {0: "impactcell", 1: "SIM", 2: "1.0", 4: "Simulated measuring module", 5: self.scenario.name}

    def write_coils(self, address: int, bits: Words) -> None:
        """Write coils, and act on them; raises as `write`."""
        self.write(address, bits, "coil")

    def write(self, address: int, words: Words, table: str = "holding") -> None:
        """Write registers or coils, and act on them.

        Raises
        ------
        LookupError
            The map does not let them be written.
        ValueError
            There is no such slot.
        BlockingIOError
            The module is made busy.
        """
        if self._now_s < self._busy_until_s:
            raise BlockingIOError
        commanded = self._image.get("command_sequence")
        self._image.write(address, words, table)
        self._announcements.take()
        if self._image.get("command_abort"):
            self._abort()
        number, accepted = int(self._image.get("command_sequence")), int(self._image.get("command_accepted"))
        if number != commanded and is_ahead(number, accepted, self._last_command):
            self._command(number)

    def _show_part(self) -> None:
        show_part(self._image, self._parts, mass_stated=self.scenario.part.mass_stated)
        for outcome in self._parts.outcomes():
            self._tell(outcome)

    def _show_state(self, state: ModuleState) -> None:
        self._state = state
        self._image.put_code("state", state.value)

    def _command(self, sequence: int) -> None:
        positioning = self.scenario.positioning
        if positioning is None or self._tap is not None or self._state is not ModuleState.READY:
            show_result(self._image, sequence, CommandResult.REFUSED_STATE)
            return
        self._image.put("command_cycle", 0)
        strike = commanded(self._image, positioning, self._parts)
        if strike is None:
            show_result(self._image, sequence, CommandResult.REFUSED_VALUE)
            return
        show_result(self._image, sequence, CommandResult.EXECUTING)
        self._strike(strike, sequence)

    def _abort(self) -> None:
        """Halt the actuator where it is; what it has set in motion slides on."""
        under_way = self._tap
        if under_way is None or self.scenario.positioning is None:
            self._image.put("command_abort", 0)
            return
        elapsed_s = self._now_s - under_way.began_s
        if elapsed_s >= under_way.motion.halt_s:
            return
        travelled = abs(float(under_way.motion.actuator_m(np.array([elapsed_s]))[0]))
        strike = replace(under_way.strike, stroke_m=max(travelled, 1e-9))
        self._tap = replace(under_way, strike=strike, motion=simulate_tap(under_way.met.plant, strike))

    def restart(self) -> int:
        """Lose everything and start anew with the counter at zero; returns the new session."""
        session = self._image.restart()
        self._announcements.restart()
        self._reset()
        return session

    def set_counter(self, value: int) -> None:
        """Go on counting after `value`."""
        self._image.count_from(value)

    def busy(self, seconds: float) -> None:
        """Refuse every request for so many of the module's seconds."""
        self._busy_until_s = self._now_s + seconds

    def overrun(self, cycles: int) -> None:
        """Make so many cycles at once."""
        for _ in range(cycles):
            before = self.cycle
            while self.cycle == before and math.isfinite(self._due_s()):
                self._step()
