"""What the OPC UA server of this product is told: its cells, and what it asks of the rest of the service."""

import socket
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from impactcell.alarms import EventKind
from impactcell.opcua.host_interface import Actor, HistoryRequest
from impactcell.records import Alarm, Quality
from impactcell.records.quantity import Ranges


def default_application_uri() -> str:
    """Application URI of this machine's server; the certificate must carry the same."""
    return f"urn:{socket.gethostname()}:impactcell"


@dataclass(frozen=True, slots=True)
class Machine:
    """Nameplate of a machine after OPC 40001-1; None leaves a node out."""

    manufacturer: str
    serial_number: str
    product_instance_uri: str
    model: str | None = None
    manufacturer_uri: str | None = None
    product_code: str | None = None
    hardware_revision: str | None = None
    software_revision: str | None = None
    device_class: str | None = None
    asset_id: str | None = None
    component_name: str | None = None
    location: str | None = None
    year_of_construction: int | None = None
    month_of_construction: int | None = None


@dataclass(frozen=True, slots=True)
class CellDescription:
    """One cell as the server shows it; `name` is its browse name and the root of its NodeIds."""

    name: str
    machine: Machine
    ranges: Ranges = field(default_factory=Ranges)


@dataclass(frozen=True, slots=True)
class ConditionAction:
    """What a person does with a condition from elsewhere than an OPC UA client.

    Attributes
    ----------
    event : EventKind
    event_id : bytes
        Of the state that the person saw; needed to acknowledge, to confirm and to comment.
    comment : str
    shelve_s : float
        How long to shelve, for `SHELVE_TIMED`.
    """

    event: EventKind
    event_id: bytes = b""
    comment: str = ""
    shelve_s: float = 0.0


class Actions(Protocol):
    """The service, as OPC UA methods reach it. Every call may raise `RefusedError`."""

    async def start_batch(self, cell: str, batch_id: str, *, expected: bool, actor: Actor) -> None:
        """Begin another batch of material."""

    async def reset_wear(self, cell: str, comment: str, actor: Actor) -> None:
        """Learn the wear level anew after worn parts were replaced."""

    async def set_target(self, cell: str, target_m: float, actor: Actor) -> None:
        """Start a positioning task."""

    async def abort_positioning(self, cell: str, actor: Actor) -> None:
        """End the positioning task that runs."""

    async def act_on_condition(
        self,
        cell: str,
        alarm: str,
        event: EventKind,
        actor: Actor,
        *,
        comment: str = "",
        shelve_s: float = 0.0,
        activation: int | None = None,
    ) -> None:
        """Apply a person's action through `impactcell.alarms.apply_event`.

        The action is one of acknowledge, confirm, comment, enable, disable and the three of shelving; the
        first three name the activation that they answer. A `Transition` that carries a refusal is raised as
        `RefusedError(refusal.value)`. The new state is shown by `Server.alarm`, before this returns: whoever
        changes conditions shows them, in the order of the changes.
        """


@dataclass(frozen=True, slots=True)
class HistoryValue:
    """One stored value of a variable, in the unit of its node."""

    time_ns: int
    value: float
    quality: Quality = Quality.GOOD


@dataclass(frozen=True, slots=True)
class ValuePage:
    """Part of a history; `resume` is handed back to read on, None where nothing is left."""

    values: Sequence[HistoryValue]
    resume: bytes | None = None


@dataclass(frozen=True, slots=True)
class AlarmPage:
    """Part of the history of alarms, as the states that each transition led to."""

    alarms: Sequence[Alarm]
    resume: bytes | None = None


class HistorySource(Protocol):
    """Where the past of the cells is kept. Every call may raise `RefusedError`."""

    async def values(self, cell: str, variable: str, request: HistoryRequest) -> ValuePage:
        """Read stored values of a variable, named by its path, as `Friction/StaticFriction`."""

    async def alarms(self, cell: str, request: HistoryRequest) -> AlarmPage:
        """Read transitions of the conditions of a cell."""
