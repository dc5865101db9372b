"""Discrepancy workflow: hidden effects against answers, over campaigns made by the simulator's own plant.

`python -m tests.benchmarks.discrepancy [--workers 2]` runs the study, a row a campaign appended to `--rows`
as it is done; what is there already is not done again. `--later N` makes campaigns that no earlier study has
seen. `--rivals` runs the rivals on every third campaign of
these rows, into a file of their own beside them. `--table` only prints the tables of the rows there are, and
`--readme` writes them into the README of the workflow, below the marker in its section on the study.
"""

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.benchmarks import _discrepancy_judge as judge
from tests.benchmarks import _discrepancy_rivals as rivals
from tests.benchmarks._discrepancy_judge import judged
from tests.benchmarks._discrepancy_plan import CONFOUNDED, jobs, measured_jobs
from tests.benchmarks._discrepancy_run import ROWS, rows, study
from tests.benchmarks.table import Table
from tests.discrepancy.study import LOGGED, TOLD

Row = dict[str, Any]
README = Path("impactcell/discrepancy/README.md")
MARKER = "<!-- tables of the study -->\n"
NAMED = {judge.RIGHT, judge.TIED}
FALSELY = {judge.WRONG, judge.PARTIAL, judge.FALSE}
MEASURED = {
    LOGGED: "contact anywhere between two samples",
    TOLD: "velocities and masses a little off what is told",
}
"""What is measured and not exact, by how the kinds of its jobs begin."""
NAMES = {
    judge.RIGHT: "named",
    judge.TIED: "tied with it",
    judge.EQUAL: "near-equivalent",
    judge.NO_GAP: "no gap",
    judge.PARTIAL: "part of it",
    judge.FALSE: "unknown, wrong beside",
}


def kept(found: list[Row], kind: str) -> list[Row]:
    """Rows of a kind of job; `visible` and `subtle` go by the measured held-out gap."""
    if kind in {"visible", "subtle"}:
        low, high = (2.0, np.inf) if kind == "visible" else (1.2, 1.5)
        alone = [row for row in found if row["job"]["kind"] in {"single", "subtle"} and "gap" in row]
        return [row for row in alone if low <= row["gap"]["held_out"]["before"] <= high]
    return [row for row in found if row["job"]["kind"] == kind]


def tables(file: Path = ROWS) -> list[Table]:
    """Bars, hidden effect against answer, and the rivals, from the rows there are."""
    found = rows(file)
    for measured in MEASURED:
        if its := [row for row in found if row["job"]["kind"].startswith(measured)]:
            return [bars_of_measured(measured, its)]
    rival = rivals.table(found, rows(rivals.beside(file)))
    return [bars(found), *([rival] if rival else []), confusion(found), reach(found)]


