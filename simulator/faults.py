"""Faults of a Modbus TCP peer, drawn with a seed: what the server does to a reply on demand.

Pure: an injector chooses a fault and `corrupt` changes a reply's bytes; the server acts on them.
"""

import enum
import math
import random
import struct
from collections import Counter
from dataclasses import dataclass, replace
from operator import index
from typing import Final


class FaultKind(enum.StrEnum):
    """What can go wrong with one reply.

    `joined` and `split` frames are legal and have to be understood; all others have to be noticed.
    """

    DELAY = "delay"
    JITTER = "jitter"
    DROP = "drop"
    HALF_OPEN = "half_open"
    RESET = "reset"
    LATE_REPLY = "late_reply"
    WRONG_TRANSACTION = "wrong_transaction"
    WRONG_LENGTH = "wrong_length"
    WRONG_FUNCTION = "wrong_function"
    WRONG_UNIT = "wrong_unit"
    WRONG_PROTOCOL = "wrong_protocol"
    DUPLICATE = "duplicate"
    TRUNCATED = "truncated"
    JOINED = "joined"
    SPLIT = "split"
    EXCEPTION = "exception"
    BUSY = "busy"


BUSY_CODE: Final = 6
"""Exception code of a device that asks to be asked again later."""


@dataclass(frozen=True, slots=True)
class Fault:
    """One kind of fault and how often it happens.

    Attributes
    ----------
    probability : float
        Of each reply.
    remaining : int or None
        How many times it still happens; None: until cleared.
    seconds : float
        Length of a delay, largest jitter, or how late a late reply is.
    code : int
        Exception code of `exception`.
    """

    kind: FaultKind
    probability: float = 1.0
    remaining: int | None = None
    seconds: float = 0.2
    code: int = 4

    def __post_init__(self) -> None:
        if not 0.0 <= self.probability <= 1.0:
            raise ValueError(f"fault {self.kind}: probability must be 0..1, not {self.probability}")
        if not 0.0 <= self.seconds < math.inf:
            raise ValueError(f"fault {self.kind}: seconds must be finite and not negative")
        if not 1 <= index(self.code) <= 255:
            raise ValueError(f"fault {self.kind}: code must be 1..255, not {self.code}")
        if self.remaining is not None and index(self.remaining) < 1:
            raise ValueError(f"fault {self.kind}: remaining must be at least 1, not {self.remaining}")


class FaultInjector:
    """Chooses which fault, if any, befalls the next reply.

    Attributes
    ----------
    happened : Counter
        How often each kind was chosen.
    """

    def __init__(self, seed: int = 0) -> None:
        self.random = random.Random(seed)  # noqa: S311 - reproducible, not secret
        self.happened: Counter[FaultKind] = Counter()
        self._faults: list[Fault] = []

    @property
    def active(self) -> bool:
        """Whether any fault is armed."""
        return bool(self._faults)

    def inject(self, fault: Fault) -> None:
        """Arm a fault beside those armed already."""
        self._faults.append(fault)

    def withdraw(self, fault: Fault) -> None:
        """Disarm this fault, and no other of its kind, if it is still armed."""
        self._faults = [armed for armed in self._faults if armed is not fault]

    def clear(self, kind: FaultKind | None = None) -> None:
        """Disarm all faults, or those of one kind."""
        self._faults = [] if kind is None else [fault for fault in self._faults if fault.kind != kind]

    def choose(self) -> Fault | None:
        """Return the fault that befalls this reply; the first armed one that is drawn."""
        for i, fault in enumerate(self._faults):
            if self.random.random() < fault.probability:
                self.happened[fault.kind] += 1
                if fault.remaining is not None:
                    remaining = fault.remaining - 1
                    self._faults[i : i + 1] = [replace(fault, remaining=remaining)] if remaining else []
                return fault
        return None


def corrupt(fault: Fault, reply: bytes, draw: random.Random) -> bytes:
    """Return the reply as a peer with this fault sends it; unchanged for faults of timing."""
    transaction, protocol, length, unit, function = struct.unpack_from(">HHHBB", reply)
    body = reply[8:]
    match fault.kind:
        case FaultKind.WRONG_TRANSACTION:
            transaction = (
                transaction + draw.choice((-1, 1, 0x100, 0x4000, draw.randrange(1, 0x10000)))
            ) & 0xFFFF
        case FaultKind.WRONG_PROTOCOL:
            protocol = draw.randrange(1, 0x10000)
        case FaultKind.WRONG_UNIT:
            unit = (unit + draw.randrange(1, 256)) & 0xFF
        case FaultKind.WRONG_FUNCTION:
            function = draw.choice([code for code in (1, 3, 4, 6, 16, 23) if code != function])
        case FaultKind.EXCEPTION:
            function, body, length = function | 0x80, bytes([fault.code]), 3
        case FaultKind.BUSY:
            function, body, length = function | 0x80, bytes([BUSY_CODE]), 3
        case FaultKind.WRONG_LENGTH:
            return _wrong_length(reply, draw)
        case FaultKind.TRUNCATED:
            return reply[: draw.randrange(1, len(reply))]
        case _:
            return reply
    return struct.pack(">HHHBB", transaction, protocol, length, unit, function) + body


def _wrong_length(reply: bytes, draw: random.Random) -> bytes:
    """Fewer or more registers than asked for, or a byte count or header length that does not fit."""
    header, pdu = reply[:4], reply[6:]
    match draw.randrange(4):
        case 0:  # consistent in itself, but too short
            pdu = pdu[:-2]
            if len(pdu) > 3:
                pdu = pdu[:2] + bytes([(pdu[2] - 2) & 0xFF]) + pdu[3:]
        case 1:  # consistent in itself, but too long
            pdu += bytes(2)
            pdu = pdu[:2] + bytes([(pdu[2] + 2) & 0xFF]) + pdu[3:]
        case 2:  # the byte count lies
            pdu = pdu[:2] + bytes([(pdu[2] + draw.choice((-2, -1, 1, 2))) & 0xFF]) + pdu[3:]
        case _:  # the header lies
            wrong = max(0, len(pdu) + draw.choice((-3, -1, 1, 400)))
            return header + struct.pack(">H", wrong) + pdu
    return header + struct.pack(">H", len(pdu)) + pdu
