"""The rights matrix, asked by NodeId as the OPC UA server asks."""

from asyncua import ua

from impactcell.opcua.host_interface import Permission, Role
from impactcell.scada.rights import Area, allowed


class CellAccess:
    """Implements `opcua.AccessPolicy`: finds the area a node lies in, and looks it up in the matrix."""

    def __init__(self) -> None:
        self._methods: dict[ua.NodeId, Area] = {}
        self._notifiers: set[ua.NodeId] = set()

    def add_method(self, method: ua.NodeId, area: Area) -> None:
        """Let a method lie in an area; methods of the types are added too."""
        self._methods[method] = area

    def add_notifiers(self, notifiers: frozenset[ua.NodeId]) -> None:
        """Let nodes be sources of events."""
        self._notifiers |= notifiers

    def permits(self, role: Role, permission: Permission, node: ua.NodeId) -> bool:
        """Whether a role has a permission on a node; a method nobody has added is nobody's to call."""
        area = self._area(permission, node)
        return area is not None and allowed(role, area, permission)

    def _area(self, permission: Permission, node: ua.NodeId) -> Area | None:
        if permission is Permission.CALL:
            return self._methods.get(node)
        if permission in (Permission.SUBSCRIBE, Permission.READ_HISTORY):
            return Area.EVENTS if node in self._notifiers else Area.VALUES
        return Area.NODES
