"""Why a model is not put into service, as the page says it: what `impactcell model accept` refuses."""

import re
from collections.abc import Callable
from typing import Final

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
ALL_NOISE: Final = ("leaves no more than the sensors' noise", "leaves 1 times the sensors' noise")
"""What a model leaves that follows all; the second is of stored studies."""
LEAVES: Final = re.compile(r"leaves (?P<gap>\S+) times the sensors' noise")


def model_fault(fault: str, language: str, named: Callable[[str], str] = str) -> str | None:
    """Say why a model was refused, which is called as `named` says; None for what is no such refusal.

    >>> model_fault("p: the file is missing", "de") is None
    True
    """
    match = REFUSED.fullmatch(fault)
    if match is None:
        return None
    said = match.groupdict()
    said["model"] = named(said["model"])
    said["command"] = said["command"] or "impactcell model accept --anyway"
    if language == "de":
        said |= {"after": _german(said["after"], " es"), "before": _german(said["before"], "")}
    return TEXTS[language].format_map(said)


def _german(phrase: str, subject: str) -> str:
    if phrase in ALL_NOISE:
        return f"lässt{subject} nicht mehr als das Sensorrauschen übrig"
    match = LEAVES.fullmatch(phrase)
    if match is None:
        return f"kann{subject} keinem folgen"
    gap = match["gap"].replace(".", ",")
    return f"lässt{subject} das {gap}-Fache des Sensorrauschens übrig"
