"""Why a value is uncertain or missing, as the page says it; reasons are published in English over OPC UA."""

import re
from typing import Final

OUTSIDE: Final = re.compile(
    r"(mass|velocity|mu_s) (\S+)( \S+)? is outside the calibrated (\S+?)-(\S+?)( \S+)?", re.ASCII
)
"""A tap whose mass, velocity or friction the model was not calibrated for."""
NAMES: Final = {"mass": "Masse", "velocity": "Geschwindigkeit", "mu_s": "µs"}
GERMAN: Final = {
    r"stroke (.+) is not the (.+) of the calibration": r"Hub \1 ist nicht der der Kalibrierung, \2",
    r"residuals are (\S+) times the sensors' noise: the model lacks something":
        r"die Abweichung ist \1-mal das Rauschen der Sensoren: dem Modell fehlt etwas",
    r"mu_s through mu_k/mu_s of the model: the part moved at once":
        "µs über µk/µs des Modells: das Teil bewegte sich sofort",
    r"no (force|position) was recorded": r"\1 wurde nicht aufgezeichnet",
    r"from the module's summary: (.+)": r"aus der Zusammenfassung des Moduls: \1",
    r"mu_s has been the same (\d+) times in a row, not used":
        r"µs war \1-mal hintereinander gleich, nicht verwendet",
    r"the batch id changes too often to say anything of batches":
        "die Charge wechselt zu oft, um etwas über Chargen zu sagen",
    r"the reference is being learned, (\d+) more cycles":
        r"der Vergleich wird noch gelernt, \1 weitere Zyklen",
    r"aborted by (.+)": r"abgebrochen von \1",
    r"in place": "am Ziel",
}  # fmt: skip
"""Reasons of which a value goes on being shown, as patterns; what is in none of them stays English."""
WORDS: Final = {"force": "Kraft", "position": "Position"}


def english_reason(reason: str) -> str:
    """Write a published reason as the page writes its figures, with their symbols.

    >>> english_reason("mu_s 0.3183 is outside the calibrated 0.15-0.26")
    'µs 0.3183 is outside the calibrated 0.15-0.26'
    """
    return reason.replace("mu_s", "µs").replace("mu_k", "µk")


def german_reason(reason: str) -> str:
    """Say in German, part by part, what a published reason says.

    >>> german_reason("mu_s 0.3183 is outside the calibrated 0.15-0.26; no force was recorded")
    'µs 0,3183 liegt außerhalb des Kalibrierten, 0,15 bis 0,26; Kraft wurde nicht aufgezeichnet'
    """
    return "; ".join(map(_part, reason.split("; ")))


def _part(reason: str) -> str:
    outside = OUTSIDE.fullmatch(reason)
    if outside is not None:
        name, value, unit, low, high, end = (group or "" for group in outside.groups())
        value, low, high = (number.replace(".", ",") for number in (value, low, high))
        return f"{NAMES[name]} {value}{unit} liegt außerhalb des Kalibrierten, {low} bis {high}{end}"
    for pattern, german in GERMAN.items():
        match = re.fullmatch(pattern, reason)
        if match is not None:
            return _expand(match, german)
    return reason


def _expand(match: re.Match[str], german: str) -> str:
    """Put what a pattern found into its sentence: numbers with a comma, words and reasons in German."""
    found = [_part(WORDS.get(group, group)) for group in match.groups()]
    for place, text in enumerate(found, 1):
        german = german.replace(f"\\{place}", re.sub(r"(?<=\d)\.(?=\d)", ",", text))
    return german
