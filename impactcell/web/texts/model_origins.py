"""What `model accept` says of the investigation that a model comes from, as the page says it."""

import re
from typing import Final

from impactcell.german.findings import GERMAN_PHASES

REMAINS: Final = re.compile(
    r"something remains that no established effect explains: (?P<what>a pattern|\d+% of the held-out gap)"
    r"(?:, in (?P<phases>[^;]+))?(?:;.*)?"
)
"""Caution where something was established, and something is left."""
GERMAN_CAUTIONS: Final = {
    "there were too few shots": "Nichts ist nachgewiesen: Es waren zu wenige Stöße, oder zu viel Rauschen, "
    "um zu sagen, ob diesem Modell etwas fehlt. Der Bericht sagt, was aufzuzeichnen ist.",
    "what is missing": "Nichts ist nachgewiesen: Was diesem Modell fehlt, kann verfälschen, was es von der "
    "Reibung sagt. Der Bericht sagt, wo es fehlt.",
}
"""Cautions where nothing was established, by how they begin after saying so."""
NOTHING: Final = "nothing was established: "
"""Begin of a caution where nothing was established."""


def model_caution(caution: str, language: str) -> tuple[str, str]:
    """Say why a model is to be taken with caution, after the language in which it is said.

    >>> model_caution("something new", "de")
    ('en', 'something new')
    """
    if language == "de" and (german := _german(caution)):
        return language, german
    return "en", caution


def _german(caution: str) -> str:
    """Say a caution in German; empty for one that is not known."""
    if match := REMAINS.fullmatch(caution):
        what = "ein Muster" if match["what"] == "a pattern" else _share(match["what"])
        named = [_phase(phase) for phase in (match["phases"] or "").split(", ") if phase]
        where = f" (Phase: {', '.join(named)})" if named else ""
        return (
            f"Es bleibt etwas, das kein nachgewiesener Effekt erklärt: {what}{where}. Das kann verfälschen, "
            "was dieses Modell von der Reibung sagt; der Bericht zeigt, wo es bleibt."
        )
    rest = caution.removeprefix(NOTHING)
    return next((said for begin, said in GERMAN_CAUTIONS.items() if rest.startswith(begin)), "")


def _share(what: str) -> str:
    return f"{what.partition('%')[0]} % der Abweichung zurückgehaltener Stöße"


def _phase(phase: str) -> str:
    return GERMAN_PHASES.get(phase.replace(" ", "_"), phase)
