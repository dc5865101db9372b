"""A cell's YAML file as frozen models: every key, its unit in its name, its range and its default.

Relative paths are taken from the directory of the file that names them.
"""

import json
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from impactcell.alarms.rules import wear_limit, wear_warning
from impactcell.cell.preprocessing import CaptureDefaults
from impactcell.journal.retention import Retention
from impactcell.settings.fields import (
    AnyPath,
    ModelFile,
    OutputDirectory,
    OutputFile,
    Positive,
    Probability,
    Section,
    cell_name,
    opcua_endpoint,
)
from impactcell.settings.module_section import ModuleSection
from impactcell.settings.positioning_section import PositioningSection
from impactcell.settings.web_section import WebSection
from impactcell.tracking.signature.tracker import SignatureSettings
from impactcell.tracking.wear_batch import TrackerSettings

_CAPTURE, _TRACKER, _SIGNATURE, _RETENTION = (
    CaptureDefaults(), TrackerSettings(), SignatureSettings(), Retention()
)  # fmt: skip
_WEAR_LIMIT, _WEAR_WARNING = wear_limit.RULE.settings, wear_warning.RULE.settings
"""What the parts of the service do by themselves; a key that is left out means that."""


class IdentificationSection(Section):
    """Machinery identification (OPC 40001-1), shown to SCADA."""

    manufacturer: str = "unknown"
    """Maker of the cell."""
    model: str = "impact cell"
    """Type of the cell."""
    serial_number: str = ""
    """Serial number of the cell; the cell's name where it is empty."""
    product_instance_uri: str = ""
    """Globally unique name of the cell."""
    location: str = ""
    """Where the cell stands."""


ErrorPercent = Annotated[float, Field(ge=0, le=10)]
"""What is not exact, in per cent of it."""


class PartSection(Section):
    """The part that is struck."""

    mass_kg: Positive | None = None
    """Mass where the module does not report one for each cycle."""
    mass_error_percent: ErrorPercent = _CAPTURE.recorder_std[0] * 100.0
    """One standard deviation of a mass, reported or this; 0 where it is exact to 0.01 %."""


class ActuatorSection(Section):
    """The actuator and the limits that no command passes."""

    stroke_mm: Positive | None = None
    """Travel from first contact where the module does not report one for each cycle."""
    max_velocity_mm_per_min: Positive = 6000.0
    """Fastest tap that may be commanded."""
    velocity_error_percent: ErrorPercent = _CAPTURE.recorder_std[1] * 100.0
    """One standard deviation of a velocity from what was commanded; 0 where it is exact to 0.01 %."""
    max_stroke_mm: Positive = 1.5
    """Longest stroke that may be commanded."""
    max_force_n: Positive | None = None
    """Largest contact force a commanded tap may be expected to make."""
    both_ends: bool = False
    """Actuators on both ends: the part can be struck back."""


class SensorSection(Section):
    """Noise of the sensors, one standard deviation, and their scale."""

    force_noise_std_n: Positive = _CAPTURE.force_noise_std_n
    """Force sensor."""
    position_noise_std_um: Positive = _CAPTURE.position_noise_std_m * 1e6
    """Position sensor."""
    force_scale_error_percent: ErrorPercent = _CAPTURE.recorder_std[2] * 100.0
    """One standard deviation of the force sensor's scale; 0 where it is exact to 0.01 %."""
    position_scale_error_percent: ErrorPercent = _CAPTURE.recorder_std[3] * 100.0
    """One standard deviation of the position sensor's scale, which mu_k follows; 0 where it is exact."""


class TrackingSection(Section):
    """How friction is followed over time and material."""

    batch: Literal["known", "unknown"] = "known"
    """known: the PLC names every batch; unknown: changes of batch are found from the friction."""


class AlarmSection(Section):
    """When a person is called."""

    wear_limit: Positive
    """mu_s at which the surface counts as worn."""
    wear_probability_on: Probability = _WEAR_LIMIT.activate_above
    """The wear alarm comes when P(level > limit) passes this ..."""
    wear_probability_off: Probability = _WEAR_LIMIT.clear_below
    """... and goes when it falls below this."""
    wear_warning_cycles: Annotated[int, Field(ge=0)] = int(_TRACKER.horizon_cycles)
    """The wear warning looks this many cycles ahead: there is time to plan; 0 for no warning."""
    wear_warning_probability_on: Probability = _WEAR_WARNING.activate_above
    """It comes when P(level > limit, so many cycles from now) passes this ..."""
    wear_warning_probability_off: Probability = _WEAR_WARNING.clear_below
    """... and goes when it falls below this, or when the wear alarm comes."""
    false_alarm_cycles: Annotated[float, Field(ge=100)] = _SIGNATURE.false_alarm_cycles
    """Designed mean number of cycles between two false alarms of one rule."""
    on_delay_cycles: Annotated[int, Field(ge=0)] | None = None
    """Cycles a rule must hold before its alarm comes: one number for WearLimit, WearWarning and ModelGap;
    absent: each one's own. BatchShift and DeviantCycle hold in one cycle, and come with it."""
    off_delay_cycles: Annotated[int, Field(ge=0)] | None = None
    """Cycles a rule must be clear before its alarm goes: one number for all that cycles decide (WearLimit,
    WearWarning, BatchShift, DeviantCycle, ModelGap); absent: each one's own."""

    @model_validator(mode="after")
    def _hysteresis(self) -> Self:
        for of in ("wear", "wear_warning"):
            if getattr(self, f"{of}_probability_off") >= getattr(self, f"{of}_probability_on"):
                raise ValueError(f"{of}_probability_off must be below {of}_probability_on")
        return self


