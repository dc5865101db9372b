"""The laws a free-form term may be: functions of one or two covariates, of right dimension by their making.

A law is a sum of at most two terms; a term is an amplitude, in the unit of its place, times one or two atoms;
an atom is a dimensionless function of the covariate over something of its own unit. Every atom is written
once, as the Python that also stands in an effect file.
"""

import itertools
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from types import CodeType

import numpy as np

from impactcell.records import Samples

SCALES = tuple(float(x) for x in np.geomspace(0.04, 4.0, 12))
"""Scales to start from, over the largest covariate: what is sharper than a twenty-fifth of the range, or
wider than four times, no campaign shows."""
EXPONENTS = (0.25, 0.5, 1.5, 2.5, 4.0)
"""Exponents to start from."""
CYCLES = (0.25, *(0.5 * count for count in range(1, 49)))
"""Cycles of a wave in the range gone through to start from: closer ones are alike there."""
CENTRES = tuple(float(x) for x in np.linspace(0.1, 0.9, 9))
"""Centres to start from, as shares of the range gone through."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A number inside an atom: where a search starts, and how a fit moves it.

    Attributes
    ----------
    name : str
    grid : tuple of float
        Starts: over the reference of the covariate, as a share of its range for a centre, as cycles in it
        for a period, else as they are.
    has_unit : bool
        It is measured in the covariate's unit.
    """

    name: str
    grid: tuple[float, ...]
    has_unit: bool = True


SCALE = Shape("scale", SCALES)
PERIOD = Shape("period", CYCLES)
CENTRE = Shape("centre", CENTRES)
EXPONENT = Shape("exponent", EXPONENTS, has_unit=False)


@dataclass(frozen=True, slots=True)
class Atom:
    """A dimensionless function of the covariate.

    Attributes
    ----------
    name : str
        As one would print it, of u.
    source : str
        Python of u, of the reference of the covariate, and of the shapes by name.
    shapes : tuple of Shape
    signed : bool
        It means something for negative u too.
    second : bool
        It is a function of the second covariate, w in its name; its source says u all the same.
    """

    name: str
    source: str
    shapes: tuple[Shape, ...] = ()
    signed: bool = True
    second: bool = False

    def of_second(self) -> "Atom":
        """Give the same function of the second covariate."""
        return replace(self, name=re.sub(r"\bu\b", "w", self.name), second=True)

    @property
    def has_reference(self) -> bool:
        """Whether the covariate is measured in its reference."""
        return "reference" in self.source

    def over(self, reference: str) -> str:
        """Give the name with the reference, written with its unit, where the covariate is measured in it.

        >>> [atom.over("0.5 m/s") for atom in ATOMS if atom.name in ("u", "u^2", "max(u-c,0)", "tanh(u/l)")]
        ['(u/0.5 m/s)', '(u/0.5 m/s)^2', 'tanh(u/l)', '(max(u-c,0)/0.5 m/s)']
        """
        if not self.has_reference:
            return self.name
        is_power = self.name[0] in "uw"
        return f"({self.name[0]}/{reference}){self.name[1:]}" if is_power else f"({self.name}/{reference})"

    def values(self, u: Samples, reference: float, shapes: tuple[float, ...]) -> Samples:
        """Values at u, shape (n,)."""
        names = (shape.name for shape in self.shapes)
        return evaluate(self.source, u, {"reference": reference, **dict(zip(names, shapes, strict=True))})


def evaluate(source: str, u: Samples, parameters: Mapping[str, float]) -> Samples:
    """Values of a function that is made of atoms, its parameters by name.

    At u of shape (n,), or at u and w in columns of an array of shape (n, 2).
    """
    places = {"u": u} if u.ndim < 2 else {"u": u[:, 0], "w": u[:, 1]}
    known = {**places, "math": _ArrayMath, "max": np.maximum, **parameters}
    out = eval(_compiled(source), {"__builtins__": {}}, known)  # noqa: S307  # this file's atoms, nothing else
    values = np.asarray(out, dtype=np.float64)
    return values if values.shape == u.shape[:1] else np.broadcast_to(values, u.shape[:1])


@lru_cache(maxsize=1024)
def _compiled(source: str) -> CodeType:
    """Compile a function once: a simulation evaluates it at every step."""
    return compile(source, "<law>", "eval")


class _ArrayMath:
    """What atoms use of `math`, for arrays."""

    exp, tanh, log1p, sin, cos, pow = np.exp, np.tanh, np.log1p, np.sin, np.cos, np.power


