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
class Prior:
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
    inertia : Prior
        I [kg or kg m²]; nan where each shot states its own.
    gravity_torque : Prior
        G = m g l [N m]; 0 and held where gravity does not act.
    terms : tuple of TermChoice
        What the model has beside inertia and gravity.
    position_offset : Prior
        q_0, zero of the position sensor against the vertical [m or rad].
    force_offset : Prior
        F_0 [N or N m].
    force_gain : Prior
        g, relative error of the force [1].
    delay_s : Prior
        How late the force was recorded against the position [s].
    block_s : float
        Length of the blocks that count as independent [s]; nan: from the motion.
    name : str
    """

    coordinate: Coordinate = Coordinate.TRANSLATION
    response: Response = Response.POSITION
    inertia: Prior = Prior(math.nan)
    gravity_torque: Prior = Prior()
    terms: tuple[TermChoice, ...] = field(default=(TermChoice("coulomb_friction"),))
    position_offset: Prior = Prior()
    force_offset: Prior = Prior()
    force_gain: Prior = Prior()
    delay_s: Prior = Prior()
    block_s: float = math.nan
    name: str = "base"
