"""What all scenario files have in common."""

from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict

from impactcell.process import yaml_loader


class ScenarioModel(BaseModel):
    """Base of everything in a scenario: unknown keys are faults, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


M = TypeVar("M", bound=ScenarioModel)


def load(file: Path, model: type[M]) -> M:
    """Read `file` as a `model`.

    Raises
    ------
    SettingsError
        Every fault at once, as `file:line:column: key.path: message`.
    """
    scenario, _ = yaml_loader.read(file, model)
    return scenario
