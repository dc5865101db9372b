"""Positioning taps: commanded with a read-back and a handshake, so that none is made twice or by accident.

The parameters are written and read back; only then the command's sequence number is written, and one ahead
of the last that it has taken is what the module acts on. Writing the same number again does nothing, so a
command whose answer was lost with the link is repeated safely. For the same reason the next command has
another number than one that still stands there and was not taken.
"""

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from impactcell.errors import (
    FieldbusError,
    LinkError,
    ModbusExceptionError,
    NotDecimalError,
    PositioningError,
    ProtocolError,
)
from impactcell.fieldbus.acquisition import ModuleAcquisition
from impactcell.fieldbus.cycles.status_block import PositioningStatus, integer
from impactcell.fieldbus.positioning_registers import (
    COMMAND,
    DONE,
    EXECUTING,
    PARAMETERS,
    READY,
    last_sequence,
    next_sequence,
)

Objection = Callable[[PositioningStatus], str]
"""Says why a tap is no longer to be made, from what the module shows; nothing where it is."""
_POLL_S: Final = 0.005
"""Between two looks at the outcome of a tap, seconds: a tenth of the shortest tap and slide."""
_ROUNDING: Final = 1e-6
"""Share by which a register of floats may miss what is commanded: an f32 does so by less than 1e-7."""
_REFUSALS: Final = frozenset({1, 2, 3})
"""Exception codes of a request that will never do (function, address, value); all others may pass."""


@dataclass(frozen=True, slots=True)
class TapCommand:
    """One tap; `direction` is +1 or -1."""

    velocity_m_s: float
    stroke_m: float
    direction: int

    @property
    def parameters(self) -> dict[str, float]:
        """What is written to which register, SI."""
        return dict(zip(PARAMETERS, (self.velocity_m_s, self.stroke_m, self.direction), strict=True))


class ObjectionError(PositioningError):
    """A tap that was objected to, by what `report` shows; `sent`: a request to strike was, without answer."""

    def __init__(self, message: str, report: PositioningStatus, *, sent: bool = False) -> None:
        super().__init__(message)
        self.report, self.sent = report, sent


