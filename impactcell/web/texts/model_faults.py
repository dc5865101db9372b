"""Why a model is not put into service, as the page says it: what `impactcell model accept` refuses."""

import re
from collections.abc import Callable
from typing import Final

REFUSED: Final = re.compile(
    r"(?P<cell>.+?): model (?P<model>.+) is not put into service \(--anyway would\): of the cell's last "
    r"(?P<taps>\d+) taps it (?P<after>.+), (?P<usable_after>\d+) estimates are usable; the model before "
    r"(?P<before>.+), (?P<usable_before>\d+) are"
)
TEXTS: Final = {
    "en": "{cell}: model {model} is not put into service, since the cell's own taps speak against it: of the "
    "last {taps} it {after}, {usable_after} estimates are usable; the model in service {before}, "
    "{usable_before} are. Were these measurements made in this cell? If the model is meant all the same, "
    "“impactcell model accept --anyway” takes it.",
    "de": "{cell}: Modell {model} wird nicht übernommen, denn die eigenen Stöße der Zelle sprechen dagegen: "
    "bei den letzten {taps} {after}, {usable_after} Schätzungen sind brauchbar; das jetzige Modell {before}, "
    "{usable_before} sind es. Sind die Messungen aus dieser Zelle? Soll das Modell dennoch gelten: "
    "„impactcell model accept --anyway“.",
}
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
    if language == "de":
        said |= {"after": _german(said["after"], " es"), "before": _german(said["before"], "")}
    return TEXTS[language].format_map(said)


def _german(phrase: str, subject: str) -> str:
    match = LEAVES.fullmatch(phrase)
    if match is None:
        return f"kann{subject} keinem folgen"
    gap = match["gap"].replace(".", ",")
    return f"lässt{subject} das {gap}-Fache des Sensorrauschens übrig"
