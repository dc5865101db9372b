"""How the tree is built, in numbers; `python -m tests.benchmarks.structure [TREE] [--list]` measures another.

Everything is counted by the same rules in every tree, so that two of them can be compared. Where a rule can
only be as good as a list written by hand (which functions integrate a tap), the list stands here.
"""

import argparse
import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from tests.benchmarks import _lines, _syntax
from tests.benchmarks._later import since_then
from tests.benchmarks._lists import Count, alarms, effects, values
from tests.benchmarks.table import Table

ROOT = Path(__file__).resolve().parents[2]
BEFORE = Path(__file__).with_name("rows") / "structure-before.json"
"""As this script measured the last tree before the rooms were set up."""
MANY_ARGUMENTS = 8
COMPLEX = 20
DEFINITIONS: Mapping[str, tuple[str, ...]] = {
    "integrators of a tap in the product": (
        "physics.(course|integrator):(integrate_all|integrate_taps)",
        "physics.modified_euler:strike_modified_euler",
    ),
    "closed forms of a tap in the product": (
        "(positioning.response|positioning.displacement_model|physics.closed_form):displacements",
    ),
    "noise estimators of a channel": (
        "(prediction.reading|prediction.feature_extraction|features.noise):noise_std",
        "features.noise:white_noise_std",
        "tracking.(slide|signature.slide_segment):_noise",
        "discrepancy.(noise|data.noise_floor):white_noise",
        "discrepancy.(drives|data.measured_drive):_noise(_density)?",
    ),
    "slide extractors": (
        "(prediction.sliding|prediction.slide_features|features.slide):(slide|extract_slide)",
        "tracking.(slide|signature.slide_segment):(find_slide|extract_segment)",
    ),
}
"""Definitions that do the same work, `module:function` below `impactcell`, under all names they have had.

One that calls another of its row is not counted: it does not do the work again. A renaming is followed here,
and a row of which nothing is found fails. `features.segment` is not listed: it averages the slide from the
separation on that it is given, though where rest begins it judges by itself.
"""


def duplicate_names(parsed: Sequence[_syntax.Module]) -> Count:
    """Names of dataclasses of the product that are defined more than once."""
    homes = _syntax.dataclass_homes(list(parsed))
    items = tuple(f"{name}: {', '.join(at)}" for name, at in sorted(homes.items()) if len(at) > 1)
    return Count(len(items), items)


def glossary(root: Path) -> tuple[list[str], list[str]]:
    """Give the words of the glossary, as often as they are listed, and the names that were retired."""
    pages = [root / "docs" / name for name in ("glossary.md", "contributing.md")]
    words, retired = [], []
    section = ""
    for line in (line for page in pages if page.is_file() for line in page.read_text("utf-8").splitlines()):
        if line.startswith("#"):
            section = line.lstrip("# ").lower()
        cells = [cell.strip() for cell in line.strip("|").split("|")] if line.startswith("|") else []
        if len(cells) < 2 or set(cells[0]) <= set("-: ") or cells[0] in {"word", "name"}:
            continue
        named = re.findall(r"`([^`]+)`", cells[0]) if "retired" in section else cells[0].split(",")
        (retired if "retired" in section else words).extend(name.strip().strip("`") for name in named)
    return words, retired


def twice_listed(words: Iterable[str]) -> Count:
    """Words that the glossary lists more than once."""
    folded = [word.lower() for word in words]
    items = tuple(sorted({word for word in folded if folded.count(word) > 1}))
    return Count(len(items), items)


def retired_names(parsed: Sequence[_syntax.Module], retired: Iterable[str]) -> Count:
    """Names that the glossary has retired and that still name a class, a module or a function."""
    gone = frozenset(retired)
    items = []
    for module in parsed:
        if ".".join(module.name.split(".")[1:]) in gone:
            items.append(module.name)
        nodes = (*_syntax.classes(module), *_syntax.functions(module))
        items.extend(f"{module.name}:{node.lineno} {node.name}" for node in nodes if node.name in gone)
    return Count(len(items), tuple(items))


def homes(parsed: Sequence[_syntax.Module], pattern: str) -> list[_syntax.Module]:
    """Modules in which a listed definition may stand."""
    home, _, _ = pattern.partition(":")
    return [module for module in parsed if re.fullmatch(rf"impactcell\.({home})", module.name)]


def definitions(parsed: Sequence[_syntax.Module], patterns: Sequence[str]) -> Count:
    """Which of the listed definitions do their work themselves, and do not call another of the list."""
    listed = {}
    for pattern in patterns:
        for module in homes(parsed, pattern):
            for node in _syntax.functions(module):
                if re.fullmatch(pattern.split(":")[1], node.name):
                    listed[f"{module.name}:{node.name}"] = node
    names = {node.name for node in listed.values()}
    items = [place for place, node in listed.items() if not (_syntax.called(node) & names) - {node.name}]
    return Count(len(items), tuple(items))