class TapCommander:
    """Commands taps through a `Module` whose `captures` are running.

    Parameters
    ----------
    patience_s : float
        How long a tap and its slide may take, an outage in between included.
    """

    def __init__(self, module: ModuleAcquisition, patience_s: float = 10.0) -> None:
        self._module = module
        self._patience_s = patience_s
        self._lock = asyncio.Lock()
        accepted = module.registers.registers.get("command_accepted")
        self._accepted_at = None if accepted is None else accepted.address

    @property
    def available(self) -> bool:
        """Whether the module's map has the registers of a positioning cell."""
        return all(name in self._module.registers for name in (*COMMAND, "command_result"))

    async def tap(self, command: TapCommand, objection: Objection = lambda _: "") -> PositioningStatus:
        """Execute one tap; return what the module showed as it was done.

        Parameters
        ----------
        objection : callable
            Asked, with what the module shows, before anything is written and at the last moment before the
            module is told to strike: where it gives a reason, nothing is commanded any more, however long the
            link was down.

        Raises
        ------
        ObjectionError
            If there was an objection.
        PositioningError
            If the command is refused, aborted or not finished in time; the message says whether the part may
            have been struck.
        """
        self._check(command)
        async with self._lock:
            sequence = 0
            try:
                async with asyncio.timeout(self._patience_s):
                    session, before = await self._read_positioning()
                    self._ask(objection, before)
                    if before.state != READY:
                        raise PositioningError(
                            f"{self._module.cell}: module takes no command, it is {before.state}"
                        )
                    number = await self._next_sequence(before.accepted_command)
                    await self._write_parameters(command)
                    sequence = number
                    return await self._execute(session, sequence, before.accepted_command, objection)
            except TimeoutError:
                cell, shown = self._module.cell, self._accepted_now
                if sequence and shown not in (None, sequence):
                    raise PositioningError(
                        f"{cell}: tap not finished within {self._patience_s:g} s; the module has not taken "
                        f"command {sequence}, register command_accepted ({self._accepted_at}) shows {shown}"
                    ) from None
                raise PositioningError(
                    f"{cell}: tap not finished within {self._patience_s:g} s; {_struck(bool(sequence))}"
                ) from None

    async def read_report_at_rest(self) -> PositioningStatus:
        """Return what the module says once it is ready for a tap, waiting for that and for the link.

        Raises
        ------
        PositioningError
            It was not in time.
        """
        cell, report = self._module.cell, None
        try:
            async with asyncio.timeout(self._patience_s):
                while True:
                    _, report = await self._read_positioning()
                    if report.state == READY:
                        return report
                    await asyncio.sleep(_POLL_S)
        except TimeoutError:
            if report is None:
                fault = f"{cell}: the module has not been read for {self._patience_s:g} s"
            else:
                fault = (
                    f"{cell}: the module has not been ready for {self._patience_s:g} s, it is {report.state}"
                )
            raise PositioningError(fault) from None

    async def abort(self) -> None:
        """Abort what is being executed.

        Raises
        ------
        FieldbusError
            There is no connection, the module refuses, or the map has no `command_abort`.
        """
        await self._module.register_client.write_values({"command_abort": 1})

    def _check(self, command: TapCommand) -> None:
        cell = self._module.cell
        if not self.available:
            raise PositioningError(f"{cell}: map {self._module.registers.name} has no positioning registers")
        if not (math.isfinite(command.velocity_m_s) and command.velocity_m_s > 0.0):
            raise PositioningError(f"{cell}: tap velocity must be above 0, not {command.velocity_m_s} m/s")
        if not (math.isfinite(command.stroke_m) and command.stroke_m > 0.0):
            raise PositioningError(f"{cell}: tap stroke must be above 0, not {command.stroke_m} m")
        if command.direction not in (-1, 1):
            raise PositioningError(f"{cell}: tap direction must be 1 or -1, not {command.direction}")
        for name, value in command.parameters.items():
            register = self._module.registers[name]
            shown = register.decode(register.encode(value))
            if not (isinstance(shown, int | float) and math.isclose(shown, value, rel_tol=_ROUNDING)):
                raise PositioningError(
                    f"{cell}: register {name} ({register.address}) cannot express {value:g}, it would show "
                    f"{shown:g}; nothing has been commanded"
                )

    def _ask(self, objection: Objection, report: PositioningStatus, *, sent: bool = False) -> None:
        if why := objection(report):
            raise ObjectionError(f"{self._module.cell}: {why}; {_struck(sent)}", report, sent=sent)

    async def _read_positioning(self) -> tuple[int, PositioningStatus]:
        """Return session and a fresh report, waiting for the link if it is down."""
        while True:
            await self._module.wait_connected()
            try:
                report = await self._module.read_status()
            except FieldbusError as error:
                if not _may_pass(error):
                    raise
                await asyncio.sleep(_POLL_S)
                continue
            if report.positioning is None:
                raise PositioningError(f"{self._module.cell}: the map lacks registers of a positioning cell")
            return report.session, report.positioning

    async def _write_parameters(self, command: TapCommand) -> None:
        """Write the parameters and read them back."""
        registers, parameters = self._module.registers, command.parameters
        codes = {name: registers[name].encode(value) for name, value in parameters.items()}
        while True:
            await self._module.wait_connected()
            try:
                await self._module.register_client.write_values(parameters)
                for name, words in codes.items():
                    read_back = await self._module.register_client.read_words(name, 1)
                    if read_back.tobytes() != words.tobytes():
                        register = registers[name]
                        raise PositioningError(
                            f"{self._module.cell}: register {name} ({register.address}) does not show what "
                            "was written; nothing has been commanded"
                        )
            except FieldbusError as error:
                if not _may_pass(error):
                    raise PositioningError(
                        f"{self._module.cell}: {error}; nothing has been commanded"
                    ) from error
                await asyncio.sleep(_POLL_S)
            else:
                return

    @property
    def _accepted_now(self) -> int | None:
        """Number of the last command that the module has taken; None while the link is down."""
        status = self._module.status_block
        if status is None or status.positioning is None or not self._module.status.connected:
            return None
        return status.positioning.accepted_command

    async def _next_sequence(self, accepted: int) -> int:
        """Return the number of the next command, from what the registers show."""
        register, last = self._module.registers["command_sequence"], last_sequence(self._module.registers)
        while True:
            await self._module.wait_connected()
            try:
                written = integer(
                    register.decode(await self._module.register_client.read_words(register.name, 1))
                )
            except FieldbusError as error:
                if _may_pass(error) and not isinstance(error, NotDecimalError):
                    await asyncio.sleep(_POLL_S)
                    continue
                written = 0  # nobody can tell
            return next_sequence(accepted, written, last)

    async def _execute(
        self, session: int, sequence: int, accepted: int, objection: Objection
    ) -> PositioningStatus:
        """Write the sequence number until the module has it, and wait for the outcome.

        Where it takes another one than `accepted` meanwhile, that of an earlier command, nothing is written.
        """
        cell = self._module.cell
        sent = written = False
        while True:
            session_now, positioning = await self._read_positioning()
            if session_now != session:
                raise PositioningError(f"{cell}: module was started anew during tap {sequence}")
            if positioning.accepted_command == sequence:
                if positioning.result == DONE:
                    return positioning
                if positioning.result != EXECUTING:
                    raise PositioningError(f"{cell}: tap {sequence}: {positioning.result}")
            elif not written:
                if positioning.accepted_command != accepted:
                    raise PositioningError(
                        f"{cell}: register command_accepted ({self._accepted_at}) has changed from "
                        f"{accepted} to {positioning.accepted_command} before command {sequence} was "
                        "written: the module has taken an earlier one; the part may have been struck"
                    )
                self._ask(objection, positioning, sent=sent)
                try:
                    await self._module.register_client.write_values({"command_sequence": sequence})
                    written = True
                except FieldbusError as error:
                    if not _may_pass(error):
                        raise PositioningError(f"{cell}: {error}; {_struck(sent)}") from error
                    sent = True  # whether it arrived is seen in the next report
            await asyncio.sleep(_POLL_S)


def _struck(maybe: bool) -> str:  # noqa: FBT001
    return "the part may have been struck" if maybe else "nothing has been commanded"


def _may_pass(error: FieldbusError) -> bool:
    """Whether the same request may be answered a moment later: the link's doing, or a module in trouble."""
    if isinstance(error, ModbusExceptionError):
        return error.code not in _REFUSALS
    return isinstance(error, LinkError | ProtocolError)
