"""Laws that nobody had listed: effects taken out of the library one by one, laws it never had, and nothing.

Reads what `python -m tests.benchmarks._laws_run` has gathered, and says how much that is; runs one campaign
where there is nothing yet.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from operator import lt
from typing import Any

import numpy as np

from tests.benchmarks._laws_run import (
    FASTER,
    FUNCTIONS,
    NONE,
    OTHERS,
    ROWS,
    SHOTS,
    STRENGTH,
    Hidden,
    job_of,
    run,
)
from tests.benchmarks._null_laws_run import ROWS as NULL_ROWS
from tests.benchmarks._null_laws_run import SHOTS as NULL_SHOTS
from tests.benchmarks._pair_laws_run import KINDS, PLACES
from tests.benchmarks._pair_laws_run import ROWS as PAIR_ROWS
from tests.benchmarks.positioning import Share
from tests.benchmarks.table import Table

LARGEST_GAP, LARGEST_ERROR = 1.2, 0.05
"""Held-out gap in noise floors, and relative error of the function, up to which a law counts as found."""
LARGEST_FASTER_GAP = 1.5
"""The same at velocities that no tap had, unless the covariate is beyond the range that the report gives."""
RIVALS = {"gaussian_process": "Gaussian process", "sindy": "PySINDy", "operon": "pyoperon"}
Row = dict[str, Any]


def rows_of(effect: str, rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row["effect"] == effect]


def proposed(row: Row) -> bool:
    return row["law"] is not None and not row["law"]["refused"]


def closes(row: Row) -> bool:
    return proposed(row) and row["law"]["after"] <= LARGEST_GAP


def is_right_form(item: Hidden) -> Callable[[Row], bool]:
    def right(row: Row) -> bool:
        law = row["law"]
        return (
            proposed(row) and law["place"] == item.place and item.form in {law["form"], *law["equivalents"]}
        )

    return right


def is_exact(row: Row) -> bool:
    return proposed(row) and row["law"]["error"] is not None and row["law"]["error"] <= LARGEST_ERROR


def holds_faster(row: Row) -> bool:
    faster = row["law"]["faster"]
    return faster["beyond"] or faster["after"] <= LARGEST_FASTER_GAP


def line(what: str, bar: str, share: Share, *, met: bool) -> list[str]:
    if not share.of:
        return [what, bar, "not run", ""]
    value = f"{share.hits}/{share.of} = {100 * share.hits / max(share.of, 1):.1f} %"
    return [what, bar, value if met else f"**{value}**", share.interval]


def _median_gap(rows: Sequence[Row]) -> str:
    gaps = [row["law"]["faster"]["after"] for row in rows if row["law"]["faster"]["beyond"]]
    return f"{float(np.median(gaps)):.2f}" if gaps else "not known"


def pair_table() -> list[Table]:
    """Laws of two covariates, where the study of them has been run."""
    if not PAIR_ROWS.exists():
        return []
    rows: list[Row] = [json.loads(text) for text in PAIR_ROWS.read_text().splitlines()]
    detail = []
    for kind in KINDS:
        of = [row for row in rows if row["kind"] == kind]
        if not of:
            continue
        laws = [row["law"] for row in of if proposed(row)]
        right = [law for law in laws if kind in PLACES and law["place"].startswith(PLACES[kind])]
        errors = [law["error"] for law in right if law["error"] is not None]
        detail.append(
            [
                kind,
                str(len(of)),
                str(sum(bool(row["added"]) for row in of)),
                str(len(laws)),
                str(len(right)) if kind in PLACES else "",
                str(sum(law["after"] <= LARGEST_GAP for law in right)) if kind in PLACES else "",
                f"{100 * float(np.median(errors)):.1f} %" if errors else "",
                "; ".join(dict.fromkeys(law["form"] or "spline only" for law in laws)),
            ]
        )
    columns = ("hidden", "campaigns", "named", "law", "its place", "gap to 1.2", "error of force", "forms")
    note = (
        "Campaigns of 48 shots (nothing hidden: 24), `_pair_laws_run`. `oil`: viscous friction that halves "
        "every 9 degrees of a column; `wedge`: drag over 1 - x/L, no form of the grammar; the rest: no "
        "function of one or two covariates, and a column that does nothing. Law: one was proposed, in its "
        "place, with a held-out gap of 1.2 at most."
    )
    return [Table("Laws of two covariates", columns, detail, note)]


def null_table() -> list[Table]:
    """Campaigns that leave something in which there is no law, where the study of them has been run."""
    if not NULL_ROWS.exists():
        return []
    rows: list[Row] = [json.loads(text) for text in NULL_ROWS.read_text().splitlines()]
    detail = []
    for kind in dict.fromkeys(row["kind"] for row in rows):
        of = [row for row in rows if row["kind"] == kind]
        gaps = [row["law"]["before"] for row in of if row["law"]]
        detail.append(
            [
                kind,
                str(len(of)),
                str(sum(row["verdict"] == "no_gap" for row in of)),
                str(sum(bool(row["added"]) for row in of)),
                str(len(gaps)),
                f"{min(gaps):.2f} to {max(gaps):.2f}" if gaps else "",
                str(sum(map(proposed, of))),
            ]
        )
    columns = ("kind", "campaigns", "no gap", "named", "looked for a law", "gap of the traces then", "law")
    looked = sum(row["law"] is not None for row in rows)
    note = (
        f"{len(rows)} campaigns of {NULL_SHOTS} shots, `_null_laws_run`, which says what the kinds are. "
        f"A law was proposed in {sum(map(proposed, rows))} of the {looked} "
        "in which one was looked for. The seeds are for tuning."
    )
    return [Table("Laws where there are none", columns, detail, note)]


def rivals_table(rows: Sequence[Row]) -> list[Table]:
    """The same campaigns by others, where they were given them."""
    compared = [row for row in rows if "rivals" in row and not row["added"]]
    if not compared:
        return []
    names = [name for name in RIVALS if all(name in row["rivals"] for row in compared)]
    gaps: dict[str, list[float]] = {
        "": [row["law"]["after"] if proposed(row) else row["rivals"]["nominal_gap"] for row in compared]
    }
    gaps |= {name: [row["rivals"][name]["gap"] for row in compared] for name in names}
    judged = [row for row in compared if row["rivals"][names[0]]["error"] is not None]
    errors = {
        "": [row["rivals"]["law_error"] if row["rivals"]["law_error"] is not None else 1.0 for row in judged]
    }
    errors |= {name: [row["rivals"][name]["error"] for row in judged] for name in names}
    seconds = {"": [row["law_seconds"] for row in compared]}
    seconds |= {name: [row["rivals"][name]["seconds"] for row in compared] for name in names}
    nominal = float(np.median([row["rivals"]["nominal_gap"] for row in compared]))

    def shares(values: Mapping[str, list[float]], limit: float) -> list[str]:
        return [f"{sum(one <= limit for one in of)}/{len(of)}" for of in values.values()]

    def medians(values: Mapping[str, list[float]], form: str, unit: float = 1.0) -> list[str]:
        return [form.format(float(np.median(of)) / unit) for of in values.values()]

    def behind(values: Mapping[str, list[float]]) -> list[str]:
        ours = values[""]
        return ["", *(f"{sum(map(lt, values[name], ours))}/{len(ours)}" for name in names)]

    body = [
        ["held-out gap, median", *medians(gaps, "{:.2f}")],
        ["held-out gap at most 1.2", *shares(gaps, LARGEST_GAP)],
        ["a smaller gap than impactcell's", *behind(gaps)],
        ["error of the force, median", *medians(errors, "{:.1f} %", 0.01)],
        ["error at most 5 % of its size", *shares(errors, LARGEST_ERROR)],
        ["a smaller error than impactcell's", *behind(errors)],
        ["processor time, median [s]", *medians(seconds, "{:.1f}")],
    ]
    note = (
        f"{len(compared)} campaigns of the table above, all in whose place the rivals know the covariates; "
        f"gap of the nominal model {nominal:.2f} in the median. Error of the force along the motion, at all "
        f"rows of the smoothed training shots where it acts, in {len(judged)} of which the truth is a "
        "function; without a law it counts as 100 %. They get what the nominal model leaves, smoothed "
        "(`_laws_rivals`)."
    )
    if "operon" not in names:
        note += " Not installed: pyoperon."
    columns = ("what", "impactcell", *(RIVALS[name] for name in names))
    return [Table("Laws that nobody had listed: beside rivals", columns, body, note)]


def tables() -> list[Table]:
    """Tables of what was gathered."""
    if not ROWS.exists():
        ROWS.parent.mkdir(exist_ok=True)
        ROWS.write_text(json.dumps(run(FUNCTIONS[1], job_of(FUNCTIONS[1], 0, 1))) + "\n")
    rows: list[Row] = [json.loads(text) for text in ROWS.read_text().splitlines()]
    looked = [row for row in rows if row["effect"] in {item.effect for item in FUNCTIONS}]
    sought = [row for row in looked if not row["added"]]
    with_truth = [
        row for item in FUNCTIONS if item.truth for row in rows_of(item.effect, rows) if not row["added"]
    ]
    right = sum(is_right_form(item)(row) for item in FUNCTIONS for row in rows_of(item.effect, sought))
    others = [row for item in OTHERS for row in rows_of(item.effect, rows)]
    nothing = rows_of(NONE.effect, rows)
    faster = [row for row in looked if proposed(row) and row["law"].get("faster")]
    within = [row for row in faster if not row["law"]["faster"]["beyond"]]
    shares = [
        (
            "function of one covariate: held-out gap after at most 1.2",
            0.8,
            sum(map(closes, sought)),
            len(sought),
        ),
        (
            "error over visited states at most 5 % of its size",
            0.7,
            sum(map(is_exact, with_truth)),
            len(with_truth),
        ),
        ("right functional form first or tied", 0.6, right, len(sought)),
        (
            f"at {FASTER} times the velocities: gap at most 1.5, or beyond the range that the report gives",
            0.9,
            sum(map(holds_faster, faster)),
            len(faster),
        ),
    ]
    summary = [
        line(what, f"{100 * bar:.0f} %", Share(count, of), met=of > 0 and count >= bar * of)
        for what, bar, count, of in shares
    ]
    invented, total = sum(map(proposed, nothing)), len(nothing)
    summary.append(line("nothing hidden: a law proposed", "1 %", Share(invented, total), met=not invented))
    summary.append(
        line(
            "no function of one covariate: a law proposed",
            "",
            Share(sum(map(proposed, others)), len(others)),
            met=True,
        )
    )
    seconds = [row["law_seconds"] for row in rows if row["law_seconds"]]
    if seconds:
        median = float(np.median(seconds))
        value = f"{median:.1f} s"
        summary.append(
            ["processor time beside the workflow, median", "30 s", value if median <= 30 else f"**{value}**",
             f"{min(seconds):.1f}-{max(seconds):.1f} s"]
        )  # fmt: skip
    explained = len(looked) - len(sought)
    note = (
        f"{len(rows)} campaigns of {SHOTS} shots at {STRENGTH} of the default strengths, by the simulator's "
        "own plant; the effect itself is not in the library. Campaigns that another effect of the library "
        f"explained ({explained}) are not in the first three rows. Faster taps: of {len(faster)} laws the "
        f"covariate of {len(within)} stays within the range; the median gap of the others is "
        f"{_median_gap(faster)}."
    )
    detail = []
    for item in (*FUNCTIONS, *OTHERS, NONE):
        of = rows_of(item.effect, rows)
        if not of:
            continue
        laws = [row["law"] for row in of if proposed(row)]
        errors = [law["error"] for law in laws if law["error"] is not None]
        forms = dict.fromkeys(law["form"] or "spline only" for law in laws)
        detail.append(
            [
                item.effect or "nothing",
                str(len(of)),
                str(sum(bool(row["added"]) for row in of)),
                str(sum(map(closes, of))),
                str(sum(map(is_right_form(item), of))) if item.form else "",
                f"{100 * float(np.median(errors)):.1f} %" if errors else "",
                "; ".join(forms),
            ]
        )
    columns = (
        "hidden",
        "campaigns",
        "explained by another",
        "gap closed",
        "right form",
        "error",
        "forms that came first",
    )
    return [
        Table(
            "Laws that nobody had listed: bars", ("what", "bar", "measured", "95 % interval"), summary, note
        ),
        Table("Laws that nobody had listed: what was hidden", columns, detail),
        *rivals_table(rows),
        *pair_table(),
        *null_table(),
    ]
