"""Cycles of one module, each once and in order, whatever the link does.

`ModuleAcquisition.captures` connects, checks who answers, polls, reads each new cycle consistently, catches
up from the module's ring after an outage, and counts what the ring no longer had. It never raises for what
the module or the link does: that is said in its `status` and in the `faults` of a `ReceivedCycle`.
"""

import asyncio
import contextlib
import logging
from collections.abc import AsyncGenerator, Callable
from dataclasses import replace
from typing import Self

from impactcell.errors import FieldbusError, LinkError
from impactcell.fieldbus.cycles.acknowledgement import Acknowledgement
from impactcell.fieldbus.cycles.backoff import Backoff
from impactcell.fieldbus.cycles.capture_reader import CaptureReader
from impactcell.fieldbus.cycles.capture_ring import cycles_after
from impactcell.fieldbus.cycles.cycle_choice import CycleChoice
from impactcell.fieldbus.cycles.cycle_dates import CycleDates
from impactcell.fieldbus.cycles.cycle_numbers import CycleNumbers
from impactcell.fieldbus.cycles.fetched_capture import NotFetched
from impactcell.fieldbus.cycles.identity import IdentityCheck
from impactcell.fieldbus.cycles.life_check import LifeCheck
from impactcell.fieldbus.cycles.module_account import ModuleAccount
from impactcell.fieldbus.cycles.poll_schedule import PollSchedule
from impactcell.fieldbus.cycles.received_cycle import ReceivedCycle
from impactcell.fieldbus.cycles.status_block import StatusBlock
from impactcell.fieldbus.cycles.status_reader import StatusReader
from impactcell.fieldbus.cycles.taken_cycles import NOTHING_BEFORE, TakenBefore, TakenCycles
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.register_client import RegisterClient
from impactcell.fieldbus.registers import RegisterMap
from impactcell.process.cell_logger import CellLogger
from impactcell.records import CycleId, ModuleStatus

__all__ = ["ModuleAcquisition", "ModuleStatus", "ReceivedCycle"]


