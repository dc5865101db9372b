"""Whether who answers is the module that the map describes: pinned registers, and the order of words."""

from collections.abc import Mapping
from typing import Final

from impactcell.errors import ModbusExceptionError, WrongDeviceError
from impactcell.fieldbus.cycles.plausibility import wrong_word_order
from impactcell.fieldbus.cycles.status_block import StatusBlock
from impactcell.fieldbus.cycles.status_reader import StatusReader
from impactcell.fieldbus.register_client import RegisterClient
from impactcell.fieldbus.registers import Value
from impactcell.records import CycleId

_NOT_THIS_DEVICE: Final = (1, 2, 3, 10, 11)
"""Exceptions that say that there are no such registers, or nobody with this device id behind a gateway."""
_NO_REGISTER: Final = (1, 2, 3)
"""Those of them that say that a register is not there."""
_SERIAL: Final = "serial_number"


class IdentityCheck:
    """Proves who answers, on a new connection and before each cycle is read.

    A connection says little of what is behind it: a gateway keeps it while the module is exchanged, or given
    another firmware.

    Attributes
    ----------
    serial_number : str
        What the module showed last, where the map has it; empty where it shows none.
    """

    def __init__(self, cell: str, client: RegisterClient, status_reader: StatusReader) -> None:
        self._cell = cell
        self._client = client
        self._status_reader = status_reader
        registers = client.registers
        self._pinned = tuple(name for name, each in registers.registers.items() if each.expect is not None)
        self._serial = tuple(name for name in (_SERIAL,) if name in registers)
        self.serial_number = ""
        self._checked_for: CycleId | None = None
        self._order_proved = False

    def forget(self) -> None:
        """Prove everything anew, as on a new connection."""
        self._checked_for, self._order_proved = None, False

    async def check_for(self, cycle_id: CycleId) -> None:
        """As `check`, once for each cycle that is to be read."""
        if cycle_id != self._checked_for:
            await self.check()
            self._checked_for = cycle_id

    async def check(self) -> None:
        """Raise WrongDeviceError unless every register that the map pins shows what it should."""
        registers, link = self._client.registers, self._client.modbus.link
        try:
            values = await self._read()
        except ModbusExceptionError as error:
            if error.code not in _NOT_THIS_DEVICE:
                raise
            raise WrongDeviceError(
                f"{self._cell}: {error}; this is not a module of map {registers.name}, "
                f"or device_id {link.device_id} is wrong"
            ) from error
        for name in self._pinned:
            register = registers[name]
            if values[name] != register.expect:
                raise WrongDeviceError(
                    f"{self._cell}: {link}: register {name} ({register.address}) shows {values[name]!r}, "
                    f"map {registers.name} expects {register.expect!r}"
                )

        await self._take_serial_number(values)

    async def _read(self) -> Mapping[str, Value]:
        """Read the pinned registers and the serial number; of a module that refuses that, never again."""
        if self._serial:
            try:
                return (await self._client.read_image((*self._pinned, *self._serial))).values
            except ModbusExceptionError as error:
                if error.code not in _NO_REGISTER:
                    raise
            values = (await self._client.read_image(self._pinned)).values
            self._serial = ()
            return values
        return (await self._client.read_image(self._pinned)).values

    async def _take_serial_number(self, values: Mapping[str, Value]) -> None:
        """Take the serial number; one that is another than before only if it is shown twice."""
        shown = values.get(_SERIAL, "")
        if self.serial_number and shown != self.serial_number and (await self._read()).get(_SERIAL) != shown:
            return
        self.serial_number = str(shown)

    async def check_word_order(self, status: StatusBlock) -> None:
        """Raise WrongDeviceError where the module has the other word order: else it would count by 65536.

        Parameters
        ----------
        status : StatusBlock
            As it was read last; without a checksum, only a module that has made a cycle proves its order.
        """
        if self._order_proved:
            return
        if not self._status_reader.proves_word_order:
            if not status.cycle_counter or status.cycle_counter not in status.ring:
                return
            header = await self._client.read_header(status.ring.index(status.cycle_counter))
            image = self._status_reader.image
            wrong = None if image is None else wrong_word_order(self._client.registers, image, header)
            if wrong is not None:
                raise WrongDeviceError(f"{self._cell}: {self._client.modbus.link}: {wrong}")
        self._order_proved = True
