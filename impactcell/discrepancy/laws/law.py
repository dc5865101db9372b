"""A law as a physical effect: the text of its effect file, which is also what the fit runs."""

import hashlib
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, count

from impactcell.discrepancy.laws.condense import RankedForm
from impactcell.discrepancy.laws.effect_file import effect_file
from impactcell.discrepancy.laws.grammar import WAVES, Shape, evaluate, name
from impactcell.numerics.formula import compile_formula
from impactcell.physics import Effect, LawKind
from impactcell.physics.effects import LIBRARY, add_effect
from impactcell.physics.free_column_forms import printed
from impactcell.physics.free_form import FreeForm
from impactcell.records import Samples

SUFFIX = {
    "1": "", "m": "_m", "m/s": "_m_s", "s": "_s", "N": "_n", "N s/m": "_n_s_per_m", "N/m": "_n_per_m",
}  # fmt: skip
"""How a parameter's name ends for each unit."""
LISTED = {
    ("free_drag_over_speed", "1"): "viscous_friction",
    ("free_drag_over_speed", "u"): "quadratic_drag",
    ("free_friction_over_speed", "exp(-(u/l)^2)"): "stribeck_friction",
    ("free_friction_over_position", "u"): "position_dependent_friction",
    ("free_force_over_position", "u"): "restoring_force",
    ("free_damping_over_indentation", "u"): "hunt_crossley_damping",
    ("free_reading_over_force", "1"): "force_sensor_gain",
}
"""Effects of the library by the place and the form of a law that is one of them."""
MANY = 1e3
"""Times its first value: how far an amplitude or scale may be looked for."""


@dataclass(frozen=True, slots=True)
class LawParameter:
    """A number of a law, as its effect file declares it.

    Attributes
    ----------
    null : float
        0 for an amplitude, nan for a shape.
    first : float
        Value at which a fit begins.
    """

    name: str
    unit: str
    null: float
    lower: float
    upper: float
    first: float
    kind: str = "VALUE"

    def starting_at(self, value: float) -> "LawParameter":
        """Give another first value; a fit that rests at an end of the range may be past it by rounding."""
        return replace(self, first=min(max(value, self.lower), self.upper))


@dataclass(frozen=True, slots=True)
class Law:
    """A functional form at a place, with names for its numbers.

    Attributes
    ----------
    identifier : str
        Of its effect: place, and what it is made of.
    functional_form : str
        Name of the form, of u.
    expression : str
        Python of the function of u, its parameters by name.
    tested : tuple of (float, float)
        Range of each covariate that was gone through.
    """

    identifier: str
    place: FreeForm
    functional_form: str
    expression: str
    parameters: tuple[LawParameter, ...]
    tested: tuple[tuple[float, float], ...]

    @property
    def covariate(self) -> str:
        """What u is, in words; and w, where there is one."""
        words = [COVARIATE_WORDS.get(name, f"column {printed(name)}") for name in self.place.covariates]
        return " and w the ".join(words)

    @property
    def is_wave(self) -> bool:
        """Whether two terms are one wave of any phase."""
        return self.functional_form == " + ".join(sorted(WAVES))

    @property
    def listed(self) -> str:
        """Effect of the library that it is; empty where it is none, or one of the wrong sign."""
        identifier = LISTED.get((self.place.place, self.functional_form), "")
        strength = self.parameters[0].first
        is_wrong = bool(identifier) and strength < 0.0 <= LIBRARY[identifier].parameters[0].lower
        return "" if is_wrong else identifier

    @property
    def equation(self) -> str:
        """The law as one would print it."""
        function = (
            self.expression.replace("math.", "").replace("**", "^").replace("6.283185307179586", "2 pi")
        )
        for parameter in self.parameters:
            function = re.sub(rf"\b{re.escape(parameter.name)}\b", _short(parameter.name), function)
        function = re.sub(
            r"\b\d+\.\d{5,}(?:e[+-]?\d+)?\b", lambda number: f"{float(number[0]):.5g}", function
        )
        of = "u, w" if self.place.second else "u"
        return f"{self.place.effect.equation} with s({of}) = {function}, u the {self.covariate}"

    def text(self) -> str:
        """Text of the effect file."""
        return effect_file(self)

    def values(self, u: Samples) -> Samples:
        """Values at u, shape (n,), or at u and w, shape (n, 2), its parameters as they stand."""
        known = {item.name: item.first for item in self.parameters}
        return evaluate(self.expression, u, known)

    def effect(self) -> Effect:
        """Effect that the text defines, ready to enter a plant; the same however often the law is found.

        Its identifier tells form and start of the fit: a text with other values is the same law.
        """
        effect = _MADE.get(self.identifier) or _run(self.text(), self.identifier)
        add_effect(effect)
        _MADE[self.identifier] = effect
        return effect


_MADE: dict[str, Effect] = {}
"""Effects of the laws found in this process."""


