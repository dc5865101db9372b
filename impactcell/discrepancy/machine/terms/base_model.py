"""What is known of a machine before its records are looked at: the content of a base model."""

import enum
import math
from dataclasses import dataclass, field

from impactcell.campaign import Coordinate
from impactcell.discrepancy.laws import Shaped, form_name

PRIOR_REACH = 2.0
"""Standard deviations of its prior that a nuisance may go: no misfit talks a scale away [1]."""


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

    @property
    def reach(self) -> tuple[float, float]:
        """From where to where data may move it."""
        return self.value - PRIOR_REACH * self.std, self.value + PRIOR_REACH * self.std


@dataclass(frozen=True, slots=True)
class LawForm:
    """A function s(u) that no term of the catalogue is.

    Attributes
    ----------
    terms : tuple of Shaped
        What is summed, each with an amplitude of its own, at the values of their shapes.
    reference : float
        Covariate by which powers are made dimensionless, in its unit.
    """

    terms: tuple[Shaped, ...]
    reference: float

    @property
    def name(self) -> str:
        """The function as one would print it, without its numbers."""
        return form_name(tuple(item.term for item in self.terms))

    @property
    def has_reference(self) -> bool:
        """Whether any of its atoms is over the reference."""
        return any(atom.has_reference for item in self.terms for atom in item.term)

    def printed(self, unit: str) -> str:
        """Write the function with its reference, in the unit of the covariate, and terms in their order."""
        reference = f"{self.reference:.3g} {unit}"
        return " + ".join(" ".join(atom.over(reference) for atom in item.term) for item in self.terms)


@dataclass(frozen=True, slots=True)
class Reach:
    """Where a smooth force acts: positions from where to where, and largest speed."""

    position: tuple[float, float]
    speed: float


@dataclass(frozen=True, slots=True)
class TermChoice:
    """A term of the model.

    Attributes
    ----------
    identifier : str
        Of the catalogue; for a law, the place where it acts.
    covariate : str
        Column of `shots.csv`, where the term needs one.
    law : LawForm or None
        What acts there, where no term of the catalogue does.
    reach : Reach or None
        Of a smooth force of position and velocity.
    """

    identifier: str
    covariate: str = ""
    law: LawForm | None = None
    reach: Reach | None = None

    @property
    def name(self) -> str:
        """Name by which it is told from the same term of another column, and from another law."""
        inside = self.covariate if self.law is None else self.law.name
        return f"{self.identifier}({inside})" if inside else self.identifier


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
    position_eccentricity : NumberPrior
        e_c and e_s of an encoder that turns off its centre, which reads q + e_c cos q + e_s sin q [rad].
    force_offset : NumberPrior
        F_0 [N or N m].
    force_offset_by_record : bool
        Whether F_0 is another one in each record; it is free then.
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
    position_eccentricity: NumberPrior = NumberPrior()
    force_offset: NumberPrior = NumberPrior()
    force_offset_by_record: bool = False
    force_gain: NumberPrior = NumberPrior()
    delay_s: NumberPrior = NumberPrior()
    block_s: float = math.nan
    name: str = "base"

    @property
    def has_gravity(self) -> bool:
        """Whether gravity acts, or may."""
        return self.gravity_torque.value != 0.0 or not self.gravity_torque.is_held

    @property
    def has_free_offset(self) -> bool:
        """Whether a constant force, or one of each record, is fitted whatever its size."""
        return self.force_offset_by_record or math.isinf(self.force_offset.std)

    @property
    def unit(self) -> str:
        """Unit of what is predicted."""
        is_rotation = self.coordinate is Coordinate.ROTATION
        if self.response is Response.FORCE:
            return "N m" if is_rotation else "N"
        return "rad" if is_rotation else "m"
