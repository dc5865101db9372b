"""The picture of the rooms, drawn from the import contract that `make lint` holds."""

import tomllib
from html import escape
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
WIDTH, FLOOR, GAP, MARGIN = 860, 46, 12, 20
"""Of the picture, of a floor, between floors and around all, in px."""
COLOURS = {True: ("#ecfccb", "#4d7c0f"), False: ("#dbeafe", "#1d4ed8")}
"""Fill and edge of a room: pure ones green, those at the edge blue."""


def contracts(kind: str) -> list[dict[str, Any]]:
    """Give the import contracts of a kind, as `pyproject.toml` has them."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        every = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    return [contract for contract in every if contract["type"] == kind]


def pure_rooms() -> set[str]:
    """Rooms that may import nothing that talks, as a whole."""
    (core,) = [contract for contract in contracts("forbidden") if "asyncio" in contract["forbidden_modules"]]
    return {module.removeprefix("impactcell.") for module in core["source_modules"]}


def floors() -> list[list[str]]:
    """Rooms of each floor, from the top; a floor imports only from those below it."""
    layers = contracts("layers")[0]["layers"]
    return [[room.strip() for room in layer.replace(":", "|").split("|")] for layer in layers]


def drawing() -> str:
    """Draw the floors as SVG, readable on a light and on a dark page."""
    stacked, pure = floors(), pure_rooms()
    height = len(stacked) * (FLOOR + GAP) - GAP + 2 * MARGIN
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" role="img">',
        '<g font-family="sans-serif" font-size="15">',
        "<title>Rooms of impactcell in floors; imports go down only</title>",
        f'<rect width="{WIDTH}" height="{height}" rx="8" fill="#ffffff"/>',
    ]
    for number, rooms in enumerate(stacked):
        top = MARGIN + number * (FLOOR + GAP)
        width = (WIDTH - 2 * MARGIN - (len(rooms) - 1) * GAP) / len(rooms)
        for place, room in enumerate(rooms):
            left = MARGIN + place * (width + GAP)
            fill, stroke = COLOURS[room in pure]
            parts.append(
                f'<rect x="{left:.0f}" y="{top}" width="{width:.0f}" height="{FLOOR}" rx="6" '
                f'fill="{fill}" stroke="{stroke}"/>'
                f'<text x="{left + width / 2:.0f}" y="{top + FLOOR / 2 + 5:.0f}" text-anchor="middle" '
                f'fill="#111827">{escape(room)}</text>'
            )
    return "\n".join([*parts, "</g>", "</svg>\n"])
