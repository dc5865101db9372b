"""From a snapshot to the nodes of a cell."""

import math
from datetime import UTC, datetime
from typing import Final

from asyncua import ua

from impactcell.opcua.address_space.node_references import read_attribute
from impactcell.opcua.address_space.variable_store import GOOD, StoredVariable, VariableStore, moment
from impactcell.quantities import BY_PATH, CYCLE, MODULE, POSITIONING
from impactcell.records import ModuleStatus, Quality, Snapshot
from impactcell.records.quantity import Quantity, Value
from impactcell.scada.cell_nodes import CellSpace

BAD: Final = ua.StatusCode(ua.StatusCodes.Bad)
NO_COMMUNICATION: Final = ua.StatusCode(ua.StatusCodes.BadNoCommunication)
LAST_USABLE: Final = ua.StatusCode(ua.StatusCodes.UncertainNoCommunicationLastUsableValue)
WAITING: Final = ua.StatusCode(ua.StatusCodes.BadWaitingForInitialData)
STATUS: Final = {
    Quality.GOOD: GOOD,
    Quality.UNCERTAIN: ua.StatusCode(ua.StatusCodes.Uncertain),
    Quality.BAD: BAD,
}
"""Status code of each quality."""

_EMPTY: Final[dict[ua.VariantType, object]] = {
    ua.VariantType.Double: math.nan,
    ua.VariantType.UInt32: 0,
    ua.VariantType.String: "",
    ua.VariantType.Boolean: False,
}
"""What a variable holds of each type before it has a value."""


class CellValues:
    """Writes the variables of one cell.

    Each cycle writes each variable with the time of the cycle. A subscriber hears of it only where value
    or status have changed, unless it asks for changes of the timestamp as well.
    """

    def __init__(self, cell: CellSpace, values: VariableStore, space: object, now: datetime) -> None:
        self._variables: dict[str, tuple[StoredVariable, ua.VariantType, bool]] = {}
        self._seen: set[str] = set()
        self._given: set[str] = set()
        for path in (*(q.path for q in CYCLE), *(q.path for q in MODULE)):
            node = cell.path(path)
            kind = ua.VariantType(read_attribute(space, node, ua.AttributeIds.DataType).Identifier)
            is_array = read_attribute(space, node, ua.AttributeIds.ValueRank) == 1
            variable = values.variable(node)
            self._variables[path] = variable, kind, is_array
            empty = [] if is_array else _EMPTY[kind]
            variable.write(ua.DataValue(ua.Variant(empty, kind, None, is_array), WAITING, now, now))

    def publish(self, snapshot: Snapshot) -> None:
        """Write all that one cycle has to say."""
        self._publish(CYCLE, snapshot, snapshot.time_ns)

    def positioning(self, snapshot: Snapshot, time_ns: int) -> None:
        """Write the positioning task as it is between cycles; all else stays as it is, bad and stale too."""
        self._publish(POSITIONING, snapshot, time_ns)

    def _publish(self, quantities: tuple[Quantity[Snapshot], ...], snapshot: Snapshot, time_ns: int) -> None:
        time, now = moment(time_ns), datetime.now(UTC)
        for quantity in quantities:
            value, quality = quantity.read(snapshot)
            self._write(quantity.path, value, quality, time, now)

    def module(self, state: ModuleStatus, time_ns: int) -> None:
        """Write the state of the link; what it does not give while it is lost has no communication."""
        time, now = moment(time_ns), datetime.now(UTC)
        missing = BAD if state.connected else NO_COMMUNICATION
        for quantity in MODULE:
            value, quality = quantity.read(state)
            self._write(quantity.path, value, quality, time, now, missing)

    def lost(self, time_ns: int) -> None:
        """No communication: every figure of a cycle becomes Bad and keeps its last value."""
        self._restate(time_ns, given=NO_COMMUNICATION, missing=NO_COMMUNICATION)

    def stale(self, time_ns: int) -> None:
        """Nothing new for a while: every figure of the last cycle becomes Uncertain and keeps its value.

        One that the last cycle did not give stays Bad: time makes no figure of an earlier cycle its own.
        """
        self._restate(time_ns, given=LAST_USABLE, missing=BAD)

    def _restate(self, time_ns: int, *, given: ua.StatusCode, missing: ua.StatusCode) -> None:
        time = moment(time_ns)
        for path in self._seen & BY_PATH.keys():
            self._variables[path][0].set_status(given if path in self._given else missing, time)

    def _write(
        self,
        path: str,
        value: Value,
        quality: Quality,
        time: datetime,
        now: datetime,
        missing: ua.StatusCode = BAD,
    ) -> None:
        variable, kind, is_array = self._variables[path]
        if quality is Quality.BAD or (isinstance(value, float) and math.isnan(value)):
            # A Bad value is the last one that could be believed; there is none before the first.
            self._given.discard(path)
            status = missing if path in self._seen else WAITING
            variable.write(ua.DataValue(variable.data.Value, status, time, now))
            return
        self._seen.add(path)
        self._given.add(path)
        variable.write(ua.DataValue(ua.Variant(value, kind, None, is_array), STATUS[quality], time, now))
