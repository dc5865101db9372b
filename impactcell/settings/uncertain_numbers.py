"""Numbers of a base model: exact, known about, free, or another one in each record."""

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Discriminator, FiniteFloat, Tag

from impactcell.discrepancy.machine import NumberPrior
from impactcell.settings.fields import NotNegative


def _form(value: object) -> str:
    """Which form of a number is meant, so that only what is wrong with that one is told."""
    return "known" if isinstance(value, Mapping | BaseModel) else "exact"


def _form_of_std(value: object) -> str:
    return "free" if isinstance(value, str) else "size"


class UncertainNumber(BaseModel):
    """A number and how well it is known; `std: free` leaves it to the data."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    value: FiniteFloat = 0.0
    std: Annotated[
        Annotated[NotNegative, Tag("size")] | Annotated[Literal["free"], Tag("free")],
        Discriminator(_form_of_std),
    ]

    def prior(self) -> NumberPrior:
        """Return it as the workflow takes it."""
        return NumberPrior(self.value, math.inf if self.std == "free" else self.std)


class NumberOfRecords(UncertainNumber):
    """A number that may be another one in each record."""

    each: Literal["record"] | None = None


_Exact = Annotated[FiniteFloat, Tag("exact")]
Number = Annotated[_Exact | Annotated[UncertainNumber, Tag("known")], Discriminator(_form)]
"""A number that is exact, or `{value: ..., std: ...}`."""
NumberOfEach = Annotated[_Exact | Annotated[NumberOfRecords, Tag("known")], Discriminator(_form)]
"""The same, or `{std: free, each: record}`."""