def measure(root: Path, parsed: Sequence[_syntax.Module]) -> dict[str, Count]:
    """Measure one tree, whose product is parsed."""
    words, retired = glossary(ROOT)
    bare = [item for module in parsed for item in _syntax.bare_constants(module)[0]]
    functions = [(module, node) for module in parsed for node in _syntax.functions(module)]
    wide = [
        f"{module.name}:{node.lineno} {node.name}: {_syntax.arguments(node)}"
        for module, node in functions
        if _syntax.arguments(node) >= MANY_ARGUMENTS
    ]
    knotted = [
        f"{module.name}:{node.lineno} {node.name}: {_syntax.complexity(node)}"
        for module, node in functions
        if _syntax.complexity(node) >= COMPLEX
    ]
    later = since_then(parsed)
    lines = {module.name: len(module.lines) for module in parsed}
    return {
        "names of dataclasses defined more than once": duplicate_names(parsed),
        "words listed twice in the glossary": twice_listed(words),
        "retired words that still name something": retired_names(parsed, retired),
        "numeric constants without a word of meaning": Count(len(bare), tuple(bare)),
        "functions with 8 and more arguments": Count(len(wide), tuple(wide)),
        "functions of cyclomatic complexity 20 and more": Count(len(knotted), tuple(knotted)),
        "files to edit for an alarm rule": alarms(root),
        "files to edit for a published value": values(root),
        "files to edit for an effect": effects(root),
        **{row: definitions(parsed, patterns) for row, patterns in DEFINITIONS.items()},
        "lines of impactcell/": Count(sum(lines.values())),
        "lines of it for what it did before": Count(sum(lines.values()) - later.value, later.items),
    }


BARS: Mapping[str, int | str] = {
    "names of dataclasses defined more than once": 0,
    "words listed twice in the glossary": 0,
    "retired words that still name something": 0,
    "numeric constants without a word of meaning": 0,
    "functions with 8 and more arguments": 8,
    "functions of cyclomatic complexity 20 and more": "half",
    "files to edit for an alarm rule": 1,
    "files to edit for a published value": 1,
    "files to edit for an effect": 2,
    "integrators of a tap in the product": 1,
    "closed forms of a tap in the product": 1,
    "noise estimators of a channel": 1,
    "slide extractors": 1,
    "lines of impactcell/": 31_000,
    "lines of it for what it did before": 31_000,
}
"""What the tree is held to; no bar is a promise about quality, each only keeps a known evil small."""

BY_HAND: Mapping[str, str] = {
    "names of dataclasses defined more than once": "15",
    "words listed twice in the glossary": "many",
    "numeric constants without a word of meaning": "223",
    "functions with 8 and more arguments": "46",
    "files to edit for an alarm rule": "8",
    "files to edit for a published value": "5",
    "files to edit for an effect": "3",
    "integrators of a tap in the product": "4",
    "noise estimators of a channel": "4",
    "slide extractors": "2",
    "lines of impactcell/": "35 700",
}
"""What a reader had counted in the tree before, by other rules than this script's."""

NOTE = (
    "Counted by `python -m tests.benchmarks.structure --list`, which prints what was counted; *before* is "
    "the last tree before the rooms were set up, counted by the same script. A constant counts as "
    "explained if a docstring or a comment stands with it: whether that says enough, no script can tell. "
    "Files to edit are the item's own files and every file of product, simulator and tests that names "
    "more than half of the items there are; documentation and generated files are not counted. "
    "Integrators, noise estimators and slide extractors are those of a list kept by hand, under all names "
    "they have had. An integrator takes steps in time; the closed form takes none, was counted as one by "
    "hand, and has a row of its own. What the product did before is all but the modules of another list kept "
    "by hand (`tests/benchmarks/_later.py`), which are only for what came since."
)


def verdict(name: str, value: int, before: int) -> str:
    """Write a figure, in bold where it misses its bar."""
    bar = BARS[name]
    allowed = before // 2 if bar == "half" else int(bar)
    return f"{value}" if value <= allowed else f"**{value}**"


def tables() -> list[Table]:
    """Every table of this topic."""
    parsed = _syntax.modules(ROOT, "impactcell")
    now, before = measure(ROOT, parsed), json.loads(BEFORE.read_text(encoding="utf-8"))
    rows = [
        (
            name,
            BY_HAND.get(name, ""),
            str(before[name]),
            str(BARS[name]),
            verdict(name, count.value, before[name]),
        )
        for name, count in now.items()
    ]
    rooms = _lines.by_room(parsed)
    later = [tuple(reversed(item.split(": ", 1))) for item in now["lines of it for what it did before"].items]
    return [
        Table("Structure", ("what", "before, by hand", "before", "bar", "now"), rows, NOTE),
        Table("Structure: what the lines are", ("room", *_lines.KINDS, "in all"), _lines.rows(rooms)),
        Table("Structure: lines for what came since", ("what the product did not do before", "lines"), later),
    ]


def main() -> int:
    """Print what is counted in a tree, as JSON or as a list."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.structure", description=__doc__)
    parser.add_argument("tree", nargs="?", type=Path, default=ROOT, help="root of a checkout (this one)")
    parser.add_argument("--list", action="store_true", help="also print what was counted")
    chosen = parser.parse_args()
    counts = measure(chosen.tree, _syntax.modules(chosen.tree, "impactcell"))
    if not chosen.list:
        print(json.dumps({name: count.value for name, count in counts.items()}, indent=1))
        return 0
    for name, count in counts.items():
        print(f"{name}: {count.value}")
        for item in count.items:
            print(f"  {item}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