def bars(found: list[Row]) -> Table:
    """The bars of the study, each with its interval."""
    made: list[list[str]] = []

    def bar(what: str, limit: str, of: list[Row], holds: Callable[[Row], bool]) -> None:
        made.append([what, limit, *judge.share(sum(map(holds, of)), len(of))])

    def among(answers: set[str]) -> Callable[[Row], bool]:
        return lambda row: judged(row) in answers

    visible, subtle = kept(found, "visible"), kept(found, "subtle")
    confounded = [row for row in [*visible, *subtle] if row["job"]["hidden"][0] in CONFOUNDED]
    outside = kept(found, "outside")
    bar("visible (gap >= 2): named, or tied with it", ">= 95 %", visible, among(NAMED))
    bar("visible: anything else named", "<= 5 %", visible, among(FALSELY))
    bar("subtle (gap 1.2 to 1.5): named, or tied with it", ">= 80 %", subtle, among(NAMED))
    bar("subtle: anything else named", "<= 5 %", subtle, among(FALSELY))
    bar("exact confound: tied, with what would break it", "always", confounded, judge.confound_said)
    bar("nothing hidden: something named", "<= 5 %", kept(found, "none"), lambda row: bool(row.get("named")))
    bar("nothing hidden: unknown or failed", "-", kept(found, "none"), among({judge.UNKNOWN, judge.ERROR}))
    bar("two hidden: both right", ">= 85 %", kept(found, "two"), among(NAMED))
    three = kept(found, "three")
    if three:
        bar("three hidden: all right", ">= 70 %", three, among(NAMED))
        bar("three hidden: something wrong", "<= 5 %", three, among({judge.WRONG, judge.FALSE}))
    bar("outside the vocabulary: unknown", ">= 90 %", outside, lambda row: row["verdict"] == judge.UNKNOWN)
    bar("outside: unknown, with the right phase", ">= 90 %", outside, judge.phase_right)
    bar("outside: nothing falsely listed", ">= 80 %", outside, lambda row: not row.get("named"))
    removed = kept(found, "removed")
    bar("removed from the library: a wrong name", "<= 5 %", removed, among({judge.WRONG, judge.FALSE}))
    made += closed([row for row in visible if judged(row) in NAMED])
    right = [row for row in found if row["job"]["hidden"] and judged(row) in NAMED]
    true = [row for row in right if set(row["named"]) == set(row["job"]["hidden"])]
    for what, limit, key, counted in (
        ("parameters of effects inside their 95 % intervals", "93.5-96.5 %", "effects", right),
        ("parameters of the plant beside them, the true model named", "-", "nominal", true),
    ):
        inside = [one for row in counted for one in row["covered"][key]]
        made.append([what, limit, *judge.share(sum(inside), len(inside))])
    seconds = [row["seconds"] for row in found if row["job"]["shots"] == 60 and "seconds" in row]
    if seconds:
        median, late = np.median(seconds), np.quantile(seconds, 0.95)
        made.append(
            ["processor time of 60 shots (median; 95th percentile)", "-", f"{median:.1f}; {late:.1f} s", ""]
        )
    alone, none = (sum(bool(row["job"]["hidden"]) is said for row in found) for said in (True, False))
    note = f"{alone} campaigns with hidden effects and {none} without, made by the simulator's own plant."
    return Table("Discrepancy: bars", ("what", "bar", "measured", "95 % interval"), made, note)


def bars_of_measured(measured: str, found: list[Row]) -> Table:
    """What becomes of an answer where a record does not tell all of a shot exactly."""
    made: list[list[str]] = []

    def bar(what: str, limit: str, of: list[Row], holds: Callable[[Row], bool]) -> None:
        made.append([what, limit, *judge.share(sum(map(holds, of)), len(of))])

    one, none, outside = (kept(found, f"{measured}{kind}") for kind in ("", " none", " outside"))
    bar("one hidden, visible: named, or tied with it", ">= 95 %", one, lambda row: judged(row) in NAMED)
    bar("one hidden: anything else named", "<= 5 %", one, lambda row: judged(row) in FALSELY)
    bar("nothing hidden: something named", "<= 5 %", none, lambda row: bool(row.get("named")))
    bar("nothing hidden: no gap", "-", none, lambda row: judged(row) == judge.NO_GAP)
    bar("outside the vocabulary: unknown", ">= 90 %", outside, lambda row: row["verdict"] == judge.UNKNOWN)
    bar("outside: nothing falsely listed", ">= 80 %", outside, lambda row: not row.get("named"))
    return Table(
        f"Discrepancy: {MEASURED[measured]}",
        ("what", "bar", "measured", "95 % interval"),
        made,
        f"{len(found)} campaigns.",
    )


def closed(right: list[Row]) -> list[list[str]]:
    """Held-out gap after the right effect: of the traces alone, and the larger of traces and factors."""
    if not right:
        return []
    made = []
    for what, limit, after in (
        ("of traces", "<= 1.1", [row["gap"]["parts"]["held_out"]["after"]["traces"] for row in right]),
        ("of traces or factors", "<= 1.1", [row["gap"]["held_out"]["after"] for row in right]),
    ):
        middle, late = np.median(after), np.quantile(after, 0.95)
        under = f"{100 * np.mean(np.array(after) <= 1.1):.0f} % are"
        made.append(
            [
                f"held-out gap {what} after (median; 95th percentile)",
                limit,
                f"{middle:.3f}; {late:.3f}",
                under,
            ]
        )
    return made


