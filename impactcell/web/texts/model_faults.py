"""Why a model is not put into service, as the page says it: what `impactcell model accept` refuses."""

import re
from collections.abc import Callable
from typing import Final

from impactcell.german.findings import with_decimal_commas

REFUSED: Final = re.compile(
    r"(?P<cell>.+?): model (?P<model>.+) is not put into service "
    r"\((?:--anyway|`(?P<command>[^`]+)`) would\): of the cell's last (?P<taps>\d+) taps it (?P<after>.+), "
    r"(?P<usable_after>\d+) estimates are usable; the model before (?P<before>.+), (?P<usable_before>\d+) are"
)
TEXTS: Final = {
    "en": "{cell}: model {model} is not put into service, since the cell's own taps speak against it: of the "
    "last {taps} it {after}, {usable_after} estimates are usable; the model in service {before}, "
    "{usable_before} are. Were these measurements made in this cell? If the model is meant all the same, "
    "“{command}” takes it.",
    "de": "{cell}: Modell {model} wird nicht übernommen, denn die eigenen Stöße der Zelle sprechen dagegen: "
    "bei den letzten {taps} {after}, {usable_after} Schätzungen sind brauchbar; das jetzige Modell {before}, "
    "{usable_before} sind es. Sind die Messungen aus dieser Zelle? Soll das Modell dennoch gelten: "
    "„{command}“.",
}
UNTOLD: Final = re.compile(
    r"(?P<cell>.+?): model (?P<model>.+) is not put into service \(`(?P<command>[^`]+)` would\): what it was "
    r"found in does not tell (?P<parameters>.+) \(± is 95 %\), and with such a prior .+"
)
UNTOLD_TEXTS: Final = {
    "en": "{cell}: model {model} is not put into service: its measurements do not tell {parameters} (± is "
    "95 %), and each tap would be estimated as if nothing were known of it. Record taps over more "
    "velocities, slow ones too, which stick first; or offer the law that the report proposes as an effect. "
    "If the model is meant all the same, “{command}” takes it.",
    "de": "{cell}: Modell {model} wird nicht übernommen: seine Messungen zeigen nicht, wie groß {parameters} "
    "ist (± gilt zu 95 %), und jeder Stoß würde geschätzt, als wäre darüber nichts bekannt. Stöße mit mehr "
    "Geschwindigkeiten aufzeichnen, auch langsame, die erst haften; oder das Gesetz, das der Bericht "
    "vorschlägt, als Effekt anbieten. Soll das Modell dennoch gelten: „{command}“.",
}
NOT_FREE: Final = re.compile(
    r"no part of (?P<light>\S+)-(?P<heavy>\S+) kg slides free of the actuator between (?P<slow>\S+) and "
    r"(?P<fast>\S+) mm/min(?:; tap faster, or with another stroke|: it catches up with the part; tap from "
    r"about (?P<enough>\S+) mm/min on, or with a stroke of less than about (?P<stroke>\S+) mm)"
)
NOT_FREE_TEXTS: Final = {
    "en": "With this model no part of {light} to {heavy} kg slides free of the actuator between {slow} and "
    "{fast} mm/min, as this cell taps, and no tap could be estimated; it takes ",
    "de": "Mit diesem Modell kommt kein Teil von {light} bis {heavy} kg zwischen {slow} und {fast} mm/min, "
    "wie diese Zelle stößt, vom Antrieb frei, und kein Stoß ließe sich schätzen; es braucht ",
}
FREE_WITH: Final = {
    "en": "taps from about {enough} mm/min on, or a stroke of less than about {stroke} mm.",
    "de": "Stöße ab etwa {enough} mm/min oder einen Hub von weniger als etwa {stroke} mm.",
}
"""What would free the part, where that is known."""
FREE_SOMEHOW: Final = {
    "en": "faster taps, or another stroke.",
    "de": "schnellere Stöße oder einen anderen Hub.",
}
ALL_NOISE: Final = ("leaves no more than the sensors' noise", "leaves 1 times the sensors' noise")
"""What a model leaves that follows all; the second is of stored studies."""
LEAVES: Final = re.compile(r"leaves (?P<gap>\S+) times the sensors' noise")


def is_untold(fault: str) -> bool:
    """Whether a model was refused since its measurements do not tell its contact: no other day changes that.

    >>> is_untold("p: the file is missing")
    False
    """
    return UNTOLD.fullmatch(fault) is not None


def model_fault(fault: str, language: str, named: Callable[[str], str] = str) -> str | None:
    """Say why a model was refused, which is called as `named` says; None for what is no such refusal.

    >>> model_fault("p: the file is missing", "de") is None
    True
    """
    if (held := NOT_FREE.fullmatch(fault)) is not None:
        return _not_free(held.groupdict(), language)
    untold = UNTOLD.fullmatch(fault)
    match = untold or REFUSED.fullmatch(fault)
    if match is None:
        return None
    said = match.groupdict()
    said["model"] = named(said["model"])
    if untold is not None:
        if language == "de":
            said["parameters"] = _german_numbers(said["parameters"])
        return UNTOLD_TEXTS[language].format_map(said)
    said["command"] = said["command"] or "impactcell model accept --anyway"
    if language == "de":
        said |= {"after": _german(said["after"], " es"), "before": _german(said["before"], "")}
    return TEXTS[language].format_map(said)


def _not_free(said: dict[str, str | None], language: str) -> str:
    """Say with which taps and masses no part slides free, and what would free it."""
    free = (FREE_WITH if said["enough"] else FREE_SOMEHOW)[language]
    figures = {name: figure or "" for name, figure in said.items()}
    if language == "de":
        figures = {name: with_decimal_commas(figure) for name, figure in figures.items()}
    return f"{NOT_FREE_TEXTS[language]}{free}".format_map(figures)


def _german_numbers(parameters: str) -> str:
    """Write the parameters of a contact with the decimal commas and units of German."""
    return with_decimal_commas(parameters.replace(", ", " und ")).replace("mu_k/mu_s", "µk/µs")


def _german(phrase: str, subject: str) -> str:
    if phrase in ALL_NOISE:
        return f"lässt{subject} nicht mehr als das Sensorrauschen übrig"
    match = LEAVES.fullmatch(phrase)
    if match is None:
        return f"kann{subject} keinem folgen"
    gap = match["gap"].replace(".", ",")
    return f"lässt{subject} das {gap}-Fache des Sensorrauschens übrig"
