"""What a served cell does: plant, strikes, wear, batches, deviant cycles, sensors, and positioning tasks."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from simulator.effects import check
from simulator.fault_schedule import ScheduledFault
from simulator.scenario_file import NotNegative, Positive, ScenarioModel, load

Cycle = Annotated[int, Field(ge=1)]
"""Number of a cycle, from 1."""
Rate = Annotated[int, Field(ge=1, le=1_000_000)]
"""Samples a second, a whole number."""


def _beside(file: str, info: ValidationInfo) -> str:
    """Give where a file lies that is named from the scenario's directory."""
    path = Path((info.context or {}).get("directory", "")) / file
    try:
        path.open("rb").close()
    except OSError as error:
        message = f"{path} cannot be read: {error.strerror}"
        raise ValueError(message) from error
    return str(path)


PemFile = Annotated[str, AfterValidator(_beside)]
"""A file of certificates or keys, from the scenario's directory."""
Effects = dict[str, dict[str, float | list[float]]]


def _known(effects: Effects) -> Effects:
    for identifier, parameters in effects.items():
        check(identifier, parameters)
    return effects


class Listen(ScenarioModel):
    """Where the module answers; port 0 lets the system choose.

    Transport `rtu` makes a serial line of its own, a pseudo terminal, as slow as `baudrate` says; `tls` needs
    the module's certificate and key, and the authority that the client's certificate must lead to (PEM, from
    the scenario's directory).
    """

    transport: Literal["tcp", "tls", "udp", "rtu_over_tcp", "rtu"] = "tcp"
    baudrate: Annotated[int, Field(ge=300)] = 115_200
    certificate: PemFile | None = None
    key: PemFile | None = None
    client_authority: PemFile | None = None

    host: str = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 0
    device_id: Annotated[int, Field(ge=0, le=255)] = 1
    control_port: Annotated[int, Field(ge=0, le=65535)] | None = None

    @model_validator(mode="after")
    def _has_certificates(self) -> Self:
        if (self.transport == "tls") != (self.certificate is not None and self.key is not None):
            message = "`certificate` and `key` belong to `transport: tls`, and to no other"
            raise ValueError(message)
        return self


class CellPlant(ScenarioModel):
    """The reference plant and the effects that always act."""

    stiffness_n_per_m: Positive = 6.5e5
    damping_n_s_per_m: NotNegative = 465.0
    mu_s: Positive = 0.2
    ratio: Annotated[float, Field(gt=0, le=1)] = 0.76
    gravity_m_s2: Positive = 9.81
    effects: Effects = Field(default={"viscous_friction": {"viscous_coefficient_n_s_per_m": 85.0}})

    _check = field_validator("effects")(_known)


class Part(ScenarioModel):
    """What lies on the table."""

    mass_kg: Positive = 18.9
    mass_stated: bool = True


class Strikes(ScenarioModel):
    """The schedule; velocities and directions are taken in turn, or drawn.

    The first strike comes a period after the start of the module, or after the first request to it. With
    `ahead` no strike comes while so many cycles have not been acknowledged as stored, as where a PLC asks for
    that: a reader that is slow then loses none.
    """

    begin: Literal["at_once", "with_first_request"] = "at_once"
    period_s: Positive = 1.0
    velocities_mm_per_min: list[Positive] = Field([4000.0], min_length=1)
    directions: list[Literal[1, -1]] = Field([1], min_length=1)
    order: Literal["in_turn", "random"] = "in_turn"
    stroke_m: Positive = 0.0015
    cycles: Annotated[int, Field(ge=0)] | None = None
    ahead: Annotated[int, Field(ge=1)] | None = None

    @property
    def first_s(self) -> float:
        """Time of the first strike after the start, s; inf where it waits for a request."""
        return self.period_s if self.begin == "at_once" else math.inf


class Scatter(ScenarioModel):
    """From cycle to cycle: both coefficients together, and their ratio; standard deviations."""

    friction: NotNegative = 0.012
    ratio: NotNegative = 0.0


class Wear(ScenarioModel):
    """Steady change of mu_s, mu_k following by the ratio; from `until_cycle` on it stays as it is."""

    mu_s_per_1000_cycles: float = 0.0
    from_cycle: Cycle = 1
    until_cycle: Cycle | None = None


