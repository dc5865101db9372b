"""Placing the part by taps, in a cell file."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from impactcell.settings.fields import Positive, Probability, Section


class PositioningSection(Section):
    """Placing the part by taps."""

    tolerance_um: Annotated[Positive, Field(le=5000.0)] = 50.0
    """The part is in place when it is this near its target."""
    travel_mm: Positive = 40.0
    """Targets beyond this are refused."""
    encoder_resolution_um: Positive = 1.0
    """A tolerance below this is refused."""
    overshoot_probability: Probability = 0.001
    """Accepted chance that a task overshoots."""

    @model_validator(mode="after")
    def _seen_by_the_encoder(self) -> Self:
        if self.tolerance_um < self.encoder_resolution_um:
            raise ValueError(
                f"tolerance_um {self.tolerance_um:g} is finer than encoder_resolution_um "
                f"{self.encoder_resolution_um:g}: raise it"
            )
        return self

    @model_validator(mode="after")
    def _wider_than_its_tolerance(self) -> Self:
        travel_um = self.travel_mm * 1e3
        if travel_um < 2.0 * self.tolerance_um:
            raise ValueError(
                f"travel_mm {self.travel_mm:g} is {travel_um:g} µm, no more than the tolerance to both sides "
                f"of a target (tolerance_um {self.tolerance_um:g}): check the units of both"
            )
        return self
