"""Files that list the items of a kind: what a new rule, published value or effect must be written into."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

SOURCES = {".py", ".xml", ".j2", ".js"}
"""Suffixes of what is looked at."""
GENERATED = re.compile(r"generated (from|by)|written by .*, not by hand", re.IGNORECASE)
"""What a file that nobody edits says in its first lines."""
TRIAL = "tests/contract/test_new_items.py"
UNTOUCHED: Mapping[str, str] = {
    "impactcell/journal/migrations.py": "names of the first stored form, which never changes again",
    "impactcell/journal/schema.py": "order of the columns of format 3; later ones follow by themselves",
    "impactcell/records/friction.py": "where values are computed into, published or not",
    "impactcell/demo/view.py": "shows some values that it chose",
    "tests/unit/alarms/test_alarm_set.py": "tries the set with rules that there are; others may join",
    "tests/data/contents.py": "reads journals of earlier versions",
    "tests/data/make_journal.py": "makes journals of earlier versions",
    "tests/contract/test_effects.py": "holds the effects that are used from outside; others may join",
    "tests/unit/simulator/test_effects.py": "closed forms beside what holds for every law",
    "tests/discrepancy/test_free_rivals.py": "tries effects beside free forms; others may join",
    "tests/discrepancy/test_study.py": "judges rows that name some effects; others may join",
    "tests/integration/test_opcua_values.py": "holds the nodes that are used from outside; others may join",
    "tests/interop/node/nodesets.js": "asks for the conditions that are used from outside",
}
"""Files that name most items of a kind, and that a new one need not be written into.

The trials show it, which add one to a copy of the tree: `tests/unit/alarms/test_new_rule.py` and
`tests/contract/test_new_items.py`.
"""


@dataclass(frozen=True, slots=True)
class Count:
    """One measured figure and what was counted."""

    value: int
    items: tuple[str, ...] = ()


def files_that_list(root: Path, kind: Sequence[tuple[str, ...]], homes: int) -> Count:
    """Files that a new item must be written into: its homes, and every file that lists its kind.

    A file of product, simulator or tests lists a kind if it names more than half of its items, in any of
    their spellings. Those of `UNTOUCHED` are left out in a tree that has the trial which shows it.
    """
    trusted = (root / TRIAL).is_file()
    items = []
    for package in ("impactcell", "simulator", "tests"):
        for path in sorted((root / package).rglob("*")):
            below = path.relative_to(root)
            if str(below) in UNTOUCHED and trusted:
                continue
            if path.suffix not in SOURCES or {"node_modules", "benchmarks"} & set(below.parts):
                continue
            text = path.read_text(encoding="utf-8")
            if GENERATED.search(text[:400]):
                continue
            words = set(re.findall(r"\w+", text))
            if 2 * sum(not words.isdisjoint(names) for names in kind) > len(kind):
                items.append(str(below))
    return Count(homes + len(items), tuple(items))


def alarms(root: Path) -> Count:
    """Files to edit for an alarm rule, by those that list the rules there are."""
    names = ("WearLimit", "BatchShift", "DeviantCycle", "ModuleConnection", "ModelGap", "PositioningFault")
    spellings = []
    for name in names:
        snake = re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()
        spellings.append((name, snake, snake.upper()))
    one_file_a_rule = any((root / "impactcell" / "alarms").rglob("deviant_cycle.py"))
    return files_that_list(root, spellings, int(one_file_a_rule))


def values(root: Path) -> Count:
    """Files to edit for a published value, by those that list values of all origins."""
    probes = (
        ("peak_force_n", "PeakForce"),
        ("sliding_distance_m", "SlidingDistance"),
        ("by_distance", "mu_s_distance", "StaticFrictionByDistance"),
        ("mu_k", "KineticFriction"),
        ("rate_per_cycle", "wear_rate_per_cycle", "RatePer1000Cycles"),
        ("cycles_to_limit", "CyclesToLimit"),
        ("cycles_to_limit_low", "CyclesToLimitLow"),
        ("offset_std", "batch_offset_std", "OffsetStdDev"),
        ("last_shift", "LastShift"),
        ("t_squared", "TSquared"),
        ("spe", "Spe"),
        ("round_trip_ms", "round_trip_s", "RoundTripTime"),
    )
    return files_that_list(root, probes, 0)


def effects(root: Path) -> Count:
    """Files to edit for an effect: its own, its independent law, and those that list the effects."""
    folder = root / "impactcell" / "physics" / "effects"
    names = [(path.stem,) for path in sorted(folder.glob("*.py")) if path.stem != "__init__"]
    return files_that_list(root, names, 2)
