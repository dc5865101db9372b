"""Reads `campaign.yaml`: format, excitation, gravity, actuator and sensors, with the line of each fault."""

import math
from dataclasses import dataclass
from pathlib import Path

import yaml

from impactcell.campaign.contents import CHANNELS, COLUMNS, Coordinate, Excitation, Sensor
from impactcell.campaign.faults import LARGEST, Faults, read_text
from impactcell.records.plausible_range import GRAVITY, STROKE_M

FORMAT = 1
"""Version of the campaign directory."""
SUMMED_UP = "summed_up_from_speed"
"""Key of a position that is the sum of a recorded speed."""


@dataclass(frozen=True, slots=True)
class Header:
    """Content of `campaign.yaml`."""

    excitation: Excitation
    gravity_m_s2: float
    stroke_m: float
    sensors: dict[str, Sensor]
    coordinate: Coordinate = Coordinate.TRANSLATION


def read_header(file: Path, faults: Faults) -> Header | None:
    """Read `campaign.yaml`; None after noting every fault of it."""
    text = read_text(file, faults, f"write format: {FORMAT}, excitation and sensors into it")
    if text is None:
        return None
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = None if mark is None else mark.line + 1
        faults.add(file, line, f"is not YAML: {getattr(error, 'problem', None) or error}")
        return None
    except RecursionError:
        faults.add(file, None, "is nested too deeply")
        return None
    noted = len(faults)
    reader = _Reader(file, faults)
    top = reader.mapping(
        root, "campaign.yaml", {"format", "excitation", "coordinate", "gravity_m_s2", "actuator", "sensors"}
    )
    if top is None:
        return None
    _check_format(reader, top)
    excitation = _excitation(reader, top)
    gravity = reader.number(top.get("gravity_m_s2"), "gravity_m_s2", 9.81, positive=True)
    actuator = reader.mapping(top.get("actuator"), "actuator", {"stroke_m"}) or {}
    stroke = reader.number(
        actuator.get("stroke_m"), "actuator.stroke_m", math.inf, positive=True, finite=False
    )
    if excitation is Excitation.TAP and stroke is not None and (doubt := STROKE_M.doubt(stroke)):
        reader.fault(actuator["stroke_m"], f"actuator.stroke_m: {doubt}")
    if excitation is not Excitation.DRIVEN and gravity is not None and (doubt := GRAVITY.doubt(gravity)):
        reader.fault(top["gravity_m_s2"], f"gravity_m_s2: {doubt}")
    coordinate = _coordinate(reader, top, excitation)
    sensors = _sensors(reader, top, coordinate)
    if len(faults) > noted or excitation is None or gravity is None or stroke is None:
        return None
    return Header(excitation, gravity, stroke, sensors, coordinate)


def _check_format(reader: "_Reader", top: dict[str, yaml.Node]) -> None:
    node = top.get("format")
    if node is None:
        reader.fault(None, f"format is missing; write format: {FORMAT}")
    elif not isinstance(node, yaml.ScalarNode) or node.value != str(FORMAT):
        shown = node.value if isinstance(node, yaml.ScalarNode) else "a block"
        reader.fault(node, f"format {shown} is not known; this version reads format {FORMAT}")


def _excitation(reader: "_Reader", top: dict[str, yaml.Node]) -> Excitation | None:
    node = top.get("excitation")
    choices = ", ".join(Excitation)
    if node is None:
        reader.fault(None, f"excitation is missing; write one of {choices}")
        return None
    value = node.value if isinstance(node, yaml.ScalarNode) else None
    if value not in set(Excitation):
        reader.fault(node, f"excitation {value!r} is not known; write one of {choices}")
        return None
    return Excitation(value)


def _coordinate(reader: "_Reader", top: dict[str, yaml.Node], excitation: Excitation | None) -> Coordinate:
    node = top.get("coordinate")
    if node is None:
        return Coordinate.TRANSLATION
    value = node.value if isinstance(node, yaml.ScalarNode) else None
    if value not in set(Coordinate):
        reader.fault(node, f"coordinate {value!r} is not known; write one of {', '.join(Coordinate)}")
        return Coordinate.TRANSLATION
    coordinate = Coordinate(value)
    if coordinate is Coordinate.ROTATION and excitation is Excitation.TAP:
        reader.fault(node, "a tap goes along a line; what rotates is driven or free_slide")
    return coordinate


