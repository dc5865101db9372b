"""Text of the effect file of a law: what the fit runs, and what a person reads and accepts."""

import math
import re
from typing import TYPE_CHECKING

from impactcell.physics import LawKind

if TYPE_CHECKING:
    from impactcell.discrepancy.laws.law import Law


_RANGE_SAID = '"""Range that was gone through, in the column\'s own unit; beyond it nothing is known."""'
"""What an effect file says of the range of its column."""


def effect_file(law: "Law") -> str:
    """Text of the effect file."""
    return _text_between_shots(law) if law.place.is_between_shots else _text_of_motion(law)


def _declaration(law: "Law") -> list[str]:
    """Lines of the parameters."""
    return [
        f'        Parameter("{item.name}", "{item.unit}", null={_python(item.null)}, '
        f"lower={_python(item.lower)}, upper={_python(item.upper)}, typical={_python(abs(item.first))}"
        + (f", kind=ParameterKind.{item.kind}" if item.kind != "VALUE" else "")
        + "),"
        for item in law.parameters
    ]


def _imports(law: "Law", *names: str) -> str:
    kinds = ["ParameterKind"] if any(item.kind != "VALUE" for item in law.parameters) else []
    return f"from impactcell.physics.effect import {', '.join(sorted([*names, *kinds]))}"


def _text_between_shots(law: "Law") -> str:
    """Text of an effect file whose law gives each shot its friction factor."""
    column = law.place.covariate
    expression = re.sub(r"\bmax\(", "np.maximum(", law.expression.replace("math.", "np."))
    names = "".join(f"{item.name}, " for item in law.parameters)
    tested = ", ".join(map(_python, law.tested[0]))
    return "\n".join(
        [
            f'"""Found in data: {law.functional_form} over {law.covariate}."""',
            "",
            "import math",
            "from collections.abc import Sequence",
            "",
            "import numpy as np",
            "",
            _imports(law, "Covariates", "Effect", "Factors", "Kind", "Parameter", "Phase"),
            "from impactcell.records import Samples",
            "",
            f"COLUMN = {column!r}",
            '"""Column of `shots.csv`; where it is not known the friction is as without it."""',
            f"TESTED = ({tested})",
            _RANGE_SAID,
            "",
            "",
            "def factors(parameters: Sequence[Samples], shots: Covariates) -> Factors:",
            f'    """{law.place.effect.equation}."""',
            f"    ({names}) = parameters",
            "    known = np.isfinite(shots.columns[COLUMN])",
            "    u = np.where(known, shots.columns[COLUMN], TESTED[0])",
            f"    s = {expression}",
            "    factor = np.where(known, 1.0 + s, 1.0)",
            "    return Factors(factor, factor, np.ones(()))",
            "",
            "",
            "EFFECT = Effect(",
            f'    identifier="{law.identifier}",',
            "    kind=Kind.BETWEEN_SHOTS,",
            f'    equation="{law.equation}",',
            '    reference="Found by the discrepancy workflow",',
            "    phases=(Phase.BETWEEN_SHOTS,),",
            "    parameters=(",
            *_declaration(law),
            "    ),",
            "    between=factors,",
            "    columns={COLUMN: TESTED},",
            ")",
            '"""Where it was tested, and with which values, says `result.json` beside it."""',
            "",
        ]
    )


def _text_of_motion(law: "Law") -> str:
    """Text of an effect file whose law enters the equations of motion."""
    kind, reach = law.place.law_kind, law.place.law_kind is LawKind.PULL
    lines = [f"    {item.name} = p[{i}]" for i, item in enumerate(law.parameters)]
    if kind is None:
        raise AssertionError(law.identifier)
    laws = f"LawKind.{kind.name}: law" + (", LawKind.REACH: reach" if reach else "")
    end = (
        "\n\ndef reach(_a: float, _b: float, _c: float, _d: float, p: FloatPointer) -> float:\n"
        f'    """Gap at which the pull ends."""\n    return p[{len(law.parameters) - 1}]\n'
        if reach
        else ""
    )
    column = law.place.second if law.place.effect.columns else ""
    second = f"p[{len(law.parameters)}]" if column else law.place.second_argument
    tested = ", ".join(map(_python, law.tested[-1]))
    phases = ", ".join(f"Phase.{phase.name}" for phase in law.place.effect.phases)
    return "\n".join(
        [
            f'"""Found in data: {law.functional_form} over {law.covariate}."""',
            "",
            "import math",
            "",
            "from impactcell.numerics.jit import FloatPointer",
            _imports(law, "Effect", "Kind", "LawKind", "Parameter", "Phase"),
            "",
            *(
                [
                    f"COLUMN = {column!r}",
                    '"""Column of `shots.csv`; where it is not known the law is not at work."""',
                    f"TESTED = ({tested})",
                    _RANGE_SAID,
                    "",
                ]
                if column
                else []
            ),
            "",
            f"def law({_signature(law)}, p: FloatPointer) -> float:",
            f'    """{law.place.effect.equation}."""',
            *lines,
            f"    u = {law.place.argument}",
            *([f"    w = {second}"] if second else []),
            f"    s = {law.expression}",
            f"    return {law.place.around}",
            end,
            "",
            "EFFECT = Effect(",
            f'    identifier="{law.identifier}",',
            f"    kind=Kind.{law.place.effect.kind.name},",
            f'    equation="{law.equation}",',
            '    reference="Found by the discrepancy workflow",',
            f"    phases=({phases},),",
            "    parameters=(",
            *_declaration(law),
            "    ),",
            f"    laws={{{laws}}},",
            *(["    columns={COLUMN: TESTED},"] if column else []),
            ")",
            '"""Where it was tested, and with which values, says `result.json` beside it."""',
            "",
        ]
    )


def _signature(law: "Law") -> str:
    """Arguments of the law, those that it does not read with a line before them."""
    read = f"{law.place.argument} {law.place.second_argument} {law.place.around}"
    return ", ".join(
        f"{argument}: float" if re.search(rf"\b{argument}\b", read) else f"_{argument}: float"
        for argument in "abcd"
    )


def _python(value: float) -> str:
    return "math.nan" if math.isnan(value) else repr(float(value))
