"""Tells the module up to which cycle all is stored; that it does not take it never costs a measurement."""

import asyncio
import math
from typing import Final

from impactcell.errors import FieldbusError, ModbusExceptionError
from impactcell.fieldbus.cycles.capture_ring import is_after
from impactcell.fieldbus.cycles.cycle_numbers import CycleNumbers
from impactcell.fieldbus.cycles.status_block import StatusBlock
from impactcell.fieldbus.register_client import RegisterClient
from impactcell.process.cell_logger import CellLogger
from impactcell.records import CycleId

_REGISTER: Final = "acknowledge_cycle"
_FIRST_PAUSE_S: Final = 1.0
"""Rest after the second failure; it is doubled with each."""
_LONGEST_PAUSE_S: Final = 60.0
"""The longest: a module that makes no cycle until it is told goes on a minute after it can be told again."""


class Acknowledgement:
    """What the module is to be told, and whether it has been.

    Attributes
    ----------
    durable : CycleId or None
        The last cycle that is stored, with all before it; None: none yet.
    """

    def __init__(self, log: CellLogger, client: RegisterClient, numbers: CycleNumbers) -> None:
        self.durable: CycleId | None = None
        self._log = log
        self._client = client
        self._numbers = numbers
        self._told: CycleId | None = None
        self._void: CycleId | None = None
        self._failures = 0
        self._not_before_s, self._pause_s = -math.inf, _FIRST_PAUSE_S

    def begin_connection(self) -> None:
        """Take it that the module may have forgotten what it was told."""
        self._told = None

    def begin_life(self) -> None:
        """Take it that what is durable so far is of another life of the module, or of another module."""
        self._void = self.durable

    async def send(self, status: StatusBlock) -> None:
        """Tell the module, unless that is done, or of no use now; one that refuses is told again later.

        Parameters
        ----------
        status : StatusBlock
            As it was read last. It says whether the cycle is of the module's present life: in another one it
            would acknowledge cycles that nobody has. `acknowledge_session` tells of a start since.

        Raises
        ------
        LinkError, ProtocolError
            If the link fails.
        """
        cycle_id, registers = self.durable, self._client.registers
        if cycle_id == self._void:
            return
        self._void = None
        if cycle_id is None or cycle_id == self._told or _REGISTER not in registers:
            return
        if status.session != cycle_id.session or is_after(cycle_id.cycle, status.cycle_counter):
            return
        values = {_REGISTER: self._numbers.shown(cycle_id.cycle)}
        if "acknowledge_session" in registers:
            values["acknowledge_session"] = cycle_id.session
        if asyncio.get_running_loop().time() < self._not_before_s:
            return
        try:
            await self._client.write_values(values)
        except FieldbusError as error:
            self._put_off(cycle_id, error)
            if not isinstance(error, ModbusExceptionError):
                raise
        else:
            self._told, self._failures, self._pause_s = cycle_id, 0, _FIRST_PAUSE_S

    def _put_off(self, cycle_id: CycleId, error: FieldbusError) -> None:
        """Try again with the next poll after a first failure, after others less and less often."""
        self._failures += 1
        if self._failures == 1:
            self._log.info("the acknowledgement will be repeated: %s", error, cycle=cycle_id.cycle)
            return
        if self._failures == 2:
            registers = self._client.registers
            self._log.warning(
                "the module is not told which cycles are stored, for register %s (%d) cannot be written: %s; "
                "cycles are read all the same; if there is no such register, leave it out of map %s",
                _REGISTER, registers[_REGISTER].address, error, registers.name, cycle=cycle_id.cycle,
            )  # fmt: skip
        self._not_before_s = asyncio.get_running_loop().time() + self._pause_s
        self._pause_s = min(2.0 * self._pause_s, _LONGEST_PAUSE_S)