def _sensors(reader: "_Reader", top: dict[str, yaml.Node], coordinate: Coordinate) -> dict[str, Sensor]:
    sensors = {}
    nodes = reader.mapping(top.get("sensors"), "sensors", set(CHANNELS)) or {}
    for name, node in nodes.items():
        noise_key, of_speed = (COLUMNS[coordinate][f"{one}_noise"] for one in (name, "speed"))
        known = {"rate_hz", noise_key} | ({SUMMED_UP, of_speed} if name == "position" else set())
        keys = reader.mapping(node, f"sensors.{name}", known) or {}
        rate, noise, speed_noise = (
            reader.number(keys.get(key), f"sensors.{name}.{key}", None, positive=True)
            for key in ("rate_hz", noise_key, of_speed)
        )
        summed_up = reader.flag(keys.get(SUMMED_UP), f"sensors.{name}.{SUMMED_UP}")
        if summed_up and noise is not None:
            reader.fault(
                keys[noise_key],
                f"sensors.{name}.{noise_key}: noise of a speed adds up in the position; write the speed's, "
                f"{of_speed}",
            )
        if speed_noise is not None and not summed_up:
            reader.fault(
                keys[of_speed],
                f"sensors.{name}.{of_speed} is of a speed that was summed up; write {SUMMED_UP}: true "
                f"beside it, or {noise_key}",
            )
        sensors[name] = Sensor(rate, noise, summed_up, speed_noise)
    return sensors


class _Reader:
    def __init__(self, file: Path, faults: Faults) -> None:
        self._file = file
        self._faults = faults

    def fault(self, node: yaml.Node | None, message: str) -> None:
        self._faults.add(self._file, None if node is None else node.start_mark.line + 1, message)

    def mapping(self, node: yaml.Node | None, name: str, known: set[str]) -> dict[str, yaml.Node] | None:
        if node is None and name != "campaign.yaml":
            return {}
        if node is not None and _is_null(node) and name != "campaign.yaml":
            return {}
        if not isinstance(node, yaml.MappingNode):
            self.fault(node, f"{name} has to be a block of `key: value`")
            return None
        nodes: dict[str, yaml.Node] = {}
        for key, value in node.value:
            text = key.value if isinstance(key, yaml.ScalarNode) else "?"
            if text not in known:
                self.fault(key, f"unknown key {text!r} in {name}; known: {', '.join(sorted(known))}")
            elif text in nodes:
                self.fault(key, f"{text!r} appears twice in {name}; keep one")
            else:
                nodes[text] = value
        return nodes

    def flag(self, node: yaml.Node | None, name: str) -> bool:
        """Value of a scalar that is true or false; false where there is none."""
        if node is None or _is_null(node):
            return False
        value = node.value if isinstance(node, yaml.ScalarNode) else "a block"
        if value not in ("true", "false"):
            self.fault(node, f"{name} is {value!r}; it has to be true or false")
        return bool(value == "true")

    def number(
        self,
        node: yaml.Node | None,
        name: str,
        default: float | None,
        *,
        positive: bool,
        finite: bool = True,
    ) -> float | None:
        """Value of a scalar; YAML 1.1 takes `1e-6` for text, this does not."""
        if node is None or _is_null(node):
            return default
        try:
            value = (
                float(node.value.replace(".inf", "inf")) if isinstance(node, yaml.ScalarNode) else math.nan
            )
        except ValueError:
            value = math.nan
        measured = 1.0 / LARGEST < abs(value) < LARGEST or (not finite and math.isinf(value))
        if not measured or "_" in node.value or (positive and value <= 0.0):
            shown = node.value if isinstance(node, yaml.ScalarNode) else "a block"
            self.fault(node, f"{name} is {shown!r}; it has to be a positive number")
            return default
        return value


def _is_null(node: yaml.Node) -> bool:
    return isinstance(node, yaml.ScalarNode) and node.tag == "tag:yaml.org,2002:null"
