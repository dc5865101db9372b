"""The tour that the page gives of a demo: what happens in the scenario, when, and where it can be seen."""

from collections.abc import Mapping
from typing import Any

from impactcell.alarms import Message
from impactcell.german.findings import german_effect
from impactcell.physics.effect_names import in_words
from impactcell.web import TourStop

WEAR = Message(
    "Trend of the cell: the level rises towards the dashed limit, and the cycles left become fewer.",
    "Verlauf der Zelle: der Verschleiß steigt zur gestrichelten Grenze, es bleiben immer weniger Zyklen.",
)
POSITIONING = Message(
    "Positioning on the page of the cell: target, what remains, and the tap that comes next.",
    "Positionieren auf der Seite der Zelle: Ziel, was noch fehlt, und der nächste Stoß.",
)
KNOWN_BATCH = Message(
    "Trend of the cell: a mark where the batch begins; its offset is learned within some cycles.",
    "Verlauf der Zelle: ein Strich, wo die Charge beginnt; ihr Versatz ist in einigen Zyklen gelernt.",
)
UNKNOWN_BATCH = Message(
    "Alarms: “Batch shift” comes by itself, with its evidence. Acknowledge it, with a comment.",
    "Alarme: „Chargenwechsel“ kommt von selbst, mit seinem Nachweis. Quittieren Sie ihn, mit Kommentar.",
)
DEVIATION = Message(
    "Friction along the slide: the dashed curve and the place where it deviates; alarm “Deviant cycle”.",
    "Reibung entlang des Gleitwegs: die gestrichelte Kurve und die Stelle, wo sie abweicht; Alarm "
    "„Abweichender Zyklus“.",
)
APPEARANCE = Message(
    "Model and gap: the gap rises above 1 and the alarm “Model gap” comes. Then the workflow names the "
    "effect, the extended model goes into service by itself, and the gap closes.",
    "Modell und Abweichung: sie steigt über 1, und der Alarm „Modelllücke“ kommt. Dann nennt der Ablauf "
    "den Effekt, das erweiterte Modell geht von selbst in Betrieb, und die Abweichung schließt sich.",
)
MEASUREMENTS = Message(
    "Measurements: drop a CSV of your own there; it is read, studied and compared with this cell.",
    "Messungen: legen Sie dort eine eigene CSV ab; sie wird gelesen, untersucht und mit dieser Zelle "
    "verglichen.",
)
KINDS = {
    "bump": "eine Erhebung",
    "level": "eine andere Höhe",
    "tilt": "eine Neigung",
    "ripple": "eine Welligkeit",
}
"""Kinds of deviations in German."""


def tour(content: Mapping[str, Any]) -> tuple[TourStop, ...]:
    """List what a scenario has in store, in its order."""
    wears = Message("The surface wears: µs grows slowly.", "Die Oberfläche verschleißt: µs wächst langsam.")
    stops = [TourStop(1, wears, WEAR)] if content.get("wear") else []
    if content.get("positioning"):
        placed = Message(
            "Parts come one after the other and are tapped to their targets.",
            "Teile kommen eins nach dem anderen und werden an ihre Ziele gestoßen.",
        )
        stops.append(TourStop(1, placed, POSITIONING))
    for batch in content.get("batches", []):
        if batch["from_cycle"] > 1:
            is_told = batch.get("announced", True)
            english, german = (
                f"Batch {batch['id']} is on the table",
                f"Charge {batch['id']} liegt auf dem Tisch",
            )
            what = Message(f"{english}.", f"{german}.")
            if not is_told:
                what = Message(
                    f"{english}, and the PLC says nothing of it.", f"{german}, und die SPS sagt nichts davon."
                )
            stops.append(TourStop(batch["from_cycle"], what, KNOWN_BATCH if is_told else UNKNOWN_BATCH))
    for deviation in content.get("deviations", []):
        kind = deviation["kind"]
        what = Message(
            f"One cycle is odd: a {kind} along its slide.",
            f"Ein Zyklus ist anders: {KINDS[kind]} entlang seines Gleitwegs.",
        )
        stops.append(TourStop(deviation["cycle"], what, DEVIATION))
    for entry in content.get("appearances", []):
        what = Message(
            f"A new effect acts in the plant: {', '.join(map(in_words, entry['effects']))}.",
            f"Ein neuer Effekt wirkt: {', '.join(map(german_effect, entry['effects']))}.",
        )
        stops.append(TourStop(entry["from_cycle"], what, APPEARANCE))
    yours = Message("Your turn.", "Jetzt Sie.")
    return (*sorted(stops, key=lambda stop: stop.cycle or 0), TourStop(None, yours, MEASUREMENTS))
