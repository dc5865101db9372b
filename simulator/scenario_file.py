"""What all scenario files have in common: how they are read, and the numbers in them."""

from pathlib import Path
from typing import Annotated, Final, TypeVar

from pydantic import BaseModel, ConfigDict, Field

from impactcell.process import yaml_schema


class ScenarioModel(BaseModel):
    """Base of everything in a scenario: unknown keys are faults, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


Positive = Annotated[float, Field(gt=0)]
"""A number above 0."""
NotNegative = Annotated[float, Field(ge=0)]
"""A number of at least 0."""

MM_PER_MIN: Final = 1e-3 / 60.0
"""Metres a second of one millimetre a minute, in which scenarios give velocities."""

M = TypeVar("M", bound=ScenarioModel)


def load(file: Path, model: type[M]) -> M:
    """Read `file` as a `model`.

    Raises
    ------
    SettingsError
        Every fault at once, as `file:line:column: key.path: message`.
    """
    scenario, _ = yaml_schema.read(file, model)
    return scenario
