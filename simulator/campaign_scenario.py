"""What a campaign file may say: the plant, the shots, the sensors, and what is hidden in it."""

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, field_validator, model_validator

from simulator.effects import LIBRARY, UNLISTED, check
from simulator.scenario_file import NotNegative, Positive, ScenarioModel

Share = Annotated[float, Field(ge=0, lt=1)]
"""A number from 0 to below 1."""
Strength = float | list[float]


def _as_pair(value: object) -> object:
    return tuple(value) if isinstance(value, list) else value


def _ascending(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] > pair[1]:
        message = f"has to be [low, high], and {pair[0]:g} is above {pair[1]:g}; put them the other way round"
        raise ValueError(message)
    return pair


Range = Annotated[tuple[Positive, Positive], BeforeValidator(_as_pair), AfterValidator(_ascending)]
"""Two numbers above 0, the second not below the first, between which something is drawn."""


class PlantScenario(ScenarioModel):
    """The nominal plant; `spread` draws k, b and mu_s of this campaign within ± that share."""

    stiffness_n_per_m: Positive = 6.5e5
    damping_n_s_per_m: NotNegative = 465.0
    mu_s: Positive = 0.2
    ratio: Annotated[float, Field(gt=0, le=1)] = 0.76
    spread: Share = 0.0


class SensorScenario(ScenarioModel):
    """One channel: its rate, noise and what is lost of it."""

    rate_hz: Positive
    noise_std: NotNegative
    resolution: NotNegative = 0.0
    gap_share: Share = 0.0


class SensorsScenario(ScenarioModel):
    """The channels recorded; units are N and m."""

    force: SensorScenario | None = None
    position: SensorScenario | None = None
    actuator: SensorScenario | None = None


class NoiseScenario(ScenarioModel):
    """Colour of the noise, and whether campaign.yaml says how large it is."""

    colour: Literal["white", "coloured"] = "white"
    correlation_time_s: Positive = 3e-4
    stated: bool = True


class DriveScenario(ScenarioModel):
    """Driving force: a sum of sines of random phase within a band, of this RMS."""

    rms_n: Positive = 60.0
    band_hz: Range = (0.7, 6.0)
    lines: Annotated[int, Field(ge=1, le=200)] = 12
    duration_s: Positive = 12.0


class ColumnScenario(ScenarioModel):
    """A further column of `shots.csv`, drawn for each shot, and what goes with it.

    `friction` lists [value, factor of both coefficients] in ascending order, linear between; `strength` the
    same for the strength of everything that is hidden. Empty where it does nothing.
    """

    low: float
    high: float
    friction: list[tuple[float, Positive]] = Field([])
    strength: list[tuple[float, NotNegative]] = Field([])

    @field_validator("friction", "strength", mode="before")
    @classmethod
    def _as_pairs(cls, value: object) -> object:
        return [_as_pair(pair) for pair in value] if isinstance(value, list) else value

    @model_validator(mode="after")
    def _ascending(self) -> Self:
        ascend = all(
            [value for value, _ in pairs] == sorted({value for value, _ in pairs})
            for pairs in (self.friction, self.strength)
        )
        if not self.low < self.high or not ascend:
            message = "low has to be below high, and the values of friction and strength have to ascend"
            raise ValueError(message)
        return self


class ToldScenario(ScenarioModel):
    """How far the settings of a tap are from what `shots.csv` tells of them.

    Velocity and mass are those told times 1 + error + scatter z, with z standard normal, anew for each shot,
    and again where that is not above 0.
    """

    velocity_error: Annotated[float, Field(gt=-1.0, lt=1.0)] = 0.0
    velocity_scatter: Share = 0.0
    mass_error: Annotated[float, Field(gt=-1.0, lt=1.0)] = 0.0
    mass_scatter: Share = 0.0


