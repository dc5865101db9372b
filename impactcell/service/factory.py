"""From a cell's files to the values that the parts of the service are made with."""

import math
import zlib
from dataclasses import replace

from impactcell import __version__
from impactcell.alarms import RULES, AlarmSettings
from impactcell.alarms.rules import wear_limit, wear_warning
from impactcell.cell import CellDesign
from impactcell.cell.preprocessing import CaptureDefaults
from impactcell.errors import PositioningError, RasterError
from impactcell.fieldbus.positioning_registers import commanded_values
from impactcell.fieldbus.registers import RegisterMap
from impactcell.journal.retention import Retention
from impactcell.numerics.raster import ANY_VALUE, Raster
from impactcell.positioning import SafetyLimits, TapPlanner, task_state_machine
from impactcell.positioning.prediction_watch import POSITION_NOISE_M
from impactcell.records import MM_PER_MIN
from impactcell.scada import (
    CellDescription,
    Machine,
    Ranges,
    ServerLimits,
    ServerSettings,
    default_application_uri,
)
from impactcell.settings import CellConfig
from impactcell.settings.exposed_files import files_granting_access
from impactcell.settings.sections import JournalSection
from impactcell.settings.web_section import WebSection
from impactcell.tracking.signature.tracker import SignatureSettings
from impactcell.tracking.wear_batch import BatchKnowledge, TrackerSettings
from impactcell.web.interface import CellFacts, PageSettings

MM, UM = 1e-3, 1e-6
"""SI units of what a cell file is written in."""
COMMISSIONED_APART = 32
"""Cycles over which cells begun together look for random walks, each at one that follows from its name: 9 ms
after 100 cycles, 19 ms after 200, so that of 48 cells one or two do so in a period, for which a core has
room. Our choice."""


def cell_design(cell: CellConfig) -> CellDesign:
    """How the cell is computed."""
    settings = cell.settings
    stroke_mm = settings.actuator.stroke_mm
    return CellDesign(
        name=cell.name,
        model=cell.model,
        tracker=TrackerSettings(
            wear_limit=settings.alarms.wear_limit,
            horizon_cycles=float(settings.alarms.wear_warning_cycles),
            batch=BatchKnowledge(settings.tracking.batch),
            false_alarm_cycles=settings.alarms.false_alarm_cycles,
            commissioning_delay=zlib.crc32(cell.name.encode()) % COMMISSIONED_APART,
        ),
        signature=SignatureSettings(
            length_m=settings.signature.length_mm * MM,
            points=settings.signature.points,
            learned_cycles=settings.signature.learning_cycles,
            false_alarm_cycles=settings.alarms.false_alarm_cycles,
        ),
        alarms=alarm_settings(cell),
        defaults=CaptureDefaults(
            mass_kg=settings.part.mass_kg,
            stroke_m=None if stroke_mm is None else stroke_mm * MM,
            force_noise_std_n=settings.sensors.force_noise_std_n,
            position_noise_std_m=settings.sensors.position_noise_std_um * UM,
            recorder_std=settings.recorder_std,
        ),
        false_alarm_cycles=settings.alarms.false_alarm_cycles,
    )


def alarm_settings(cell: CellConfig) -> AlarmSettings:
    """When the cell calls a person; what the YAML leaves out keeps its default."""
    chosen = cell.settings.alarms
    on, off = chosen.on_delay_cycles, chosen.off_delay_cycles
    rules = {
        name: replace(
            rule.settings,
            on_delay=rule.settings.on_delay if on is None or rule.is_occurrence else on,
            off_delay=rule.settings.off_delay if off is None else off,
        )
        for name, rule in RULES.items()
        if rule.evaluate is not None
    }
    rules[wear_limit.NAME] = replace(
        rules[wear_limit.NAME],
        activate_above=chosen.wear_probability_on,
        clear_below=chosen.wear_probability_off,
    )
    warns = chosen.wear_warning_cycles > 0
    rules[wear_warning.NAME] = replace(
        rules[wear_warning.NAME],
        activate_above=chosen.wear_warning_probability_on if warns else math.inf,
        clear_below=chosen.wear_warning_probability_off if warns else math.inf,
    )
    return AlarmSettings(rules)


def retention_policy(journal: JournalSection) -> Retention:
    """Say what the journal keeps."""
    return Retention(journal.retain_days, journal.retain_captures_days, int(journal.max_size_mb * 2**20))


def server_settings(cell: CellConfig) -> ServerSettings:
    """How the OPC UA server of the cell, and of those that share its endpoint, is reached."""
    opcua = cell.settings.opcua
    return ServerSettings(
        endpoint=opcua.endpoint,
        application_uri=default_application_uri(),
        pki=opcua.certificates_dir,
        allow_none=opcua.allow_sessions_without_encryption,
        limits=ServerLimits(sessions=opcua.max_sessions),
    )


