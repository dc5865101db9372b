"""What is known of a machine before its records are looked at: the content of a base model."""

import enum
import math
from dataclasses import dataclass, field

from impactcell.campaign import Coordinate


class Response(enum.StrEnum):
    """Which channel the model predicts from the other."""

    POSITION = "position"
    FORCE = "force"


@dataclass(frozen=True, slots=True)
class NumberPrior:
    """What is known of one number: a standard deviation of 0 holds it, inf leaves it free."""

    value: float = 0.0
    std: float = 0.0

    @property
    def is_held(self) -> bool:
        """Whether data may not move it."""
        return self.std <= 0.0


@dataclass(frozen=True, slots=True)
class TermChoice:
    """A term of the model: its identifier and, where it needs one, a column of `shots.csv`."""

    identifier: str
    covariate: str = ""

    @property
    def name(self) -> str:
        """Name by which it is told from the same term of another column."""
        return f"{self.identifier}({self.covariate})" if self.covariate else self.identifier


@dataclass(frozen=True, slots=True)
class BaseModel:
    """One generalised coordinate q: I q'' = (1 + g) F + F_0 - G sin(q - q_0) + sum of terms.

    Attributes
    ----------
    coordinate : Coordinate
        Where it is a rotation, I is an inertia [kg m²] and F a torque [N m].
    response : Response
        What is predicted: the position from the force, or the force from the position.
    inertia : NumberPrior
        I [kg or kg m²]; nan where each shot states its own.
    gravity_torque : NumberPrior
        G = m g l [N m]; 0 and held where gravity does not act.
    terms : tuple of TermChoice
        What the model has beside inertia and gravity.
    position_offset : NumberPrior
        q_0, zero of the position sensor against the vertical [m or rad].
    force_offset : NumberPrior
        F_0 [N or N m].
    force_gain : NumberPrior
        g, relative error of the force [1].
    delay_s : NumberPrior
        How late the force was recorded against the position [s].
    block_s : float
        Length of the blocks that count as independent [s]; nan: from the motion.
    name : str
    """

    coordinate: Coordinate = Coordinate.TRANSLATION
    response: Response = Response.POSITION
    inertia: NumberPrior = NumberPrior(math.nan)
    gravity_torque: NumberPrior = NumberPrior()
    terms: tuple[TermChoice, ...] = field(default=(TermChoice("coulomb_friction"),))
    position_offset: NumberPrior = NumberPrior()
    force_offset: NumberPrior = NumberPrior()
    force_gain: NumberPrior = NumberPrior()
    delay_s: NumberPrior = NumberPrior()
    block_s: float = math.nan
    name: str = "base"
