"""What a published quantity is: name, unit, type, and where it is read off."""

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from impactcell.records.capture import Samples
from impactcell.records.friction import Quality
from impactcell.records.module import ModuleStatus
from impactcell.records.snapshot import Snapshot

S = TypeVar("S", Snapshot, ModuleStatus)
Value = float | int | str | bool | list[float]
Range = tuple[float, float]


class DataType(enum.Enum):
    """Type of a value, by its OPC UA name."""

    DOUBLE = "Double"
    UINT32 = "UInt32"
    STRING = "String"
    BOOLEAN = "Boolean"


@dataclass(frozen=True, slots=True)
class Unit:
    """Unit of a node: common code of UNECE recommendation 20, symbol, name, and its number in one SI unit."""

    code: str
    symbol: str
    name: str
    per_si: float = 1.0


@dataclass(frozen=True, slots=True)
class Ranges:
    """Ranges the values of a cell are expected in, SI units: EURange, and the bounds of `SetTarget`."""

    friction: float = 1.0
    force_n: float = 500.0
    velocity_m_s: float = 0.2
    sliding_distance_m: float = 0.01
    stroke_m: float = 0.1
    target_m: tuple[float, float] = (-1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Quantity(Generic[S]):
    """One published quantity.

    Attributes
    ----------
    path : str
        Folder and browse name, as `Wear/Level`.
    title : tuple of str
        What people call it, in English and in German.
    number : int
        Identifier of its variable in the NodeSet2 file; those of EURange and EngineeringUnits follow it.
    value : callable
        Reads it, in SI, off a snapshot or off the state of the module's link.
    quality : callable or None
        Its quality; None where it is Good unless it is nan.
    unit : Unit or None
        None for what is not measured: counts, names, flags.
    eu_range : callable or None
        Expected range in SI, from those of the cell; None without a unit.
    column, quality_column : str or None
        Columns of the journal that hold it; None where it is not kept.
    has_history : bool
        Whether clients can read its past; it has both columns then, and is a Double.
    """

    path: str
    number: int
    description: str
    title: tuple[str, str]
    value: Callable[[S], Value | Samples]
    quality: Callable[[S], Quality] | None = None
    unit: Unit | None = None
    eu_range: Callable[[Ranges], Range] | None = None
    data_type: DataType = DataType.DOUBLE
    is_array: bool = False
    column: str | None = None
    quality_column: str | None = None
    has_history: bool = False

    def read(self, source: S) -> tuple[Value, Quality]:
        """Read value, in the unit of the node, and quality."""
        value = self.value(source)
        if isinstance(value, np.ndarray):
            value = (value * self.per_si).tolist()
        elif isinstance(value, float):
            value *= self.per_si
        if self.quality is not None:
            return value, self.quality(source)
        is_missing = isinstance(value, float) and math.isnan(value)
        return value, Quality.BAD if is_missing else Quality.GOOD

    @property
    def per_si(self) -> float:
        """Number of the node's unit in one SI unit."""
        return 1.0 if self.unit is None else self.unit.per_si

    def node_range(self, ranges: Ranges) -> Range | None:
        """Give the expected range in the unit of the node."""
        if self.eu_range is None:
            return None
        low, high = self.eu_range(ranges)
        return low * self.per_si, high * self.per_si
