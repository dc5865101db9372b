"""What a physical effect is: its law, its parameters, and where in the plant it acts."""

import enum
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from impactcell.numerics.jit import Law
from impactcell.physics import memory_layout as at
from impactcell.records import Samples


class LawKind(enum.IntEnum):
    """Where a law enters the equations of motion, and what its four numbers are; p are its parameters.

    A law is a plain Python function `law(a, b, c, d, p) -> float` of the restricted Python that numba
    compiles. Unused numbers are 0. It is evaluated beyond the events that bound its phase, so it should be
    continued smoothly there. Behind the parameters p holds the shot's values of the effect's `columns`.
    """

    BODY = at.BODY
    """(x, x', m, g): force on the part along +1 [N], wherever it is."""
    SCALE = at.SCALE
    """(x): factor of mu_s and mu_k."""
    KINETIC = at.KINETIC
    """(abs(x'), x): what is added to mu_k in slip."""
    CONTACT = at.CONTACT
    """(d, d', k, b): added to k d + b max(d', 0) while in contact [N]; their sum is never negative."""
    PULL = at.PULL
    """(gap): attraction while not in contact, positive towards the actuator [N]."""
    REACH = at.REACH
    """(): gap from which on the pull is zero [m]."""
    SPEED = at.SPEED
    """(t): factor of the actuator's commanded speed."""
    UNTIL = at.UNTIL
    """(): time at which the SPEED law has a kink [s]."""
    LOSS = at.LOSS
    """(w, F): rate of change of a speed w that the actuator loses, y' = v - w, 0 at first [m/s²]."""
    READING = at.READING
    """(F): what the force sensor shows at the force F [N]."""
    LAG = at.LAG
    """(): time constant of the force sensor [s]."""
    DELAY = at.DELAY
    """(): how late the force channel is recorded [s]."""
    STICK = at.STICK
    """(): stiffness of stick [N/m]."""
    POSITION_LAG = at.POSITION_LAG
    """(): time constant of the position sensor [s]."""


class Kind(enum.Enum):
    """What an effect acts on."""

    CONTACT = "contact force"
    FRICTION = "friction"
    BODY = "force on the part"
    ACTUATOR = "motion of the actuator"
    SENSOR = "sensor"
    BETWEEN_SHOTS = "covariate between shots"


class Phase(enum.Enum):
    """Parts of a record, as the discrepancy workflow names them."""

    PRELOAD = "preload"
    LOADING = "loading"
    UNLOADING = "unloading"
    FREE_SLIDE = "free_slide"
    STOP = "stop"
    BETWEEN_SHOTS = "between_shots"
    DRIVEN = "driven"


class ParameterKind(enum.Enum):
    """What a parameter measures, where its unit does not say: a search lays its grid by it."""

    VALUE = "a value"
    POSITION = "a position on the table"
    WIDTH = "the width of something on the table"
    PERIOD = "the period of something on the table"
    PHASE = "the phase angle of what repeats"


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of an effect.

    Attributes
    ----------
    null : float
        Value at which the effect vanishes; nan where the effect vanishes by another of its parameters.
    lower, upper : float
        Range in which the law makes sense and a fit may look.
    typical : float
        Magnitude at which the effect is clearly visible in a tap: a scale for steps and starts.
    per_batch : bool
        One value for each batch after the first instead of one.
    kind : ParameterKind
    """

    name: str
    unit: str
    null: float
    lower: float
    upper: float
    typical: float
    per_batch: bool = False
    kind: ParameterKind = ParameterKind.VALUE


class Covariates(NamedTuple):
    """What distinguishes shots, one entry a shot.

    Attributes
    ----------
    columns : mapping
        The further columns of `shots.csv` that the effect asks for, each of shape (shots,); nan where a
        shot does not say.
    """

    dwell_s: Samples
    shot: Samples
    shots: Samples
    batch: Samples
    direction: Samples
    columns: Mapping[str, Samples] = MappingProxyType({})


class Factors(NamedTuple):
    """Factors of a shot's mu_s, mu_k and mass, each of shape (shots,) or ()."""

    mu_s: Samples
    mu_k: Samples
    mass: Samples


class German(NamedTuple):
    """What an effect is called in German, what it means, what to look at: as the object of "Nachsehen:"."""

    name: str
    meaning: str
    look_at: str


ONE = np.ones(())


@dataclass(frozen=True, slots=True, eq=False)
class Effect:
    """A named physical effect; each file of `impactcell.physics.effects` holds one.

    Two effects are never equal, also where both have one identifier: what is remembered of one is not used
    for the other.

    Attributes
    ----------
    equation, reference : str
        The law as one would print it, and where it comes from.
    meaning, look_at : str
        What it is in a sentence for whoever knows the machine and no mechanics, and what to look at there.
    german : German or None
        The same in German; without it the effect is called by its identifier there, and told in English.
    phases : tuple of Phase
        Where in a record it shows directly.
    laws : mapping
        The compiled part: at most one law for each place in the equations of motion.
    between : callable or None
        The part that acts between shots: parameters (each of shape (shots,), those of a `per_batch`
        parameter (shots, batches - 1)) and covariates in, factors out.
    columns : mapping of str to (float, float)
        Further columns of `shots.csv` that `between` or the laws read, and the range of each in which the
        effect is known; where one of them is nan the effect is at its null.
    dissipates : bool
        Claims to take energy from the part, never to give any.
    order : int
        Sensor laws are applied in ascending order.
    """

    identifier: str
    kind: Kind
    equation: str
    reference: str
    phases: tuple[Phase, ...]
    parameters: tuple[Parameter, ...]
    laws: Mapping[LawKind, Law] = field(default_factory=dict)
    between: Callable[[Sequence[Samples], Covariates], Factors] | None = None
    columns: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    dissipates: bool = False
    order: int = 0
    meaning: str = ""
    look_at: str = ""
    german: German | None = None
