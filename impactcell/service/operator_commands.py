"""What people do, over OPC UA or on the page, applied to the cells and written into their audit trails."""

import json
import time
from collections.abc import Mapping

from impactcell import cell as core
from impactcell.alarms import AlarmEvent, EventKind
from impactcell.errors import PositioningError
from impactcell.journal.audit_entries import AuditEntry
from impactcell.scada import Actor, RefusedError
from impactcell.service.cell_task import CellTask


class OperatorCommands:
    """Implements `scada.Actions` for the running cells."""

    def __init__(self, cells: Mapping[str, CellTask]) -> None:
        self._cells = cells

    def running(self, cell: str) -> CellTask:
        """Give a cell that runs.

        Raises
        ------
        RefusedError
            It waits for its journal: what is done could not be written down.
        """
        if cell not in self._cells:
            raise RefusedError(
                "BadInvalidState",
                f"{cell}: does not run, its journal cannot be opened; its alarm JournalFault says why",
            )
        return self._cells[cell]

    async def start_batch(self, cell: str, batch_id: str, *, expected: bool, actor: Actor) -> None:
        """Begin another batch of material."""
        audit = _audit(actor, "StartBatch", BatchId=batch_id, Expected=expected)
        await self.running(cell).worker.change_state(
            lambda state: core.start_batch(state, batch_id, expected=expected), audit
        )

    async def reset_wear(self, cell: str, comment: str, actor: Actor) -> None:
        """Learn the wear level anew after worn parts were replaced."""
        audit = _audit(actor, "ResetWear", Comment=comment)
        await self.running(cell).worker.change_state(
            lambda state: core.reset_wear_level(state, audit.time_ns), audit
        )

    async def set_target(self, cell: str, target_m: float, actor: Actor) -> None:
        """Start a positioning task."""
        try:
            await self.running(cell).set_target(target_m, _audit(actor, "SetTarget", Target=target_m * 1e3))
        except PositioningError as error:
            raise RefusedError("BadInvalidState", str(error)) from error

    async def abort_positioning(self, cell: str, actor: Actor) -> None:
        """End the positioning task that runs."""
        try:
            await self.running(cell).abort_positioning(_audit(actor, "AbortPositioning"))
        except PositioningError as error:
            raise RefusedError("BadInvalidState", str(error)) from error

    async def record_model(self, cell: str, action: str, model: str, actor: Actor) -> None:
        """Write down that somebody has put another model into service."""
        await self.running(cell).worker.record(_audit(actor, f"model {action}", Model=model))

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
        """Apply an action through the life cycle in `impactcell.alarms`."""
        audit = _audit(actor, event.value, Condition=alarm, Comment=comment or None, Seconds=shelve_s or None)
        alarm_event = AlarmEvent(
            event,
            time_ns=audit.time_ns,
            user=actor.user,
            comment=comment,
            shelve_ns=int(shelve_s * 1e9),
            activation=activation,
        )
        transition = await self.running(cell).worker.apply_event(alarm, alarm_event, audit)
        if transition.refusal is not None:
            raise RefusedError(transition.refusal.value, f"{cell}: {alarm}: {transition.refusal.value}")


def _audit(actor: Actor, action: str, **arguments: object) -> AuditEntry:
    stated = {name: value for name, value in arguments.items() if value is not None}
    user = f"{actor.user} ({actor.role.name.lower()}) from {actor.address}"
    return AuditEntry(time.time_ns(), user, action, json.dumps(stated), "Good")
