"""The address space: types and units from the NodeSet2 files, one object per cell made from them."""

from collections.abc import Callable
from dataclasses import fields
from importlib.resources import as_file, files
from typing import Final

from asyncua import ua

from impactcell.alarms import RULES
from impactcell.errors import SettingsError
from impactcell.opcua.address_space.node_references import (
    HAS_TYPE_DEFINITION,
    link,
    read_attribute,
    set_attribute,
    targets,
)
from impactcell.opcua.address_space.type_instances import instantiate
from impactcell.opcua.asyncua_adapter import AddressSpace, StandardServer, address_space, compute_attribute
from impactcell.opcua.languages import TranslatedText
from impactcell.quantities import CYCLE, HISTORY
from impactcell.scada.interface import CellDescription, Machine
from impactcell.scada.standard_descriptions import DESCRIPTIONS

TYPES_URI: Final = "urn:impactcell:ua"
CELLS_URI: Final = "urn:impactcell:cells"
MACHINERY_URI: Final = "http://opcfoundation.org/UA/Machinery/"
NODESETS: Final = ("Di.Subset", "Machinery.Subset", "ImpactCell")

_CONDITION_OPTIONS: Final = frozenset(
    {
        "ConfirmedState",
        "Confirm",
        "SuppressedState",
        "OutOfServiceState",
        "ShelvingState",
        "MaxTimeShelved",
        "EnabledState/TransitionTime",
        "EnabledState/EffectiveDisplayName",
        "ActiveState/TransitionTime",
    }
)
_IDENTIFICATION: Final = {
    "".join(part.capitalize() for part in f.name.split("_")): f.name for f in fields(Machine)
}


async def load_types(server: StandardServer) -> None:
    """Load the shipped NodeSet2 files into an asyncua server and name the namespace of the cells."""
    for name in NODESETS:
        with as_file(files("impactcell.scada") / "model" / f"{name}.NodeSet2.xml") as path:
            await server.import_xml(str(path))
    await server.register_namespace(CELLS_URI)


