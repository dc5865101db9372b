"""What an answer of the discrepancy workflow is worth, given what was hidden."""

import math
from typing import Any

from tests.benchmarks._discrepancy_plan import CONFOUNDED, EQUIVALENT

CONTACT = frozenset({"preload", "loading", "unloading"})
MOVING = frozenset({"loading", "unloading", "free_slide"})
ACTS = {
    "actuator_vibration": CONTACT,
    "bilinear_contact": CONTACT - {"preload"},
    "gap_suction": frozenset({"free_slide"}),
    "late_friction": frozenset({"free_slide"}),
    "loose_mass": MOVING,
    "machine_vibration": MOVING | {"preload"},
    "magnetic_pull": frozenset({"free_slide"}),
    "relaxing_contact": CONTACT,
    "wandering_force": MOVING | CONTACT,
    "wedge_drag": MOVING,
}
"""Phases in which the simulator's unlisted laws act: a law of contact in contact, one of the gap after it."""

RIGHT, TIED, UNKNOWN, NO_GAP, PARTIAL, WRONG = "right", "tied", "unknown", "no_gap", "partial", "wrong"
EQUAL, FALSE, ERROR = "equivalent", "unknown, but", "error"
ANSWERS = (RIGHT, TIED, EQUAL, UNKNOWN, NO_GAP, PARTIAL, WRONG, FALSE, ERROR)


def equivalents(effect: str) -> frozenset[str]:
    """Effects that may be named in the place of another one that the library lacks."""
    return frozenset().union(*(group for group in EQUIVALENT if effect in group)) - {effect}


def judged(row: dict[str, Any]) -> str:
    """Judge an answer.

    `right`: exactly what is hidden is named; `tied`: the same, but for ties that hold it; `equivalent`: an
    effect taken out of the library, and its declared near-equivalent named; `partial`: some of what is
    hidden and nothing else; `unknown, but`: unknown, with something listed beside it that is not hidden.
    """
    if row["verdict"] in {ERROR, NO_GAP}:
        return str(row["verdict"])
    job = row["job"]
    targets = set(job["hidden"]) - {job["removed"]}
    groups = [{effect, *row["tied"].get(effect, [])} for effect in row["named"]]
    if row["verdict"] == UNKNOWN:
        return UNKNOWN if all(group & targets for group in groups) else FALSE
    if job["removed"]:
        held = equivalents(job["removed"])
        return EQUAL if all(group & held for group in groups) else WRONG
    if _matched(groups, targets):
        return TIED if row["verdict"] == "tied" else RIGHT
    return PARTIAL if all(group & targets for group in groups) else WRONG


def _matched(groups: list[set[str]], targets: set[str]) -> bool:
    """Whether groups and targets can be paired one to one."""
    if len(groups) != len(targets):
        return False
    if not groups:
        return True
    first, *rest = groups
    return any(_matched(rest, targets - {one}) for one in first & targets)


def confound_said(row: dict[str, Any]) -> bool:
    """Whether an exact confound is a tie, and something is proposed that would break it."""
    tied = any({effect, *row["tied"].get(effect, [])} >= CONFOUNDED for effect in row["named"])
    proposed = any(set(one) == CONFOUNDED for one in row["proposals"])
    return bool(row["verdict"] == "tied" and tied and proposed)


def phase_right(row: dict[str, Any]) -> bool:
    """Whether `unknown` is said with a phase in which the unlisted law acts."""
    left = row.get("unexplained")
    return bool(row["verdict"] == UNKNOWN and left and left["phase"] in ACTS[row["job"]["hidden"][0]])


def wilson(count: int, total: int) -> str:
    """Interval of a share at 95 % (Wilson 1927)."""
    if not total:
        return "-"
    z, share = 1.959964, count / total
    middle = (share + z * z / (2 * total)) / (1 + z * z / total)
    half = z * math.sqrt(share * (1 - share) / total + z * z / (4 * total * total)) / (1 + z * z / total)
    return f"{100 * max(middle - half, 0):.1f}-{100 * min(middle + half, 1):.1f} %"


def share(count: int, total: int) -> tuple[str, str]:
    """Share with its interval, as tables show it."""
    return f"{count}/{total}" + (f" = {100 * count / total:.1f} %" if total else ""), wilson(count, total)