def page_settings(cell: CellConfig, section: WebSection) -> PageSettings:
    """How the page of the cell, and of those that share its endpoint, is reached."""
    opcua = cell.settings.opcua
    return PageSettings(
        section.endpoint,
        opcua.users_file,
        opcua.certificates_dir,
        section.studies_dir or cell.path.resolve().parent / "studies",
        section.certificate,
        section.key,
        section.public_url,
    )


def cell_facts(cell: CellConfig, endpoint: str) -> CellFacts:
    """Say to the page what a cell is that its OPC UA server shows at `endpoint`."""
    module, journal = cell.settings.module, cell.settings.journal
    return CellFacts(
        cell.name,
        f"{module.host}:{module.port}",
        endpoint,
        None if journal is None else journal.file,
        cell.path.resolve(),
        None if cell.settings.actuator.stroke_mm is None else cell.settings.actuator.stroke_mm * MM,
        cell.settings.positioning is not None,
        access_files=tuple((what, file) for _, what, file in files_granting_access(cell.settings)),
    )


def cell_description(cell: CellConfig) -> CellDescription:
    """Nameplate and ranges of the cell as SCADA sees them."""
    settings = cell.settings
    plate, actuator = settings.identification, settings.actuator
    travel_m = settings.positioning.travel_mm * MM if settings.positioning else None
    ranges = Ranges(
        velocity_m_s=actuator.max_velocity_mm_per_min * MM_PER_MIN, stroke_m=actuator.max_stroke_mm * MM
    )
    return CellDescription(
        cell.name,
        Machine(
            manufacturer=plate.manufacturer,
            serial_number=plate.serial_number or cell.name,
            product_instance_uri=plate.product_instance_uri or f"urn:impactcell:{cell.name}",
            model=plate.model,
            location=plate.location or None,
            software_revision=__version__,
        ),
        ranges if travel_m is None else replace(ranges, target_m=(0.0, travel_m)),
    )


def positioning_cell(cell: CellConfig) -> task_state_machine.PositioningCell:
    """Make what a positioning task has to know of a cell.

    Raises
    ------
    PositioningError
        The cell has no positioning.
    """
    settings, actuator = cell.settings.positioning, cell.settings.actuator
    if settings is None:
        raise PositioningError(f"{cell.name}: this cell has no positioning; add it to {cell.path}")
    limits = SafetyLimits(
        velocity_m_s=actuator.max_velocity_mm_per_min / 60e3,
        stroke_m=actuator.max_stroke_mm * 1e-3,
        force_n=math.inf if actuator.max_force_n is None else actuator.max_force_n,
        travel_m=(0.0, settings.travel_mm * 1e-3),
    )
    return task_state_machine.PositioningCell(
        cell.name, limits, settings.encoder_resolution_um * 1e-6, two_sided=actuator.both_ends
    )


def tap_planner(
    cell: CellConfig,
    limited: task_state_machine.PositioningCell,
    design: CellDesign,
    registers: RegisterMap,
) -> TapPlanner:
    """Make the planner of a cell, which has learned nothing yet: of taps that `registers` can express.

    Raises
    ------
    PositioningError
        A limit of the cell is one that no cell has.
    """
    settings, limits = cell.settings.positioning, limited.limits
    assert settings is not None  # noqa: S101 - `positioning_cell` has looked
    try:
        return TapPlanner(
            tolerance_m=settings.tolerance_um * 1e-6,
            max_velocity_m_s=limits.velocity_m_s,
            max_stroke_m=limits.stroke_m,
            overshoot_probability=settings.overshoot_probability,
            plant=design.model.plant,
            max_force_n=limits.force_n,
            two_sided=limited.two_sided,
            velocity_raster=_planned_values(registers, "command_velocity", limits.velocity_m_s),
            stroke_raster=_planned_values(registers, "command_stroke", limits.stroke_m),
            travel_m=limits.travel_m,
            position_noise_m=max(0.5 * limited.resolution_m, POSITION_NOISE_M),
        )
    except PositioningError as refused:
        raise PositioningError(f"{cell.path}: {refused}") from refused


def _planned_values(registers: RegisterMap, name: str, limit: float) -> Raster:
    """Return the values that a register commands; any where none is within the limit (SI).

    Then each tap is refused as it is to be commanded, and the cell's friction goes on being told;
    `impactcell check` says so beforehand.
    """
    try:
        values = commanded_values(registers, name)
    except RasterError:
        return ANY_VALUE
    return values if values.has_up_to(limit) else ANY_VALUE
