"""The tour that the page gives of a demo: what happens in the scenario, when, and where it can be seen."""

from collections.abc import Mapping
from typing import Any

from impactcell.web import TourStop

WEAR = "Trend of the cell: the level rises towards the dashed limit, and the cycles left become fewer."
POSITIONING = "Positioning on the page of the cell: target, what remains, and the tap that comes next."
KNOWN_BATCH = "Trend of the cell: a mark where the batch begins; its offset is learned within some cycles."
UNKNOWN_BATCH = "Alarms: “Batch shift” comes by itself, with its evidence. Acknowledge it, with a comment."
DEVIATION = (
    "Friction along the stroke: the dashed curve and the place where it deviates; alarm “Deviant cycle”."
)
APPEARANCE = (
    "Model and gap: the gap rises above 1 and the alarm “Model gap” comes. Then the workflow names the "
    "effect, the extended model goes into service by itself, and the gap closes."
)
MEASUREMENTS = "Measurements: drop a CSV of your own there; it is read, studied and compared with this cell."


def tour(content: Mapping[str, Any]) -> tuple[TourStop, ...]:
    """List what a scenario has in store, in its order."""
    stops = [TourStop(1, "The surface wears: µs grows slowly.", WEAR)] if content.get("wear") else []
    if content.get("positioning"):
        stops.append(
            TourStop(1, "Parts come one after the other and are tapped to their targets.", POSITIONING)
        )
    for batch in content.get("batches", []):
        if batch["from_cycle"] > 1:
            is_told = batch.get("announced", True)
            what = (
                f"Batch {batch['id']} is on the table{'' if is_told else ', and the PLC says nothing of it'}."
            )
            stops.append(TourStop(batch["from_cycle"], what, KNOWN_BATCH if is_told else UNKNOWN_BATCH))
    for deviation in content.get("deviations", []):
        what = f"One cycle is odd: a {deviation['kind']} along its stroke."
        stops.append(TourStop(deviation["cycle"], what, DEVIATION))
    for entry in content.get("appearances", []):
        names = ", ".join(entry["effects"]).replace("_", " ")
        stops.append(TourStop(entry["from_cycle"], f"A new effect acts in the plant: {names}.", APPEARANCE))
    last = max((stop.cycle for stop in stops), default=1)
    return (*sorted(stops, key=lambda stop: stop.cycle), TourStop(last, "Your turn.", MEASUREMENTS))
