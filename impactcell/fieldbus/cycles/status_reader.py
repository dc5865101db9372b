"""The status block of a module, believed only once it is proved: by its CRC, or by being read twice."""

from typing import Final

from impactcell.errors import ProtocolError, WrongDeviceError
from impactcell.fieldbus.cycles.plausibility import wrong_word_order
from impactcell.fieldbus.cycles.status_block import STATUS_REGISTERS, StatusBlock, decode_status
from impactcell.fieldbus.register_client import RegisterClient
from impactcell.fieldbus.register_image import RegisterImage
from impactcell.fieldbus.registers import registers_crc32

_ATTEMPTS: Final = 8
"""Readings until one is proved, before the link counts as broken."""
_MAY_MOVE: Final = "part_position"
"""It may change with every reading, so two need not agree about it."""


class StatusReader:
    """Reads the status block of one module.

    A reply with a wrong bit looks like any other. A module whose map has `status_crc32`, and that fills it,
    proves its status block by it. Of others, one that shows anything new is read again until two readings
    agree.
    """

    def __init__(self, client: RegisterClient) -> None:
        self._client = client
        self._registers = client.registers
        covered = (register.name for register in client.registers.status())
        self._names = tuple(dict.fromkeys((*STATUS_REGISTERS, *covered)))
        self._proved: tuple[RegisterImage, StatusBlock] | None = None

    async def read(self) -> StatusBlock:
        """Read the status block.

        Raises
        ------
        LinkError, ProtocolError, ModbusExceptionError
            If the link fails, the module refuses, or no reading can be proved.
        WrongDeviceError
            If it is proved with the other word order.
        """
        before: RegisterImage | None = None
        for _ in range(_ATTEMPTS):
            image = await self._client.read_image(self._names)
            if self._proved is not None and image is self._proved[0]:
                return self._proved[1]
            if self._fits_crc(image) or (before is not None and self._agree(before, image)):
                self._proved = image, decode_status(self._registers, image.values)
                return self._proved[1]
            if (wrong := wrong_word_order(self._registers, image)) is not None and self._has_crc(image):
                raise WrongDeviceError(f"{self._client.modbus.link}: {wrong}")
            before = image
        raise ProtocolError(
            f"{self._client.modbus.link}: {_ATTEMPTS} readings of the status block "
            + ("do not fit its CRC" if self._has_crc(image) else "all differ")
        )

    @property
    def proves_word_order(self) -> bool:
        """Whether the status block that was read last has a checksum; that shows the order of words, too."""
        return self._proved is not None and self._has_crc(self._proved[0])

    @property
    def image(self) -> RegisterImage | None:
        """What the registers showed, as it was proved last."""
        return None if self._proved is None else self._proved[0]

    def _has_crc(self, image: RegisterImage) -> bool:
        return image.values.get("status_crc32", 0) != 0

    def _fits_crc(self, image: RegisterImage) -> bool:
        if not self._has_crc(image):
            return False
        words = image.words(self._registers["state"], self._registers["status_crc32"].address)
        return registers_crc32(words) == image.values["status_crc32"]

    def _agree(self, before: RegisterImage, image: RegisterImage) -> bool:
        """Whether two readings show the same; never where a CRC says that they are wrong."""
        if self._has_crc(before) or self._has_crc(image):
            return False
        moving = self._registers.registers.get(_MAY_MOVE)
        for block, one, other in zip(image.blocks, before.raw, image.raw, strict=True):
            if one == other:
                continue
            if moving is None or not (block.address <= moving.address and moving.end <= block.end):
                return False
            first, end = 2 * (moving.address - block.address), 2 * (moving.end - block.address)
            if one[:first] != other[:first] or one[end:] != other[end:]:
                return False
        return True
