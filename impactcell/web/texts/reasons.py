"""Why a value is uncertain or missing, as the page says it; reasons are published in English over OPC UA."""

import re
from typing import Final

from impactcell.web.texts.tap_reasons import TAP_REASONS

OUTSIDE: Final = re.compile(
    r"(mass|velocity|mu_s) (\S+)( \S+)? is outside the calibrated (\S+?)-(\S+?)( \S+)?", re.ASCII
)
"""A tap whose mass, velocity or friction the model was not calibrated for."""
NAMES: Final = {"mass": "Masse", "velocity": "Geschwindigkeit", "mu_s": "µs"}
GERMAN: Final = {
    r"stroke (.+) is not the (.+) of the calibration": r"Hub \1 ist nicht der der Kalibrierung, \2",
    r"residuals are (\S+) times the sensors' noise: the model lacks something":
        r"die Abweichung ist \1-mal das Rauschen der Sensoren: dem Modell fehlt etwas",
    r"the tap is that of (\S+) kg, not (\S+) kg: check the mass":
        r"dieser Stoß ist der von \1 kg, nicht \2 kg: Masse prüfen",
    r"the tap is that of (\S+) mm/min, not (\S+) mm/min: check the velocity":
        r"dieser Stoß ist der von \1 mm/min, nicht \2 mm/min: Geschwindigkeit prüfen",
    r"the force is (\S+) times that of the model: check its scale":
        r"die Kraft ist \1-mal die des Modells: ihren Maßstab prüfen",
    r"the position is (\S+) times that of the model: check its scale":
        r"der Weg ist \1-mal der des Modells: seinen Maßstab prüfen",
    r"mu_s through mu_k/mu_s of the model: the part moved at once":
        "µs über µk/µs des Modells: das Teil bewegte sich sofort",
    r"no (force|position) was recorded": r"\1 wurde nicht aufgezeichnet",
    r"from the module's summary: (.+)": r"aus der Zusammenfassung des Moduls: \1",
    r"peak force says mu_s (\S+), sliding distance (\S+): mass, velocity, or the scale of one of them is "
    r"wrong, or the model":
        r"die Spitzenkraft sagt µs \1, der Gleitweg \2: Masse, Geschwindigkeit oder der Maßstab einer der "
        r"beiden ist falsch, oder das Modell",
    r"mu_s has been the same (\d+) times in a row, not used":
        r"µs war \1-mal hintereinander gleich, nicht verwendet",
    r"mu_s has been the same (\d+) times in a row, not used: a sensor is stuck, or values are rounded "
    r"coarser than they scatter and need more decimals":
        r"µs war \1-mal hintereinander gleich, nicht verwendet: ein Sensor hängt, oder die Werte sind gröber "
        r"gerundet, als sie streuen, und brauchen mehr Nachkommastellen",
    r"mu_s is missing, the cycle is not used": "µs fehlt, der Zyklus wird nicht verwendet",
    r"mu_s is infinite, the cycle is not used": "µs ist unendlich, der Zyklus wird nicht verwendet",
    r"mu_s = (\S+) is outside (\S+) \.\. (\S+), the cycle is not used":
        r"µs = \1 liegt außerhalb von \2 bis \3, der Zyklus wird nicht verwendet",
    r"the standard deviation of mu_s is zero, the usual one is used":
        "die Standardabweichung von µs ist null, die übliche wird verwendet",
    r"the standard deviation of mu_s is (\S+), the usual one is used":
        r"die Standardabweichung von µs ist \1, die übliche wird verwendet",
    r"cycle (\d+) came twice, the second is ignored": r"Zyklus \1 kam zweimal, der zweite zählt nicht",
    r"cycle (\d+) came again, ignored": r"Zyklus \1 kam noch einmal und zählt nicht",
    r"cycle (\d+) came 1 cycle late": r"Zyklus \1 kam einen Zyklus zu spät",
    r"cycle (\d+) came (\d+) cycles late": r"Zyklus \1 kam \2 Zyklen zu spät",
    r"cycle number (\d+) after (\d+) is in doubt, not used":
        r"die Zyklusnummer \1 nach \2 ist zweifelhaft, nicht verwendet",
    r"cycle numbers restarted at (\d+)": r"die Zyklusnummern begannen neu bei \1",
    r"the clock went back by (\S+) s": r"die Uhr ging um \1 s zurück",
    r"friction is found to go steadily from cycle to cycle, the past is seen so from here on":
        "die Reibung ändert sich, wie sich zeigt, von Zyklus zu Zyklus stetig; so wird die "
        "Vergangenheit von nun an gesehen",
    r"friction is found to go unsteadily from cycle to cycle, the past is seen so from here on":
        "die Reibung ändert sich, wie sich zeigt, von Zyklus zu Zyklus unstetig; so wird die "
        "Vergangenheit von nun an gesehen",
    r"the cycle is from before wear changed its rate, not used":
        "der Zyklus ist von vor der Änderung der Verschleißrate, nicht verwendet",
    r"since cycle (-?\d+) mu_s goes by (\S+) ± (\S+) in 1000 cycles, (\S+) before":
        r"seit Zyklus \1 ändert sich µs um \2 ± \3 in 1000 Zyklen, davor um \4",
    r"no change of batch is reported yet: the scale of the noise is still being learned":
        "noch wird kein Chargenwechsel gemeldet: die Größe des Rauschens wird noch gelernt",
    r"the batch id changes too often to say anything of batches":
        "die Charge wechselt zu oft, um etwas über Chargen zu sagen",
    r"the reference is being learned, 1 more cycle":
        "der Vergleich wird noch gelernt, ein weiterer Zyklus",
    r"the reference is being learned, (\d+) more cycles":
        r"der Vergleich wird noch gelernt, \1 weitere Zyklen",
    **TAP_REASONS,
}  # fmt: skip
"""Why a value is doubted, and why a tap shows none, as patterns; what is in none of them stays English."""
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