class ModuleAcquisition:
    """The FPGA module of one cell.

    Use as ``async with ModuleAcquisition(...) as module: async for received in module.captures(after): ...``.
    Nothing is connected before `captures` runs.

    Parameters
    ----------
    cell : str
        The cell's name, for messages.
    client : ModbusClient
        Reaches the module, over whatever transport.
    registers : RegisterMap
        Its layout.
    on_change : callable, optional
        Called with the new `ModuleStatus` when the connection is made or lost.
    """

    def __init__(
        self,
        cell: str,
        client: ModbusClient,
        registers: RegisterMap,
        on_change: Callable[[ModuleStatus], None] | None = None,
    ) -> None:
        self.cell = cell
        self.link = client.link
        self.registers = registers
        self._log = CellLogger(logging.getLogger(__name__), cell)
        self._shown: StatusBlock | None = None
        self._client = client
        self.register_client = RegisterClient(client, registers)
        self._status_reader = StatusReader(self.register_client)
        self._reader = CaptureReader(cell, self.register_client)
        self._numbers = CycleNumbers.of(registers["cycle_counter"].kind)
        self._taken = TakenCycles(None, 0, registers.slots, self._numbers)
        self._dates = CycleDates(registers, self._log)
        self._account = ModuleAccount(cell, self._log, on_change and (lambda: on_change(self.status)))
        self._ready = asyncio.Event()
        self._acknowledgement = Acknowledgement(self._log, self.register_client, self._numbers)
        self._said_given_up = False
        self._life = LifeCheck(self._log, self.register_client, self._numbers)
        self._identity = IdentityCheck(cell, self.register_client, self._status_reader)

    @property
    def status(self) -> ModuleStatus:
        """State of the link and counts."""
        return replace(
            self._account.status,
            round_trip_s=self._client.round_trip_s,
            discarded=self._reader.discarded,
            reconnects=max(0, self._account.connections - 1),
        )

    @property
    def status_block(self) -> StatusBlock | None:
        """What the module said at the last poll, with cycles numbered on; None before the first."""
        return None if self._shown is None else self._numbers.status(self._shown, self._taken.last)

    async def __aenter__(self) -> Self:
        """Return the module."""
        return self

    async def __aexit__(self, *_: object) -> None:
        """Close the connection."""
        await self.close()

    async def close(self) -> None:
        """Close the connection."""
        self._ready.clear()
        await self._client.close()
        level = logging.INFO if self._account.status.connected else logging.DEBUG
        self._account.disconnect(f"{self.cell}: connection closed", level)

    @property
    def serial_number(self) -> str:
        """Of the module that is read; empty where that is not known."""
        return self._taken.serial_number

    async def wait_connected(self) -> None:
        """Wait until the right module answers; `captures` must be running meanwhile."""
        await self._ready.wait()

    async def read_status(self) -> StatusBlock:
        """Read the status block now; raises FieldbusError where `captures` would only note it."""
        self._shown = await self._status_reader.read()
        return self._numbers.status(self._shown, self._taken.last)

    def note_durable(self, cycle_id: CycleId | None) -> None:
        """Have the module told, from the next poll on, that this cycle and all before it are durable.

        Without a connection it is told as soon as there is one, if it has not been started anew meanwhile; a
        module without the registers is not told.
        """
        self._acknowledgement.durable = cycle_id

    async def acknowledge(self, cycle_id: CycleId | None) -> None:
        """Do what `note_durable` does, and tell a module that is connected at once."""
        self.note_durable(cycle_id)
        status = self.status_block
        if self._ready.is_set() and status is not None:
            with contextlib.suppress(FieldbusError):  # it is repeated by the next poll
                await self._acknowledgement.send(status)

    async def captures(
        self, after: CycleId | None = None, after_time_ns: int = 0, before: TakenBefore = NOTHING_BEFORE
    ) -> AsyncGenerator[ReceivedCycle]:
        """Yield each cycle after `after` once, in order; ends only when it is closed.

        Parameters
        ----------
        after : CycleId or None
            Last cycle that is durable; None: begin with the oldest that the module still has.
        after_time_ns : int
            Its own time; 0 where that is not known.
        before : TakenBefore, optional
            What was taken besides; without it, cycles of a session that comes again may come twice.
        """
        slots = self.registers.slots
        taken = self._taken = TakenCycles(after, after_time_ns, slots, self._numbers, before)
        backoff, schedule = Backoff(), PollSchedule()
        loop = asyncio.get_running_loop()
        newest = CycleId(0, 0)
        choice = CycleChoice(self.registers, self._log)
        while True:
            sent_s = loop.time()
            try:
                status = await self._poll()
                newest_now = CycleId(status.session, status.cycle_counter)
                schedule.record_poll(sent_s, loop.time(), new=newest_now != newest)
                newest = newest_now
                if self._is_another_module(taken) or not await self._is_settled(taken):
                    await asyncio.sleep(schedule.delay_s(loop.time()))
                    continue
                target = choice.target(taken.last, status, loop.time(), is_new_life=taken.is_new_life)
                if target is None:
                    backoff.reset()
                    await asyncio.sleep(schedule.delay_s(loop.time()))
                    continue
                await self.find_window()
                await self._identity.check_for(target.cycle_id)
                if self._is_another_module(taken):
                    continue
                fetched = await self._reader.fetch(target, taken)
            except FieldbusError as error:
                await self._disconnect(error)
                # An attempt that ran into its timeout has waited long enough.
                await asyncio.sleep(max(0.0, sent_s + backoff.next_delay_s() - loop.time()))
                continue
            if isinstance(fetched, NotFetched):
                choice.record_failure(target, fetched, loop.time())
                if fetched is not NotFetched.OVERWRITTEN:  # else the ring is looked at again at once
                    await asyncio.sleep(schedule.delay_s(loop.time()))
                continue
            choice.record_success()
            if target.restarted:
                target = self._numbers.of_new_life(target)
                newest = replace(newest, cycle=target.counter)
            if fetched.readable:  # not for the status block alone, which says nothing of the window
                backoff.reset()
            last = taken.last
            restarted = target.restarted or taken.is_other_life(target.cycle_id.session)
            if restarted:
                self._acknowledgement.begin_life()
            capture = replace(fetched.capture, session=target.cycle_id.session)
            is_newest = target.cycle_id == newest
            capture = self._dates.dated(
                capture,
                readable=fetched.readable,
                is_newest=is_newest,
                restarted=restarted,
                now_s=loop.time(),
            )
            schedule.update(
                1e-9 * fetched.capture.time_ns or loop.time(),
                cycles_after(last.cycle, target.cycle_id.cycle) if last and not restarted else 0,
                newest=is_newest,
            )
            taken.add(target.cycle_id, fetched.header, fetched.capture.time_ns)
            received = ReceivedCycle(capture, target.cycle_id, target.missed, restarted, fetched.faults)
            self._account.count(received, readable=fetched.readable, is_doubtful=self._life.is_doubtful)
            self._life.is_doubtful = False
            yield received
            if taken.last == newest:  # nothing waits behind it
                await asyncio.sleep(schedule.delay_s(loop.time()))

    async def connect_once(self) -> StatusBlock:
        """Connect, check who answers, and read the status block; raises FieldbusError where that fails."""
        await self._connect()
        status = await self.read_status()
        await self._identity.check_word_order(status)
        return status

    async def find_window(self) -> None:
        """Try, once for each connection, how many requests the module can have in flight.

        Raises
        ------
        LinkError
            If the trial has cost the connection; the next one is not tried again.
        """
        if not await self.register_client.find_window():
            raise LinkError(f"{self.link}: the connection was lost while several requests were in flight")

    def _say_given_up(self) -> None:
        """Log, once, that the module has one request in flight for good."""
        reason = self._client.window.given_up
        if reason and not self._said_given_up:
            self._said_given_up = True
            self._log.warning("one request in flight from now on, for with several: %s", reason)

    async def _connect(self) -> None:
        """Connect and check who answers."""
        self._ready.clear()
        await self._client.connect()
        self._identity.forget()
        await self._identity.check()
        self._acknowledgement.begin_connection()
        self._life.begin_connection()

    async def _poll(self) -> StatusBlock:
        if not self._client.connected:
            await self._connect()
        self._say_given_up()
        status = await self.read_status()
        await self._identity.check_word_order(status)
        if not self._ready.is_set():
            self._account.connect(self.link)
            self._ready.set()
        return status

    def _is_another_module(self, taken: TakenCycles) -> bool:
        """Whether another module answers than before; its cycles are then read from the oldest on."""
        if not (before := taken.meet(self._identity.serial_number)):
            return False
        self._log.warning(
            "another module answers (serial number %s instead of %s): all is read that it holds and that was "
            "not taken of it before; of what it has made besides nothing counts as missed",
            taken.serial_number, before,
        )  # fmt: skip
        return True

    async def _is_settled(self, taken: TakenCycles) -> bool:
        """Whether it is settled which life of the module is read; it is then told what is stored of that."""
        if self._shown is None or not await self._life.is_settled(self._shown, taken):
            return False
        if taken.last is not None and not taken.is_new_life:
            await self._acknowledgement.send(self._numbers.status(self._shown, taken.last))
        return True

    async def _disconnect(self, error: FieldbusError) -> None:
        """Close the connection after an error and say why; the log, once for each kind of reason."""
        self._ready.clear()
        await self._client.close()
        reason = str(error) if str(error).startswith(self.cell) else f"{self.cell}: {error}"
        self._account.disconnect(reason, answered=not isinstance(error, LinkError))