def confusion(found: list[Row]) -> Table:
    """Effect against answer: named, tied, unknown, nothing, or something else (and what)."""
    suffix = {"outside": ", not in any library", "removed": ", removed"}
    kinds: dict[str, list[Row]] = {}
    for row in found:
        kind = row["job"]["kind"]
        name = {"none": "nothing", "two": "two effects", "three": "three effects"}.get(kind) or row["job"][
            "hidden"
        ][0]
        kinds.setdefault(name + suffix.get(kind, ""), []).append(row)
    lines = []
    for name in sorted(kinds, key=lambda one: ("," in one, one)):
        answers = [judged(row) for row in kinds[name]]
        others = sorted({"+".join(row["named"]) for row in kinds[name] if judged(row) in FALSELY})
        counts = [str(answers.count(one) or "") for one in judge.ANSWERS]
        lines.append([name, *counts, ", ".join(others)])
    columns = ("hidden", *(NAMES.get(one, one) for one in judge.ANSWERS), "named instead")
    return Table("Discrepancy: hidden effect against answer", columns, lines)


def reach(found: list[Row]) -> Table:
    """Strengths and gaps of every effect as they were calibrated, and where no sensible strength sufficed."""
    lines = []
    alone = [row for row in found if row["job"]["kind"] in {"single", "removed", "outside"} and "gap" in row]
    for effect in sorted({row["job"]["hidden"][0] for row in alone}):
        mine = [row for row in alone if row["job"]["hidden"][0] == effect]
        multiples = sorted(row["multiples"][0] for row in mine)
        gaps = sorted(row["gap"]["held_out"]["before"] for row in mine)
        short = sum(row["expected"][0] < 2.0 for row in mine)
        lines.append(
            [effect, f"{multiples[0]:.3g} to {multiples[-1]:.3g}", f"{gaps[0]:.2f} to {gaps[-1]:.2f}",
             f"in {short} of {len(mine)}" if short else ""]
        )  # fmt: skip
    columns = ("effect", "multiples of the default strength", "held-out gap before", "out of reach of 2")
    note = "Strengths are calibrated to gaps of 2.3 to 6, on 24 shots, up to 6 times the simulator's default."
    return Table("Discrepancy: visible campaigns, as they were made", columns, lines, note)


def write_readme(made: list[Table], file: Path = README) -> None:
    """Put the tables into the README, in the place of those that are there."""
    text, _, _ = file.read_text(encoding="utf-8").partition(MARKER)
    file.write_text(text + MARKER + "\n" + "\n".join(one.markdown() for one in made), encoding="utf-8")


def main() -> None:
    """Run what the arguments say, then print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=Path, default=ROWS)
    parser.add_argument("--kinds", default="", help="only these kinds of jobs, comma-separated")
    parser.add_argument("--limit", type=int, help="only the first so many jobs of the plan")
    parser.add_argument("--later", type=int, default=0, help="add this to every seed: campaigns never seen")
    parser.add_argument("--three", type=int, default=0, help="so many campaigns of three effects as well")
    for measured, what in MEASURED.items():
        parser.add_argument(f"--{measured}", action="store_true", help=f"only campaigns with {what}")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--rivals", action="store_true", help="run the rivals on every third campaign")
    parser.add_argument("--table", action="store_true", help="only print the tables of the rows there are")
    parser.add_argument("--readme", action="store_true", help="write these tables into the README, too")
    given = parser.parse_args()
    wanted = set(filter(None, given.kinds.split(",")))
    every = jobs(later=given.later, three=given.three)
    for measured in MEASURED:
        if getattr(given, measured):
            every = measured_jobs(measured, given.later)
    plan = [job for job in every if not wanted or job.kind in wanted][: given.limit]
    if given.rivals:
        study(rivals.beside(given.rows), rivals.subset(plan, rows(given.rows)), given.workers, rivals.run)
    elif not (given.table or given.readme):
        study(given.rows, plan, given.workers)
    made = tables(given.rows)
    for one in made:
        print(one.markdown())
    if given.readme:
        write_readme(made)


if __name__ == "__main__":
    main()