class Batch(ScenarioModel):
    """A batch of material; `shift` is its mu_s against the first batch. The PLC may say nothing of it."""

    from_cycle: Cycle
    id: Annotated[str, Field(min_length=1)]
    shift: float = 0.0
    announced: bool = True


class Deviation(ScenarioModel):
    """One cycle that differs along its stroke; distances count from where the part lay.

    bump: `size` (relative) around `at_m`, `width_m` wide; level: `size` everywhere; tilt: friction grows by
    `size` per metre; ripple: `size` with `period_m`.
    """

    cycle: Cycle
    kind: Literal["bump", "level", "tilt", "ripple"]
    size: float
    at_m: float = 0.004
    width_m: Positive = 0.0004
    period_m: Positive = 0.001


class Appearance(ScenarioModel):
    """Effects that act from some cycle on."""

    from_cycle: Cycle
    effects: Effects

    _check = field_validator("effects")(_known)


class Sensor(ScenarioModel):
    """Rate and white noise of one channel, N or m; `longest_s` bounds the record."""

    rate_hz: Rate
    noise_std: NotNegative
    longest_s: Positive


class Sensors(ScenarioModel):
    """What the module records: force during contact, position and actuator during the whole motion."""

    force: Sensor = Sensor(rate_hz=1_000_000, noise_std=0.4, longest_s=0.02)
    position: Sensor = Sensor(rate_hz=20_000, noise_std=1.5e-6, longest_s=0.2)
    actuator: Sensor | None = None


class FaultyCapture(ScenarioModel):
    """One cycle whose capture is of no use, to see what is made of it."""

    cycle: Cycle
    kind: Literal["empty", "constant_force", "saturated", "no_separation", "not_a_number", "no_force"]


class Task(ScenarioModel):
    """One part to be positioned."""

    target_m: float
    start_m: float = 0.0
    mass_kg: Positive = 18.9
    tolerance_m: Positive = 5e-5
    most_taps: Annotated[int, Field(ge=1)] = 200


class Positioning(ScenarioModel):
    """Strikes on command: what the actuator can do, and the parts that come one after the other."""

    most_velocity_mm_per_min: Positive = 6000.0
    most_stroke_m: Positive = 0.0015
    directions: list[Literal[1, -1]] = Field([1], min_length=1)
    pause_s: NotNegative = 1.0
    tasks: list[Task] = Field([])


class Scenario(ScenarioModel):
    """A served cell; see config/sim/prototype.yaml for the keys with their meaning."""

    format: Literal[1]
    name: str = "prototype"
    serial_number: str = "SIM-0001"
    register_map: str
    listen: Listen = Listen()
    seed: Annotated[int, Field(ge=0)] = 1
    acceleration: Positive = 1.0
    plant: CellPlant = CellPlant()
    part: Part = Part()
    strikes: Strikes | None = None
    positioning: Positioning | None = None
    scatter: Scatter = Scatter()
    wear: Wear = Wear()
    batches: list[Batch] = Field([Batch(from_cycle=1, id="A")], min_length=1)
    deviations: list[Deviation] = Field([])
    appearances: list[Appearance] = Field([])
    faulty_captures: list[FaultyCapture] = Field([])
    faults: list[ScheduledFault] = Field([])
    sensors: Sensors = Sensors()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.strikes is None) == (self.positioning is None):
            message = "give either `strikes` (on a schedule) or `positioning` (on command)"
            raise ValueError(message)
        cycles = [batch.from_cycle for batch in self.batches]
        if cycles[0] != 1 or sorted(set(cycles)) != cycles:
            message = "batches: the first begins with cycle 1, and each later one after the one before"
            raise ValueError(message)
        busy = set(self.plant.effects).union(*(entry.effects for entry in self.appearances))
        for deviation in self.deviations:
            if DEVIATION_EFFECT.get(deviation.kind) in busy:
                needed = DEVIATION_EFFECT[deviation.kind]
                message = f"deviations: {deviation.kind} needs {needed}, which acts already"
                raise ValueError(message)
        return self


DEVIATION_EFFECT: Mapping[str, str] = {
    "bump": "friction_patch",
    "tilt": "position_dependent_friction",
    "ripple": "periodic_friction",
}
"""Effect that makes each kind of deviant cycle; a level is a factor of friction and needs none."""


def read_scenario(file: Path) -> Scenario:
    """Read a scenario.

    Raises
    ------
    SettingsError
        Every fault at once, as `file:line:column: key.path: message`.
    """
    return load(file, Scenario)
