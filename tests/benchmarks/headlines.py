"""README's five lines of results, printed from the stored tables: `python -m tests.benchmarks.headlines`.

Every number in a line is a cell of a table; a line says no more than its row. `--write` puts them into
README, and a test fails when README says anything else.
"""

import argparse
import re
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
RESULTS = "tests/benchmarks/RESULTS.md"
STUDY = "impactcell/discrepancy/README.md"
HIDDEN = "Positioning with an effect hidden, by effect"
TOLD = "mu_s where mass, velocity or the scale of the force is told a little wrong"
BEGIN, END = "<!-- headlines -->\n", "<!-- end of headlines -->\n"


@dataclass(frozen=True, slots=True)
class Cell:
    """One cell of a stored table: the file, the table's title, the first cell of its row, its column."""

    file: str
    title: str
    row: str
    column: str


def _of(title: str, column: str, file: str = RESULTS, **rows: str) -> Mapping[str, Cell]:
    return {name: Cell(file, title, row, column) for name, row in rows.items()}


HEADLINES: tuple[tuple[str, Mapping[str, Cell]], ...] = (
    (
        (
            "**Estimate.** Error of one tap's waveform estimate over the Bayesian bound, 2000-6000 mm/min, "
            "simulated sensors: {mu_s} for mu_s, {mu_k} for mu_k. As cells take taps, mass 1 % off: mu_s to "
            "{rms}, {good} Good, {far} of its standard deviations off at most."
        ),
        {
            **_of(
                "Waveform estimate against the Bayesian Cramér-Rao bound",
                "RMSE / bound",
                mu_s="mu_s, all mm/min",
                mu_k="mu_k, all mm/min",
            ),
            **_of(TOLD, "RMS error", rms="mass, 1 %, as measured"),
            **_of(TOLD, "Good", good="mass, 1 %, as measured"),
            **_of(TOLD, "largest / std", far="mass, 1 %, as measured"),
        },
    ),
    (
        (
            "**Follow.** `track` on 300 streams with wear, outliers and unknown batches: a step of 1 / 2 "
            "standard deviations is found after {one} / {two} times the least possible delay, those not "
            "found counted to the next step; {false} false alarms in 100 000 cycles."
        ),
        _of(
            "Batches and slope through `track`, batch unknown",
            "measured",
            one="delay / bound, 1 sd",
            two="delay / bound, 2 sd",
            false="false batch alarms per 100 000 cycles",
        ),
    ),
    (
        (
            "**Explain.** One effect hidden in a simulated campaign, gap of 2 or more: named, or tied with "
            "it, in {named}; nothing hidden: something named in {nothing}. On public records of three real "
            "machines, which the method was looked at with, it names what their authors or others found; "
            "error of the simulation on held-out records over a least-squares model with the authors' own "
            "terms: pendulum {pendulum}, servo {servo}, seals {pk} / {o_ring} / {kdn}."
        ),
        {
            **_of(
                "Discrepancy: bars",
                "measured",
                STUDY,
                named="visible (gap >= 2): named, or tied with it",
                nothing="nothing hidden: something named",
            ),
            **_of(
                "Discrepancy: real records",
                "error over the authors'",
                STUDY,
                pendulum="free-pendulum",
                servo="servo-pendulum",
                pk="seal-PK",
                o_ring="seal-O-ring",
                kdn="seal-KDN",
            ),
        },
    ),
    (
        (
            "**Place.** Parts tapped to their targets on the simulator's plant: {inside} inside the "
            "tolerance after ten tasks; overshoot {overshoot}. With each of 25 effects hidden in turn: "
            "{hidden_inside}; {hidden_overshoot}, where 0.1 % is promised."
        ),
        {
            **_of(
                "Positioning: closed loop with learning, judged on the simulator's plant",
                "measured",
                inside="inside the tolerance, after ten tasks",
                overshoot="tasks that overshoot, overall",
            ),
            **_of(HIDDEN, "inside after ten", hidden_inside="all"),
            **_of(HIDDEN, "overshot", hidden_overshoot="all"),
        },
    ),
    (
        "**Keep.** The service killed at {moments} random moments: cycles lost of 755: {lost}.",
        {
            "moments": Cell(RESULTS, "crashes", "`kill -9` at random moments", "bar"),
            "lost": Cell(RESULTS, "crashes", "cycles lost, of 755", "measured"),
        },
    ),
)
"""Each line, and where its numbers stand."""


def read(cell: Cell) -> str:
    """Read one cell of a stored table.

    Raises
    ------
    LookupError
        The file has no such table, row or column.
    """
    text = (ROOT / cell.file).read_text(encoding="utf-8")
    section = re.search(rf"^#+ {re.escape(cell.title)}\n(.*?)(?=^#|\Z)", text, flags=re.DOTALL | re.MULTILINE)
    if section is None:
        raise LookupError(f"{cell.file}: no table {cell.title!r}")
    lines = [line for line in section[1].splitlines() if line.startswith("|")]
    rows = [[part.strip() for part in line.strip("|").split("|")] for line in lines]
    for row in rows[2:]:
        if row[0] == cell.row:  # the first of several: records as they are, not disturbed
            return row[rows[0].index(cell.column)]
    raise LookupError(f"{cell.file}: {cell.title!r} has no row {cell.row!r}")


def lines() -> list[str]:
    """Write the five lines."""
    return [
        f"- {text.format(**{name: read(cell) for name, cell in cells.items()})}" for text, cells in HEADLINES
    ]


def block() -> str:
    """Write the lines as README has them, at most 118 characters each."""
    wrapped = []
    for line in lines():
        rest = ""
        for word in line.split(" "):
            if len(rest) + len(word) + 1 > 118:
                wrapped.append(rest)
                rest = "  " + word
            else:
                rest = f"{rest} {word}" if rest else word
        wrapped.append(rest)
    return BEGIN + "\n".join(wrapped) + "\n" + END


def written(readme: str) -> str:
    """Put the lines into README's text."""
    return re.sub(f"{BEGIN}.*?{END}", lambda _: block(), readme, flags=re.DOTALL)


def main() -> int:
    """Print the lines, or write them."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.headlines", description=__doc__)
    parser.add_argument("--write", action="store_true", help="put them into README.md")
    if parser.parse_args().write:
        README.write_text(written(README.read_text(encoding="utf-8")), encoding="utf-8")
    print(*lines(), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