class SignatureSection(Section):
    """Friction along the stroke."""

    length_mm: Positive = _SIGNATURE.length_m * 1e3
    """Distance slid at the last grid point."""
    points: Annotated[int, Field(ge=4, le=200)] = _SIGNATURE.points
    """Number of grid points."""
    learning_cycles: Annotated[int, Field(ge=10)] = _SIGNATURE.learned_cycles
    """Cycles from which the cell learns how its cycles vary before any is judged."""


class OpcUaSection(Section):
    """The OPC UA server; cells with the same endpoint share one."""

    endpoint: Annotated[str, AfterValidator(opcua_endpoint)] = "opc.tcp://127.0.0.1:4840/impactcell"
    """Where SCADA connects; an address other than loopback opens it to the network."""
    users_file: AnyPath = Field(default="users.yaml", validate_default=True)
    """Users and roles, made by `impactcell users`; while there is none, nobody can log in."""
    certificates_dir: OutputDirectory = Field(default="pki", validate_default=True)
    """Own, trusted and rejected certificates, made by `impactcell certs`."""
    allow_sessions_without_encryption: bool = False
    """Opens sessions over security policy None, where anybody can listen; every start then warns."""
    max_sessions: Annotated[int, Field(ge=1)] = 100
    """Sessions beyond this are refused."""


class JournalSection(Section):
    """The durable store of the cell."""

    file: OutputFile
    """SQLite file; one a cell."""
    retain_days: Positive = _RETENTION.days
    """Cycles older than this are dropped; those without a time only where room is needed."""
    retain_captures_days: Positive = _RETENTION.captures_days
    """Captures older than this are dropped; their summaries stay."""
    max_size_mb: Positive = _RETENTION.max_size_bytes / 2**20
    """Size that is kept; from 5 % below it on, captures are thinned, oldest first, then summaries. Alarms and
    actions of people go before them where either take more than a tenth of it."""


class MonitoringSection(Section):
    """Health and metrics over HTTP; every cell of a process shares one listener."""

    host: str = "127.0.0.1"
    """Address to listen on."""
    port: Annotated[int, Field(ge=0, le=65535)]
    """Port of /healthz and /metrics."""


class CellSettings(Section):
    """One cell."""

    format: Literal[1]
    """Version of this file format."""
    cell: Annotated[str, AfterValidator(cell_name)]
    """Name of the cell, in OPC UA, in logs and in messages."""
    identification: IdentificationSection = IdentificationSection()
    module: ModuleSection
    model: ModelFile
    """Model of the plant and its calibration; `init` writes the first, `model fit` the cell's own."""
    part: PartSection = PartSection()
    actuator: ActuatorSection = ActuatorSection()
    sensors: SensorSection = SensorSection()
    tracking: TrackingSection = TrackingSection()
    alarms: AlarmSection
    signature: SignatureSection = SignatureSection()
    positioning: PositioningSection | None = None
    """Absent: the cell only watches."""
    opcua: OpcUaSection = Field(default={}, validate_default=True)
    journal: JournalSection | None = None
    """Absent: nothing is kept over a restart."""
    monitoring: MonitoringSection | None = None
    """Absent: no health and metrics over HTTP."""
    web: WebSection | None = WebSection()
    """The live page; null: none."""

    @property
    def recorder_std(self) -> tuple[float, float, float, float]:
        """Relative standard deviations of mass, velocity and the scales of force and position."""
        per_cent = (
            self.part.mass_error_percent,
            self.actuator.velocity_error_percent,
            self.sensors.force_scale_error_percent,
            self.sensors.position_scale_error_percent,
        )
        mass, velocity, force_scale, position_scale = (one / 100.0 for one in per_cent)
        return mass, velocity, force_scale, position_scale


def schema() -> str:
    """JSON Schema (2020-12) of a cell file."""
    return json.dumps(CellSettings.model_json_schema(), indent=2)
