"""What stands in a model file, section by section."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from impactcell.settings.fields import NotNegative, Positive

Interval = tuple[FiniteFloat, FiniteFloat]
"""Lower and upper end."""
INCOMPLETE: Final = "incomplete"
"""Key under which a file of a part of a model says what is not known of it: it is no model file."""


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ParameterFile(_Part):
    """A parameter of an effect, with its 95 % interval where one is known."""

    value: FiniteFloat
    ci95: Interval | None = None


class PlantFile(_Part):
    """The plant of equations (1)-(3) and the effects beside them."""

    stiffness_n_per_m: Positive
    damping_n_s_per_m: NotNegative
    mu_s: Positive
    mu_k: Positive
    gravity_m_s2: Positive = 9.81
    effects: dict[str, dict[str, FiniteFloat | ParameterFile | list[FiniteFloat]]] = {}


class PriorFile(_Part):
    """Standard deviations about the plant's values."""

    stiffness_std_n_per_m: Positive
    damping_std_n_s_per_m: Positive
    ratio_std: Positive


class ForceFile(_Part):
    """Equation (4)."""

    friction_n: Positive
    velocity_n_s_per_m: FiniteFloat
    rms: NotNegative


class DistanceFile(_Part):
    """Equation (5)."""

    limit: Positive
    square_m: Positive
    square_power: FiniteFloat
    offset_m: FiniteFloat
    offset_power: FiniteFloat
    rms: NotNegative


class SensitivityFile(_Part):
    """Relative error of mu_s per relative error of what is taken as known."""

    stiffness: FiniteFloat = 0.0
    damping: FiniteFloat = 0.0
    ratio: FiniteFloat = 0.0


class PredictorFile(_Part):
    """Equations (4) and (5) for one mass."""

    mass_kg: Positive
    mu_s_range: Interval
    velocity_range_m_s: Interval
    force: ForceFile
    distance: DistanceFile
    force_sensitivity: SensitivityFile = SensitivityFile()
    distance_sensitivity: SensitivityFile = SensitivityFile()


class ModelFile(_Part):
    """A whole model file."""

    format: Literal[1]
    name: Annotated[str, Field(min_length=1)]
    plant: PlantFile
    prior: PriorFile
    stroke_m: Positive | None = None
    predictors: list[PredictorFile] = []
    provenance: dict[str, str] = {}
    effect_files: list[str] = []

    @model_validator(mode="before")
    @classmethod
    def _is_whole(cls, content: object) -> object:
        if isinstance(content, Mapping) and INCOMPLETE in content:
            raise ValueError(content[INCOMPLETE])
        return content

    @model_validator(mode="after")
    def _one_predictor_a_tap(self) -> Self:
        ranges = sorted((predictor.mass_kg, *predictor.velocity_range_m_s) for predictor in self.predictors)
        for (mass, _, last), (next_mass, first, _) in pairwise(ranges):
            if mass == next_mass and first < last:
                raise ValueError(f"two predictors for {mass:.6g} kg have velocities in common")
        return self