def _run(text: str, identifier: str) -> Effect:
    """Run the text of an effect file."""
    space: dict[str, object] = {"__name__": identifier}
    exec(compile(text, f"<{identifier}>", "exec"), space)  # noqa: S102  # our own text
    effect = space["EFFECT"]
    if not isinstance(effect, Effect):
        raise TypeError(identifier)
    for law in effect.laws.values():
        compile_formula(text, law)
    return effect


COVARIATE_WORDS = {
    "speed": "speed of sliding",
    "position": "position on the table",
    "indentation": "indentation",
    "indentation_rate": "rate of indentation",
    "gap": "gap",
    "time": "time since first contact",
    "force": "contact force",
}
"""What a covariate is called in a sentence."""


def _short(parameter: str) -> str:
    for suffix in sorted(SUFFIX.values(), key=len, reverse=True):
        if suffix and parameter.endswith(suffix):
            return parameter.removesuffix(suffix)
    return parameter


def write_law(place: FreeForm, ranked: RankedForm, tested: tuple[tuple[float, float], ...]) -> Law:
    """Give a ranked form's numbers names, units and ranges; `tested` are those of the covariates."""
    references = [max(map(abs, ends)) for ends in tested]
    reference = references[0]
    form_name = name(ranked.form)
    parameters: list[LawParameter] = []
    pieces: list[str] = []
    wave = {term[0].name for term in ranked.form} == set(WAVES) and len(ranked.form) == 2
    shared: dict[str, str] = {}
    for number, (item, amplitude) in enumerate(zip(ranked.terms, ranked.amplitudes, strict=True), 1):
        several = len(ranked.terms) > 1
        label = f"amplitude{f'_{number}' if several else ''}{SUFFIX[place.unit]}"
        size = max(abs(amplitude), 1e-12)
        parameters.append(LawParameter(label, place.unit, 0.0, -MANY * size, MANY * size, amplitude))
        factors = [label]
        for atom, values in zip(item.term, item.shapes, strict=True):
            over = _OfCovariate(place, references, second=atom.second)
            source = atom.source.replace("reference", repr(over.reference))
            if atom.second:
                source = re.sub(r"\bu\b", "w", source)
            for shape, value in zip(atom.shapes, values, strict=True):
                key = shape.name
                if wave and key in shared:
                    written = shared[key]
                else:
                    written = _shape_name(shape, over.unit, {entry.name for entry in parameters})
                    parameters.append(_shape_parameter(written, shape, over, value))
                    shared[key] = written
                source = re.sub(rf"\b{key}\b", written, source)
            if source != "1.0":
                factors.append(source)
        pieces.append(" * ".join(factors))
    if place.law_kind is LawKind.PULL:
        parameters.append(
            LawParameter("range_m", "m", math.nan, 1e-3 * reference, MANY * reference, reference)
        )
    digest = hashlib.sha256(f"{form_name} {parameters}".encode()).hexdigest()[:8]
    identifier = _not_given(f"{place.effect.identifier.replace('free_', 'law_of_', 1)}_{digest}")
    return Law(identifier, place, form_name, " + ".join(pieces), tuple(parameters), tested)


def _not_given(identifier: str) -> str:
    """Give a name of that stem that no effect on offer has: a law that was given may be found once more."""
    numbered = (f"{identifier}_{number}" for number in count(2))
    return next(name for name in chain([identifier], numbered) if name not in LIBRARY)


class _OfCovariate:
    """Covariate that an atom is of: its name, its unit and its largest magnitude."""

    def __init__(self, place: FreeForm, references: Sequence[float], *, second: bool) -> None:
        self.name = place.second if second else place.covariate
        self.unit = place.second_unit if second else place.covariate_unit
        self.reference = references[int(second)]


def _shape_name(shape: Shape, unit: str, taken: set[str]) -> str:
    suffix = SUFFIX[unit] if shape.has_unit else ""
    return next(candidate for candidate in shape_names(shape.name, suffix) if candidate not in taken)


def shape_names(stem: str, suffix: str = "") -> Iterator[str]:
    """Give names for shapes of one name, in their order: the first has no number."""
    yield stem + suffix
    for number in range(2, 9):
        yield f"{stem}_{number}{suffix}"


def _shape_parameter(written: str, shape: Shape, over: _OfCovariate, value: float) -> LawParameter:
    reference = over.reference
    if shape.name == "centre":
        lower = -reference if value < 0.0 or over.name == "position" else 1e-3 * reference
        return LawParameter(written, over.unit, math.nan, lower, reference, value, "POSITION")
    if shape.name == "exponent":
        return LawParameter(written, "1", math.nan, 0.05, 12.0, value)
    kind = "PERIOD" if shape.name == "period" and over.unit == "m" else "VALUE"
    return LawParameter(written, over.unit, math.nan, 1e-3 * reference, 1e2 * reference, value, kind)
