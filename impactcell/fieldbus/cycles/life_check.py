"""Whether a module goes on in the life of which cycles have been taken, where its session does not tell.

A session that comes again can be that of a module which a gateway has not asked for a while, or another life
under the same number; and a module without a session can have been started anew over any outage. What a slot
of the ring shows for the last cycle taken decides, as long as the ring holds that.
"""

import enum
from typing import Final

from impactcell.fieldbus.cycles.capture_header import CaptureHeader, at_rest
from impactcell.fieldbus.cycles.capture_ring import is_after
from impactcell.fieldbus.cycles.cycle_numbers import CycleNumbers
from impactcell.fieldbus.cycles.decoding import LATEST_NS, cycle_time_ns
from impactcell.fieldbus.cycles.status_block import StatusBlock
from impactcell.fieldbus.cycles.taken_cycles import TakenCycles
from impactcell.fieldbus.register_client import RegisterClient
from impactcell.process.cell_logger import CellLogger
from impactcell.records import CycleId

_MOST_ATTEMPTS: Final = 5
"""Readings of a slot that may show something else than the status block has; then nothing tells."""


class _Verdict(enum.Enum):
    SAME = "the module is in the life of the cycle"
    OTHER = "it is in another one"
    NONE = "nothing tells"
    NOT_YET = "it has to be looked at again"


class LifeCheck:
    """Looks after the life of one module.

    Attributes
    ----------
    is_doubtful : bool
        Whether nothing could tell that the module was not started anew since the last cycle taken.
    """

    def __init__(self, log: CellLogger, client: RegisterClient, numbers: CycleNumbers) -> None:
        self.is_doubtful = False
        self._log = log
        self._client = client
        self._numbers = numbers
        self._header = CaptureHeader(client.registers, numbers)
        self._has_session = "session" in client.registers
        self._answered: tuple[str, int] | None = None
        self._attempts = 0
        self._differed = b""

    def begin_connection(self) -> None:
        """Take it that the module may have been started anew."""
        self._answered, self._attempts, self._differed, self.is_doubtful = None, 0, b"", False

    async def is_settled(self, shown: StatusBlock, taken: TakenCycles) -> bool:
        """Whether it is known which life a status block is of, or cannot be; else it is to be read again.

        Parameters
        ----------
        shown : StatusBlock
            As the module shows it.
        taken : TakenCycles
            Told of what is found out.

        Raises
        ------
        LinkError, ProtocolError, ModbusExceptionError
            If link or module fail now.
        """
        life = taken.serial_number, shown.session
        if life == self._answered or shown.cycle_counter == 0:
            return True
        goes_on = taken.last is not None and taken.last.session == shown.session
        last = taken.last if goes_on else taken.left(shown.session)
        if last is None or (goes_on and self._has_session):
            self._answered = life
            return True
        verdict = await self._verdict(last, self._numbers.status(shown, last), taken)
        if verdict is _Verdict.NOT_YET:
            self._attempts += 1
            if self._attempts < _MOST_ATTEMPTS:
                return False
            verdict = _Verdict.NONE
        self._answered, self._attempts, self._differed = life, 0, b""
        if goes_on:
            self.is_doubtful = verdict is _Verdict.NONE
            if verdict is _Verdict.OTHER:
                self._log.info("the module was started anew: it holds another cycle", cycle=last.cycle)
                taken.begin_life()
        elif verdict is _Verdict.SAME:
            taken.resume(shown.session)
            self._log.info(
                "session %d is back: it is read on after this cycle", last.session, cycle=last.cycle
            )
            return False
        elif verdict is _Verdict.OTHER:
            taken.forget(shown.session)
        return True

    async def _verdict(self, last: CycleId, status: StatusBlock, taken: TakenCycles) -> _Verdict:
        """Find out whether the module is in the life of a cycle."""
        is_held = last.cycle in status.ring
        if not is_held and not self._has_session:
            return _Verdict.NONE
        cycle_id = last if is_held else CycleId(status.session, status.cycle_counter)
        if cycle_id.cycle not in status.ring:
            return _Verdict.NOT_YET
        slot = status.ring.index(cycle_id.cycle)
        image = await self._client.read_header(slot)
        if image.values.get("window_slot", slot) != slot:
            image = await self._client.read_header()
        header = image.values
        is_shown = (
            header.get("window_slot", slot) == slot and self._header.shown(header, cycle_id) == cycle_id
        )
        if not (at_rest(header) and is_shown):
            return _Verdict.NOT_YET
        if not is_held:
            if "window_session" not in header:
                return _Verdict.NONE
            return _Verdict.SAME if is_after(status.cycle_counter, last.cycle) else _Verdict.OTHER
        time_ns, identity = cycle_time_ns(header), self._header.identity(image)
        is_same = taken.is_same(last, identity, round(time_ns) if 0 <= time_ns <= LATEST_NS else 0)
        if is_same is None:
            return _Verdict.NONE
        if not is_same and identity != self._differed:  # a reply with a wrong bit is no proof
            self._differed = identity
            return _Verdict.NOT_YET
        return _Verdict.SAME if is_same else _Verdict.OTHER