class CellSpace:
    """The nodes of one cell.

    Attributes
    ----------
    node : NodeId
        The cell itself, source and notifier of its events.
    cell_type : NodeId
        Its type.
    folder : NodeId
        The folder that holds all cells.
    """

    def __init__(self, server: StandardServer, uris: list[str], description: CellDescription) -> None:
        if not description.name or "/" in description.name:
            raise SettingsError(
                f"cell {description.name!r}: a name is not empty and has no '/', it is part of NodeIds"
            )
        self.description = description
        self._space = address_space(server)
        self._cells_namespace = uris.index(CELLS_URI)
        self._types_namespace = uris.index(TYPES_URI)
        self.node = ua.NodeId(description.name, self._cells_namespace)
        if self.node in self._space:
            raise SettingsError(f"cell {description.name!r} is there twice")
        self.cell_type = self._child(
            ua.NodeId(ua.ObjectIds.BaseObjectType), "ImpactCellType", ua.ObjectIds.HasSubtype
        )
        self.folder = self._child(
            ua.NodeId(ua.ObjectIds.ObjectsFolder), "ImpactCells", ua.ObjectIds.Organizes
        )
        instantiate(
            self._space,
            self.cell_type,
            self.node,
            ua.QualifiedName(description.name, self._cells_namespace),
            f"Cell {description.name}.",
            DESCRIPTIONS,
            self._is_wanted,
        )
        named = TranslatedText(f"Cell {description.name}.", de=f"Zelle {description.name}.")
        set_attribute(
            self._space, self.node, ua.AttributeIds.Description, named, ua.VariantType.LocalizedText
        )
        notifies = ua.EventNotifier.SubscribeToEvents.mask | ua.EventNotifier.HistoryRead.mask
        set_attribute(self._space, self.node, ua.AttributeIds.EventNotifier, notifies, ua.VariantType.Byte)
        link(self._space, self.folder, ua.NodeId(ua.ObjectIds.Organizes), self.node)
        link(self._space, self.folder, ua.NodeId(ua.ObjectIds.HasNotifier), self.node)
        machines = ua.NodeId(1001, uris.index(MACHINERY_URI))  # the folder Machines of OPC 40001-1
        link(self._space, machines, ua.NodeId(ua.ObjectIds.Organizes), self.node)
        for alarm in RULES:
            link(self._space, self.node, ua.NodeId(ua.ObjectIds.HasCondition), self.path(alarm))
        self._identify(description.machine)
        self._set_ranges()
        self._set_history()

    def path(self, path: str) -> ua.NodeId:
        """NodeId of a node of the cell by its path, as `Wear/Level`."""
        return ua.NodeId(f"{self.description.name}/{path}", self._cells_namespace)

    def compute(self, path: str, value: Callable[[], ua.DataValue]) -> None:
        """Let a variable be computed whenever it is read."""
        compute_attribute(self._space, self.path(path), ua.AttributeIds.Value, value)

    def alarm_type(self, alarm: str) -> ua.NodeId:
        """Event type of a condition."""
        return targets(self._space[self.path(alarm)], HAS_TYPE_DEFINITION)[0]

    def _child(self, parent: ua.NodeId, name: str, reference_type: int) -> ua.NodeId:
        """Node that is referred to from `parent`, by its name in the namespace of the types."""
        browse_name = ua.QualifiedName(name, self._types_namespace)
        for reference in self._space[parent].references:
            if reference.ReferenceTypeId == ua.NodeId(reference_type) and reference.BrowseName == browse_name:
                return reference.NodeId
        raise LookupError(
            f"ImpactCell.NodeSet2.xml has no {name}; write it anew with `python -m impactcell.scada.nodeset`"
        )

    def _is_wanted(self, path: str) -> bool:
        """Whether the cell has an optional node: what is known of its machine, some of each condition."""
        head, _, rest = path.partition("/")
        if head == "Identification":
            field = _IDENTIFICATION.get(rest)
            return field is not None and getattr(self.description.machine, field) is not None
        return rest in _CONDITION_OPTIONS and head in RULES

    def _identify(self, machine: Machine) -> None:
        for name, field in _IDENTIFICATION.items():
            value = getattr(machine, field)
            if value is None:
                continue
            node = self.path(f"Identification/{name}")
            variant_type = ua.VariantType(
                read_attribute(self._space, node, ua.AttributeIds.DataType).Identifier
            )
            if variant_type is ua.VariantType.LocalizedText:
                value = ua.LocalizedText(value)
            set_attribute(self._space, node, ua.AttributeIds.Value, value, variant_type)

    def _set_ranges(self) -> None:
        for quantity in CYCLE:
            eu_range = quantity.node_range(self.description.ranges)
            if eu_range is not None:
                set_attribute(
                    self._space,
                    self.path(f"{quantity.path}/EURange"),
                    ua.AttributeIds.Value,
                    ua.Range(*eu_range),
                    ua.VariantType.ExtensionObject,
                )

    def _set_history(self) -> None:
        for path in HISTORY:
            node = self.path(path)
            set_attribute(
                self._space,
                node,
                ua.AttributeIds.Historizing,
                value=True,
                variant_type=ua.VariantType.Boolean,
            )
            settings = self.path(f"{path}/HA Configuration")
            instantiate(
                self._space,
                ua.NodeId(ua.ObjectIds.HistoricalDataConfigurationType),
                settings,
                ua.QualifiedName("HA Configuration", 0),
                "How the history of this variable is kept and aggregated.",
                DESCRIPTIONS,
            )
            link(self._space, node, ua.NodeId(ua.ObjectIds.HasHistoricalConfiguration), settings)
            defaults: tuple[tuple[str, object, ua.VariantType], ...] = (
                ("Stepped", True, ua.VariantType.Boolean),
                ("AggregateConfiguration/TreatUncertainAsBad", True, ua.VariantType.Boolean),
                ("AggregateConfiguration/PercentDataBad", 100, ua.VariantType.Byte),
                ("AggregateConfiguration/PercentDataGood", 100, ua.VariantType.Byte),
                ("AggregateConfiguration/UseSlopedExtrapolation", False, ua.VariantType.Boolean),
            )
            for name, value, variant_type in defaults:
                property_node = ua.NodeId(f"{settings.Identifier}/{name}", settings.NamespaceIndex)
                set_attribute(self._space, property_node, ua.AttributeIds.Value, value, variant_type)


def cell_notifiers(cell: CellSpace) -> frozenset[ua.NodeId]:
    """Nodes that report the events of a cell: itself, the folder of the cells, the server."""
    return frozenset({cell.node, cell.folder, ua.NodeId(ua.ObjectIds.Server)})


def method_declarations(space: AddressSpace, type_node: ua.NodeId) -> dict[str, ua.NodeId]:
    """Methods of a type, by name."""
    return {
        reference.BrowseName.Name: reference.NodeId
        for reference in space[type_node].references
        if reference.IsForward and reference.NodeClass == ua.NodeClass.Method
    }
