"""Numbers that a base model holds, and what they would explain if they were off, in German."""

import re
from collections.abc import Callable
from typing import Final

PHRASES: Final = {
    "a force recorded late or early": "eine zu spät oder zu früh aufgezeichnete Kraft",
    "a force recorded late or early by less than a sample": (
        "eine um weniger als einen Abtastschritt zu spät oder zu früh aufgezeichnete Kraft"
    ),
    "a constant force": "eine konstante Kraft",
    "another gain of the force": "eine andere Verstärkung der Kraft",
    "another gain of the force or another inertia": "eine andere Verstärkung der Kraft oder Trägheit",
    "another gain of the force or another mass": "eine andere Verstärkung der Kraft oder Masse",
    "an encoder that turns off its centre": "ein Drehgeber, der außermittig sitzt,",
    "a zero of the angle that is off": "ein verschobener Nullpunkt des Winkels",
    "another torque of gravity": "ein anderes Schweremoment",
    "another inertia": "eine andere Trägheit",
    "another mass": "eine andere Masse",
    "an inertia": "eine Trägheit",
    "a mass": "eine Masse",
}
"""What may be off."""
LATE: Final = {"late": "spät", "early": "früh"}
"""By which side of its time a force was recorded."""
INERT: Final = {"inertia": "Trägheit", "mass": "Masse"}
"""What is inert."""
SIZED: Final[tuple[tuple[str, str | Callable[[re.Match[str]], str]], ...]] = (
    (r"an? force recorded (\S+) ms (late|early)",
     lambda m: f"eine um {m[1]} ms zu {LATE[m[2]]} aufgezeichnete Kraft"),
    (r"a constant force of (\S+ N(?: m)?)", r"eine konstante Kraft von \1"),
    (r"a gain of the force (\S+) % (larger|smaller)",
     lambda m: f"eine um {m[1]} % {_larger(m[2], 'e')} Verstärkung der Kraft"),
    (r"(a gain of the force .+), or (an? .+) \(these records do not tell which\)",
     lambda m: f"{held_number(m[1])} oder {held_number(m[2])} (diese Messungen sagen nicht, welche)"),
    (r"an encoder that turns (\S+) mrad off its centre", r"ein Drehgeber, der \1 mrad außermittig sitzt,"),
    (r"a zero of the angle (\S+) mrad off", r"ein um \1 mrad verschobener Nullpunkt des Winkels"),
    (r"a torque of gravity (\S+) N m (larger|smaller)",
     lambda m: f"ein um {m[1]} N m {_larger(m[2], 'es')} Schweremoment"),
    (r"an? (inertia|mass) (\S+) % (larger|smaller)",
     lambda m: f"eine um {m[2]} % {_larger(m[3], 'e')} {INERT[m[1]]}"),
    (r"an? (inertia|mass) of (\S+ kg(?: m²)?)", lambda m: f"eine {INERT[m[1]]} von {m[2]}"),
)  # fmt: skip
"""The same with its size."""


def held_number(english: str) -> str:
    """Say what is off, with or without its size; empty where that is not known."""
    text = english[:1].lower() + english[1:]
    if text in PHRASES:
        return PHRASES[text]
    for pattern, german in SIZED:
        if match := re.fullmatch(pattern, text):
            return match.expand(german) if isinstance(german, str) else german(match)
    return ""


def key_of(english: str) -> str:
    """Say where a base model would leave a number free; empty where that is not known."""
    one, _, other = english.partition(" or ")
    if other:
        return f"{key_of(one)} oder {key_of(other)}"
    if match := re.fullmatch(r"(\w+)(: \{std: SECONDS\})? among the nuisances of the base model", english):
        within = ": {std: SEKUNDEN}" if match[2] else ""
        return f"{match[1]}{within} unter den nuisances des Grundmodells"
    match = re.fullmatch(r"a free (\w+)( above 0)?( in the base model)?", english)
    if match is None:
        return ""
    above, inside = " über 0" if match[2] else "", " im Grundmodell" if match[3] else ""
    return f"ein freies {match[1]}{above}{inside}"


def column_slip(english: str) -> str:
    """Say what a column would be instead of what its name says.

    >>> column_slip("mass_kg in t or force_n in mN")
    'mass_kg in t oder force_n in mN'
    >>> column_slip("force_n or position_m turned in shots 2 and 4")
    'umgedrehtem force_n oder position_m (Messung 2 und 4)'
    """
    text = english.replace(" or ", " oder ").replace(" in degrees", " in Grad")
    match = re.fullmatch(r"(.+) turned(?: in shots? (.+))?", text)
    if match is None:
        return text
    where = f" (Messung {match[2].replace(' and ', ' und ')})" if match[2] else ""
    return f"umgedrehtem {match[1]}{where}"


def _larger(english: str, ending: str) -> str:
    return f"{'größer' if english == 'larger' else 'kleiner'}{ending}"