ATOMS = (
    Atom("1", "1.0"),
    Atom("u", "(u / reference)"),
    Atom("u^2", "(u / reference) ** 2"),
    Atom("u^3", "(u / reference) ** 3"),
    Atom("u^n", "math.pow(max(u, 0.0) / reference, exponent)", (EXPONENT,), signed=False),
    Atom("exp(-u/l)", "math.exp(-u / scale)", (SCALE,), signed=False),
    Atom("exp(-(u/l)^2)", "math.exp(-((u / scale) ** 2))", (SCALE,)),
    Atom("1/(1+u/l)", "(1.0 / (1.0 + max(u, 0.0) / scale))", (SCALE,), signed=False),
    Atom("1/(1+(u/l)^2)", "(1.0 / (1.0 + (u / scale) ** 2))", (SCALE,)),
    Atom("log(1+u/l)", "math.log1p(max(u, 0.0) / scale)", (SCALE,), signed=False),
    Atom("tanh(u/l)", "math.tanh(u / scale)", (SCALE,)),
    Atom("sin(2pi u/p)", "math.sin(6.283185307179586 * u / period)", (PERIOD,)),
    Atom("cos(2pi u/p)", "math.cos(6.283185307179586 * u / period)", (PERIOD,)),
    Atom("1/(1+((u-c)/l)^2)", "(1.0 / (1.0 + ((u - centre) / scale) ** 2))", (CENTRE, SCALE)),
    Atom("exp(-(u-c)^2/2l^2)", "math.exp(-0.5 * ((u - centre) / scale) ** 2)", (CENTRE, SCALE)),
    Atom("1/(1+exp(-(u-c)/l))", "(0.5 + 0.5 * math.tanh(0.5 * (u - centre) / scale))", (CENTRE, SCALE)),
    Atom("max(u-c,0)", "(max(u - centre, 0.0) / reference)", (CENTRE,)),
    Atom("max(1-u/l,0)", "max(1.0 - u / scale, 0.0)", (SCALE,), signed=False),
    Atom("max(1-c/u,0)", "(max(u - centre, 0.0) / max(u, centre))", (CENTRE,), signed=False),
)
"""Powers, saturations, decays, waves, bumps, steps, and folds as slope and as secant."""
WAVES = ("sin(2pi u/p)", "cos(2pi u/p)")
"""Atoms that make one wave of any phase together: they share their period."""

WAVE_ATOMS = tuple(atom for atom in ATOMS if atom.name in WAVES)
"""The same as atoms."""

Term = tuple[Atom, ...]
Form = tuple[Term, ...]


@dataclass(frozen=True, slots=True)
class Shaped:
    """A term with numbers for its shapes, atom by atom."""

    term: Term
    shapes: tuple[tuple[float, ...], ...]

    def values(self, u: Samples, *references: float) -> Samples:
        """Values without the amplitude, shape (n,), at u of shape (n,), or u and w of shape (n, 2).

        There is a reference for each covariate.
        """
        out = np.ones(len(u))
        for atom, shapes in zip(self.term, self.shapes, strict=True):
            place = int(atom.second)
            out = out * atom.values(u[:, place] if u.ndim > 1 else u, references[place], shapes)
        return out

    @property
    def shape_count(self) -> int:
        """How many numbers the term has beside its amplitude."""
        return sum(map(len, self.shapes))

    @property
    def periods(self) -> list[float]:
        """Periods of its waves."""
        return [
            value
            for atom, values in zip(self.term, self.shapes, strict=True)
            for shape, value in zip(atom.shapes, values, strict=True)
            if shape.name == "period"
        ]


def name(form: Form) -> str:
    """Name of a functional form: its terms in a fixed order."""
    return " + ".join(sorted(" ".join(sorted(atom.name for atom in term)) for term in form))


def shaped_terms(lower: float, upper: float, *, constant: bool) -> Iterator[Shaped]:
    """Every single-atom term at every start of its shapes, then every product of two at fewer starts.

    `constant` says whether a constant is one of them; without it only those of its products are.
    """
    reference = max(abs(lower), abs(upper))
    atoms = [atom for atom in ATOMS if (atom.signed or lower >= 0.0) and (constant or atom.name != "1")]
    for atom in atoms:
        for shapes in itertools.product(*(_starts(shape, lower, upper, reference) for shape in atom.shapes)):
            yield Shaped((atom,), (shapes,))
    factors = [atom for atom in atoms if atom.name != "1" and len(atom.shapes) <= 1]
    for one, other in itertools.combinations(factors, 2):
        if not one.shapes and not other.shapes:
            continue
        grids = [
            list(itertools.product(*(_few(_starts(shape, lower, upper, reference)) for shape in atom.shapes)))
            for atom in (one, other)
        ]
        for pair in itertools.product(*grids):
            yield Shaped((one, other), pair)


def shaped_pairs(
    first: tuple[float, float], second: tuple[float, float], *, constant: bool
) -> Iterator[Shaped]:
    """Every function of either covariate with one shape at most, and every product of one of each.

    Waves are left out: over two covariates no campaign has shown one. Ends are of the ranges gone through.
    """
    alone = [list(_few_shaped(*first)), [_of_second(item) for item in _few_shaped(*second)]]
    if constant:
        yield Shaped((ATOMS[0],), ((),))
    for items in alone:
        yield from items
    for one, other in itertools.product(*alone):
        yield Shaped((*one.term, *other.term), (*one.shapes, *other.shapes))


def _few_shaped(lower: float, upper: float) -> Iterator[Shaped]:
    """Every atom with one shape at most, at few starts, but for a constant and waves."""
    reference = max(abs(lower), abs(upper))
    for atom in ATOMS[1:]:
        if len(atom.shapes) > 1 or atom.name in WAVES or not (atom.signed or lower >= 0.0):
            continue
        for shapes in itertools.product(
            *(_few(_starts(shape, lower, upper, reference)) for shape in atom.shapes)
        ):
            yield Shaped((atom,), (shapes,))


def _of_second(item: Shaped) -> Shaped:
    return Shaped(tuple(atom.of_second() for atom in item.term), item.shapes)


def _few(starts: tuple[float, ...]) -> tuple[float, ...]:
    """Four of many starts, as products have."""
    return starts[:: max(len(starts) // 4, 1)]


def _starts(shape: Shape, lower: float, upper: float, reference: float) -> tuple[float, ...]:
    if shape is CENTRE:
        return tuple(lower + share * (upper - lower) for share in shape.grid)
    if shape is PERIOD:
        return tuple((upper - lower) / cycles for cycles in shape.grid)
    return tuple(value * reference if shape.has_unit else value for value in shape.grid)
