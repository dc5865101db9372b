"""Discrepancy workflow: hidden effects against answers, over campaigns made by the simulator's own plant.

`python -m tests.benchmarks.discrepancy [--rows FILE] [--per 4] [--kinds single,none]` runs the study: a row a
campaign, appended as it is done; what is there already is not done again. `tables` reads the rows.
"""

import argparse
import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from tests.benchmarks.table import Table
from tests.discrepancy.study import ROWS, rows, study

ANSWERS = ("right", "tied", "unknown", "no_gap", "partial", "wrong")


def judged(row: dict[str, Any]) -> str:
    """right, tied, unknown, no_gap or wrong."""
    if row["verdict"] in {"error", "no_gap"}:
        return row["verdict"]
    hidden, named = set(row["hidden"]), list(row["named"])
    if row["verdict"] == "unknown":
        return "unknown" if set(named) <= hidden else "wrong"
    groups = [{effect, *row["tied"].get(effect, [])} for effect in named]
    right = len(groups) == len(hidden) and all(any(one in group for group in groups) for one in hidden)
    if not right:
        missed = all(any(one in hidden for one in group) for group in groups)
        return "partial" if missed and groups else "wrong"
    return "tied" if row["verdict"] == "tied" else "right"


def interval(count: int, total: int) -> str:
    """Wilson interval of a share at 95 %."""
    if not total:
        return "-"
    z, share = 1.96, count / total
    middle = (share + z * z / (2 * total)) / (1 + z * z / total)
    half = z * math.sqrt(share * (1 - share) / total + z * z / (4 * total * total)) / (1 + z * z / total)
    return f"{100 * max(middle - half, 0):.1f}-{100 * min(middle + half, 1):.1f} %"


def share(rows_of: list[dict[str, Any]], accepted: set[str]) -> tuple[str, str]:
    """Share of rows whose judgement is among `accepted`, with its interval."""
    count = sum(judged(row) in accepted for row in rows_of)
    total = len(rows_of)
    measured = f"{count}/{total}" + (f" = {100 * count / total:.1f} %" if total else "")
    return measured, interval(count, total)


def tables(file: Path = ROWS) -> list[Table]:
    """Bars and confusion matrix from the rows there are."""
    found = rows(file)
    gap = [row.get("gap", {}).get("held_out", {}).get("before") or 0.0 for row in found]
    single = [row for row in found if row["kind"] in {"single", "subtle"}]
    size = {row["key"]: value for row, value in zip(found, gap, strict=True)}
    visible = [row for row in single if size[row["key"]] >= 2.0]
    subtle = [row for row in single if 1.2 <= size[row["key"]] <= 1.5]
    confounded = [row for row in single if row["hidden"][0] in {"mass_error", "force_sensor_gain"}]
    none = [row for row in found if row["kind"] == "none"]
    two = [row for row in found if row["kind"] == "two"]
    outside = [row for row in found if row["kind"] == "outside"]
    removed = [row for row in found if row["kind"] == "removed"]
    right = {"right", "tied"}
    bars: list[list[str]] = []

    def bar(what: str, limit: str, rows_of: list[dict[str, Any]], accepted: set[str]) -> None:
        bars.append([what, limit, *share(rows_of, accepted)])

    bar("visible (gap >= 2): named, or tied with it", ">= 95 %", visible, right)
    bar("visible: anything else named", "<= 5 %", visible, {"wrong", "partial"})
    bar("subtle (gap 1.2 to 1.5): named, or tied with it", ">= 80 %", subtle, right)
    bar("subtle: anything else named", "<= 5 %", subtle, {"wrong", "partial"})
    bar("exact confound: tied", "always", [row for row in confounded if row["verdict"] != "no_gap"], {"tied"})
    bar("nothing hidden: something named", "<= 5 %", none, {"wrong", "partial", "right", "tied"})
    bar("two hidden: both right", ">= 85 %", two, right)
    bar("outside the vocabulary: unknown, nothing listed", ">= 80 %", outside, {"unknown"})
    bar("effect removed from the library: wrong name", "<= 5 %", removed, {"wrong", "partial"})
    closed = [row for row in visible if judged(row) in right]
    after = [row["gap"]["held_out"]["after"] for row in closed]
    if after:
        bars.append(
            ["held-out gap after the right effect (median; 95th percentile)", "<= 1.1",
             f"{np.median(after):.3f}; {np.quantile(after, 0.95):.3f}", f"{len(after)} campaigns"]
        )  # fmt: skip
    covered = [one for row in found if judged(row) in right for one in row.get("covered", [])]
    if covered:
        count = sum(covered)
        bars.append(
            ["parameters inside their 95 % intervals", "90-98 %",
             f"{count}/{len(covered)} = {100 * count / len(covered):.1f} %", interval(count, len(covered))]
        )  # fmt: skip
    note = f"{len(found)} campaigns of 30 to 100 shots, made by the simulator's own plant."
    return [
        Table("Discrepancy: bars", ("what", "bar", "measured", "95 % interval"), bars, note),
        confusion(found),
    ]


def confusion(found: list[dict[str, Any]]) -> Table:
    """Effect against answer: named, tied, unknown, nothing, or something else (and what)."""
    lines: list[list[str]] = []
    kinds: dict[str, list[dict[str, Any]]] = {}
    for row in found:
        group = {"single": "", "subtle": "", "none": "nothing", "two": "two effects"}.get(
            row["kind"], row["kind"]
        )
        name = row["hidden"][0] if not group else group if row["kind"] in {"none", "two"} else ""
        name = name or (
            f"{row['hidden'][0]}, {'not in any library' if row['kind'] == 'outside' else 'removed'}"
        )
        kinds.setdefault(name, []).append(row)
    for name in sorted(kinds):
        answers = [judged(row) for row in kinds[name]]
        others = sorted(
            {"+".join(row["named"]) for row in kinds[name] if judged(row) in {"wrong", "partial"}}
        )
        lines.append(
            [name, *(str(answers.count(one)) for one in ANSWERS),
             ", ".join(others)]
        )  # fmt: skip
    columns = ("hidden", "named", "tied with it", "unknown", "no gap", "one of two", "wrong", "named instead")
    return Table("Discrepancy: hidden effect against answer", columns, lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=Path, default=ROWS)
    parser.add_argument("--per", type=int, default=2)
    parser.add_argument("--kinds", default="")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--table", action="store_true", help="only print the tables of the rows there are")
    given = parser.parse_args()
    if not given.table:
        study(given.rows, given.per, set(filter(None, given.kinds.split(","))), given.workers)
    for made in tables(given.rows):
        print(made.markdown())
