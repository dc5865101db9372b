"""Laws compiled from their text give the numbers that numba's code gives, to the last bit."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numba import cfunc, njit, types

from impactcell.discrepancy.laws.grammar import ATOMS, Atom
from impactcell.numerics import jit
from impactcell.numerics.formula import compile_formula
from impactcell.records import Samples

SHAPES = {"exponent": 1.5, "scale": 0.07, "period": 0.09, "centre": 0.11}
"""Numbers for the shapes of an atom, within the range of the covariate."""
_double = types.float64
_SIGNATURE = _double(_double, _double, _double, _double, types.CPointer(_double))


@njit
def _values(where: int, u: Samples, parameters: Samples) -> Samples:  # type: ignore[no-untyped-def]
    out = np.empty(len(u))
    pointer = jit.float_pointer(parameters)
    for i in range(len(u)):
        out[i] = jit.invoke(where, u[i], -0.3 * u[i], 1.0, 9.81, pointer, 0)
    return out


def _law(text: str) -> Callable[..., Any]:
    space: dict[str, Any] = {}
    exec(text, space)
    law: Callable[..., Any] = space["law"]
    return law


def _text(atom: Atom, argument: str, around: str) -> str:
    names = [shape.name for shape in atom.shapes]
    lines = ["amplitude = p[0]", *(f"{name} = p[{i}]" for i, name in enumerate(names, 1))]
    lines += [f"u = {argument}", f"s = amplitude * {atom.source.replace('reference', '0.123')}"]
    body = "".join(f"    {line}\n" for line in lines)
    return f'import math\n\n\ndef law(a, b, _c, _d, p):\n    """Law."""\n{body}    return {around}\n'


@pytest.mark.slow
@pytest.mark.parametrize(("argument", "around"), [("a", "a * (1.0 + s)"), ("abs(b)", "-b * s")])
def test_every_atom_gives_the_same_bits_as_from_numba(argument: str, around: str) -> None:
    u = np.linspace(-0.02, 0.3, 101)
    for atom in ATOMS:
        text = _text(atom, argument, around)
        law = _law(text)
        parameters = np.array([1.7, *(SHAPES[shape.name] for shape in atom.shapes)])
        expected = _values(cfunc(_SIGNATURE)(law).address, u, parameters)
        compile_formula(text, law)
        assert np.array_equal(_values(jit.address(law), u, parameters), expected), atom.name


@pytest.mark.parametrize(
    "value", ["a if a > 0.0 else b", "a ** b", "math.gamma(a)", "min(a, b)", "unknown + a"]
)
def test_what_is_no_formula_is_refused_and_named(value: str) -> None:
    text = f"def law(a, b, _c, _d, p):\n    return {value}\n"
    with pytest.raises(ValueError, match=value.split(maxsplit=1)[0].split("(", maxsplit=1)[0]):
        compile_formula(text, _law(text))
