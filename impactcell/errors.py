"""What impactcell raises on purpose for who calls or runs it: one tree.

::

    ImpactCellError
    ├── SettingsError             a cell, map, model or scenario file: file:line:column
    ├── CampaignError             a campaign directory: file, line and the way out
    ├── MeasurementError          a measurement file: file, line or column
    ├── EffectError               an effect of the user's own: file and the way out
    ├── SeriesError               a series for `impactcell track`: file and line
    ├── PhysicsError              the plant model cannot answer
    │   ├── NoBreakawayError      the part never moved
    │   ├── NoSeparationError     the part never left the actuator
    │   └── NoStopError           it was still moving at the end of the allowed time
    ├── PredictionError           a capture cannot be turned into a coefficient
    │   ├── CaptureError          empty, constant, not finite or without a contact
    │   ├── ClippedForceError     the force channel is saturated where it is needed
    │   ├── NegativeRootError     equation (5) has no real root at this distance
    │   └── NotConvergedError     the waveform fit did not reach a minimum
    ├── PositioningError          target or command refused; nothing has been commanded
    │   └── RasterError           values that can be commanded which are none
    ├── DiscrepancyError          the workflow cannot give an answer from these data
    ├── FieldbusError
    │   ├── MapError              a map that overlaps itself or leaves the registers
    │   ├── WrongDeviceError      identity or map version is not what the cell file says
    │   ├── LinkError             not connected, lost, or no answer in time (retry)
    │   │   ├── NoAnswerError         ... the connection stands, the device is silent
    │   │   └── ConnectionLostError   ... the peer has closed it
    │   ├── ProtocolError         the peer broke the protocol; nothing used (retry)
    │   │   └── NotDecimalError   a decimal code with a digit above 9
    │   └── ModbusExceptionError  the peer refused a request, with its code (retry)
    ├── JournalError
    │   ├── ForeignJournalError   not ours, or of another version; never overwritten
    │   ├── UnstoredError         the service ended with entries that no journal took
    │   ├── JournalDamagedError   not what was written (retry: it is put aside)
    │   ├── JournalGoneError      the file was removed or replaced in use (retry)
    │   └── JournalUnavailableError  the file cannot be opened or written now (retry)
    │       └── JournalFullError     ... for the disk, or a quota, is full    (retry)
    └── AccessError               users, certificates and rights of the OPC UA server

`retry` says whether doing the same again can help. A message names the cell, the thing and the way out.

Outside the tree stands what an edge answers to its peer, and what ends in the room it belongs to: in
`impactcell.opcua` StatusCodeError, DecodingError, RefusedError, InvalidArgumentError, SecureChannelError and
UntrustedError; in `impactcell.web` RequestRefusedError and StudyFailedError. ObjectionError of
`impactcell.fieldbus` tells a task that its own objection has kept a tap from being commanded.
"""

import math
from collections.abc import Sequence
from typing import ClassVar


class ImpactCellError(Exception):
    """Root of the tree; `retry` is True where doing the same again can help."""

    retry: ClassVar[bool] = False


class SettingsError(ImpactCellError):
    """A YAML file that cannot be used; the message lists every fault as `file:line:column: text`."""


class CampaignError(ImpactCellError):
    """A campaign directory that cannot be read; the message names file and line."""


class MeasurementError(ImpactCellError):
    """A measurement file that cannot be imported; the message names file, line or column and the way out."""


class EffectError(ImpactCellError):
    """An effect of the user's own that cannot be used; the message names file and what it breaks."""


class SeriesError(ImpactCellError):
    """A friction series that cannot be read; the message names file and line."""


class PhysicsError(ImpactCellError):
    """The plant model has no answer for these parameters."""


class NoBreakawayError(PhysicsError):
    """Static friction held the part for the whole stroke."""


class NoSeparationError(PhysicsError):
    """The part never left the actuator within the allowed time."""


class NoStopError(PhysicsError):
    """The part was still moving at the end of the allowed time."""


class PredictionError(ImpactCellError):
    """A capture that cannot be turned into a friction coefficient."""


class CaptureError(PredictionError):
    """A capture that is empty, constant, not finite, or shows no contact."""


class ClippedForceError(PredictionError):
    """The force channel is saturated where the estimate needs it."""


class NegativeRootError(PredictionError):
    """Equation (5) has no real root: the part slid less than the calibration allows at this velocity."""


class NotConvergedError(PredictionError):
    """The waveform fit did not reach a minimum.

    Attributes
    ----------
    gap : float
        RMS of the residuals over the sensors' noise where the fit came to a halt; nan if it never began.
    """

    def __init__(self, message: str, gap: float = math.nan) -> None:
        super().__init__(message)
        self.gap = gap


class PositioningError(ImpactCellError):
    """A target or command that is refused; nothing has been commanded."""


class RasterError(PositioningError):
    """Values that can be commanded, of which there are none: no step, or an end before the beginning."""


class DiscrepancyError(ImpactCellError):
    """The discrepancy workflow cannot give an answer from these data."""


class FieldbusError(ImpactCellError):
    """The module, its map or the link to it."""


class MapError(FieldbusError):
    """A register map that overlaps itself, leaves the register space or lacks a needed register.

    Attributes
    ----------
    faults : tuple of str
        All that is wrong with it, one after another.
    """

    def __init__(self, message: str, faults: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.faults = tuple(faults) or (message,)


class WrongDeviceError(FieldbusError):
    """The module answers, but its identity or map version is not what the cell file says."""


class LinkError(FieldbusError):
    """Not connected, connection lost, or no answer in time."""

    retry: ClassVar[bool] = True


class NoAnswerError(LinkError):
    """The connection stood, and the device did not answer in time."""


class ConnectionLostError(LinkError):
    """The peer closed the connection."""


class ProtocolError(FieldbusError):
    """The peer broke the protocol; nothing of its reply has been used."""

    retry: ClassVar[bool] = True


class NotDecimalError(ProtocolError):
    """A register of binary coded decimals shows a digit above 9, so that it says no number."""


class ModbusExceptionError(FieldbusError):
    """The peer refused a request.

    Asking again can help whatever the code: a device that was busy has been asked again already until the
    link's timeout, and one that starts, or is being configured, refuses addresses that it has later.

    Attributes
    ----------
    code : int
        Modbus exception code (MODBUS Application Protocol V1.1b3, section 7).
    """

    retry: ClassVar[bool] = True

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class JournalError(ImpactCellError):
    """The durable store of a cell."""


class ForeignJournalError(JournalError):
    """A file that is not this cell's journal, or of another format version; it is never overwritten."""


class UnstoredError(JournalError):
    """The service ended with entries that its journals could not take."""


class JournalDamagedError(JournalError):
    """What is stored is not what was written; the message names the file, and the cycle where it is one's.

    The file as it is never can be used again; the service puts it aside and begins another with its state.
    """

    retry: ClassVar[bool] = True


class JournalGoneError(JournalError):
    """The journal's file was removed or replaced while it was in use; what is written goes nowhere."""

    retry: ClassVar[bool] = True


class JournalUnavailableError(JournalError):
    """The file cannot be opened or written now: its disk, directory, owner, or another program is why."""

    retry: ClassVar[bool] = True


class JournalFullError(JournalUnavailableError):
    """The disk or its quota is full."""


class AccessError(ImpactCellError):
    """Users, certificates or rights of the OPC UA server."""