class CampaignScenario(ScenarioModel):
    """A whole campaign; see config/sim/campaign.yaml for every key with its meaning."""

    format: Literal[1]
    excitation: Literal["tap", "free_slide", "driven"] = "tap"
    seed: Annotated[int, Field(ge=0)] = 1
    gravity_m_s2: Positive = 9.81
    plant: PlantScenario = PlantScenario()
    velocities_mm_per_min: list[Positive] = Field([2000.0, 3000.0, 4000.0, 5000.0, 6000.0])
    speeds_m_s: list[Positive] = Field([0.08, 0.14, 0.2])
    velocity_jitter: Share = 0.0
    masses_kg: list[Positive] = Field([12.6, 18.9, 25.2])
    mass_stated: bool = True
    told: ToldScenario = ToldScenario()
    directions: list[Literal[1, -1]] = Field([1, -1])
    starts_m: list[float] = Field([0.0])
    replicates: Annotated[int, Field(ge=1)] = 2
    shots: Annotated[int, Field(ge=1)] | None = None
    order: Literal["random", "as_listed"] = "random"
    stroke_m: Positive = 0.0015
    batches: list[Annotated[str, Field(min_length=1)]] = Field(["A"])
    dwell_s: Range = (1.0, 150.0)
    friction_scatter: NotNegative = 0.012
    columns: dict[str, ColumnScenario] = Field({})
    ratio_scatter: NotNegative = 0.0
    sensors: SensorsScenario
    noise: NoiseScenario = NoiseScenario()
    drive: DriveScenario = DriveScenario()
    tail_s: NotNegative = 0.01
    hide: list[str] = Field([])
    strengths: dict[str, dict[str, Strength]] = Field({})

    @model_validator(mode="after")
    def _told_is_of_taps(self) -> Self:
        if self.excitation != "tap" and self.told != ToldScenario():
            message = "told is about taps: leave it out"
            raise ValueError(message)
        return self

    @field_validator("velocities_mm_per_min", "speeds_m_s", "masses_kg", "directions", "starts_m", "batches")
    @classmethod
    def _not_empty(cls, value: list[object]) -> list[object]:
        if not value:
            message = "needs at least one entry"
            raise ValueError(message)
        return value

    @field_validator("hide")
    @classmethod
    def _known_effects(cls, value: list[str]) -> list[str]:
        for identifier in value:
            _defaults(identifier)
        if len(set(value)) < len(value):
            message = "an effect is hidden once at most"
            raise ValueError(message)
        return value

    @field_validator("strengths")
    @classmethod
    def _known_strengths(cls, value: dict[str, dict[str, Strength]]) -> dict[str, dict[str, Strength]]:
        for identifier, parameters in value.items():
            check(identifier, {**_defaults(identifier), **parameters})
        return value

    @model_validator(mode="after")
    def _channels(self) -> Self:
        recorded = {
            name for name in ("force", "position", "actuator") if getattr(self.sensors, name) is not None
        }
        needed = {"tap": "force or position", "free_slide": "position", "driven": "force and position"}
        enough = {
            "tap": bool(recorded & {"force", "position"}),
            "free_slide": "position" in recorded,
            "driven": recorded >= {"force", "position"},
        }
        if not enough[self.excitation]:
            message = f"sensors: a campaign of excitation {self.excitation} records {needed[self.excitation]}"
            raise ValueError(message)
        if self.excitation != "tap" and "actuator" in recorded:
            message = f"sensors.actuator: there is no actuator in a campaign of excitation {self.excitation}"
            raise ValueError(message)
        return self

    def hidden(self) -> dict[str, Mapping[str, Strength | tuple[float, ...]]]:
        """Effects that act, with the parameters they act with."""
        effects: dict[str, Mapping[str, Strength | tuple[float, ...]]] = {}
        for identifier in self.hide:
            parameters: dict[str, Strength | tuple[float, ...]] = _defaults(identifier)
            parameters.update(self.strengths.get(identifier, {}))
            effects[identifier] = parameters
        return effects


def _defaults(identifier: str) -> dict[str, Strength | tuple[float, ...]]:
    kind = LIBRARY.get(identifier) or UNLISTED.get(identifier)
    if kind is None:
        message = f"unknown effect {identifier!r}; known: {', '.join([*LIBRARY, *UNLISTED])}"
        raise ValueError(message)
    return {
        name: value if isinstance(value, float) else tuple(value) for name, value in kind.defaults.items()
    }
