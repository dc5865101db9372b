"""What one tree makes of given inputs, printed as JSON; run as a file with the tree on PYTHONPATH.

Only what `golden` asks for: `_golden_outputs.py TOPIC INPUTS CAMPAIGNS`, in a tree that may be an older one.
What it prints is a mapping from output to what that holds, by its place there; names that have changed are
looked for as they are and as they were.
"""

import csv
import dataclasses
import enum
import importlib
import json
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

Leaf = float | int | str | bool | None
Outputs = dict[str, dict[str, Leaf]]

WEAR_LIMIT = 0.24
"""mu_s; both the series and the cells wear beyond it."""
CELL: dict[str, Any] = {
    "format": 1,
    "module": {"port": 15020, "register_map": "config/maps/fpga-v1.yaml"},
    "model": "config/models/prototype.yaml",
    "part": {"mass_kg": 18.9},
    "actuator": {"stroke_mm": 1.5},
    "signature": {"learning_cycles": 15},
    "alarms": {"wear_limit": WEAR_LIMIT},
}
"""A cell of the paper's prototype; paths are below the tree."""

PARTS = ("friction", "wear", "batch", "signature", "alarms")
"""Of a snapshot, those with an output of their own."""


def named(*places: str) -> Any:
    """Return the first of `module:name` that there is."""
    for place in places:
        module, _, name = place.partition(":")
        try:
            return getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError):
            continue
    raise ImportError(f"none of {', '.join(places)}: add its present name")


def impactcell(*arguments: object) -> str:
    """Run the tree's command; what it printed.

    Raises
    ------
    RuntimeError
        It ended with another code than 0.
    """
    command = [sys.executable, "-m", "impactcell", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command[2:])}: {done.stderr.strip()}")
    return done.stdout


def leaves(value: Any, place: str = "") -> Iterator[tuple[str, Leaf]]:
    """Yield all that a value holds, each with its place; a named member of a list goes by its name."""
    if isinstance(value, enum.Enum):
        yield place, value.value if isinstance(value.value, str) else value.name.lower()
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from leaves(getattr(value, field.name), f"{place}/{field.name}")
    elif isinstance(value, Mapping):
        for key, member in value.items():
            yield from leaves(member, f"{place}/{key}")
    elif isinstance(value, list | tuple | np.ndarray):
        seen: Counter[str] = Counter()
        for number, member in enumerate(value):
            name = _name(member)
            seen[name] += 1
            yield from leaves(member, f"{place}/{name} {seen[name]}" if name else f"{place}/{number}")
    else:
        yield place, value.item() if isinstance(value, np.generic) else value


def _name(member: Any) -> str:
    """Name of a member of a list; empty where it has none."""
    if isinstance(member, enum.Enum):
        return ""
    name = member.get("alarm", "") if isinstance(member, dict) else getattr(member, "name", "")
    return str(name.value if isinstance(name, enum.Enum) else name)


def csv_leaves(text: str) -> Iterator[tuple[str, Leaf]]:
    """Yield the cells of a table by the first cell of their row and by their column."""
    for row in csv.DictReader(text.splitlines()):
        first = next(iter(row.values()))
        for column, cell in row.items():
            yield f"/{first}/{column}", _number(cell)


def _number(cell: str) -> Leaf:
    try:
        return float(cell)
    except ValueError:
        return cell


def estimate(inputs: Path, campaigns: Path) -> Outputs:
    """Friction of every shot of the sample campaigns, as the command writes it."""
    return {
        campaign.name: dict(csv_leaves(impactcell("estimate", campaign, "-q")))
        for campaign in _each(campaigns)
    }


def discrepancy(inputs: Path, campaigns: Path) -> Outputs:
    """What the workflow finds in the sample campaigns, as it stands in result.json."""
    outputs = {}
    for campaign in _each(campaigns):
        with tempfile.TemporaryDirectory() as directory:
            impactcell("discrepancy", campaign, "-o", f"{directory}/found", "-q")
            found = json.loads(Path(directory, "found", "result.json").read_text(encoding="utf-8"))
        outputs[campaign.name] = dict(leaves(found))
    return outputs


def _each(campaigns: Path) -> list[Path]:
    return sorted(place for place in campaigns.iterdir() if place.is_dir())


def track(inputs: Path, campaigns: Path) -> Outputs:
    """The series with its batches told, and with batches to be found."""
    outputs = {}
    for batch in ("known", "unknown"):
        given = ("--batch", batch, "--limit", WEAR_LIMIT, "--json", "-q")
        found = json.loads(impactcell("track", inputs / "series.csv", *given))
        outputs[f"batch {batch}: alarms"] = dict(leaves(found.pop("alarms")))
        outputs[f"batch {batch}: wear and batch"] = dict(leaves(found))
    return outputs


def journal(inputs: Path, campaigns: Path) -> Outputs:
    """A journal of an earlier version: exported, and its captures taken through the cell once more."""
    with tempfile.TemporaryDirectory() as directory:
        impactcell("export", inputs / "journal.sqlite", "-o", f"{directory}/exported", "-q")
        exported: dict[str, Leaf] = {}
        for file in sorted(Path(directory, "exported").rglob("*.csv")):
            text = file.read_text(encoding="utf-8")
            exported |= {f"/{file.name}{place}": leaf for place, leaf in csv_leaves(text)}
    with named("impactcell.journal.store:Journal")(inputs / "journal.sqlite", None, read_only=True) as store:
        captures = list(store.captures())
    return {"exported": exported, **_stepped("journal", captures, part={"mass_kg": 12.0})}


def cycles(inputs: Path, campaigns: Path) -> Outputs:
    """Simulated cycles through the cell, with their batches told and with batches to be found."""
    outputs: Outputs = {}
    for batch in ("known", "unknown"):
        captures = _recorded(inputs / "captures.npz", told=batch == "known")
        outputs |= _stepped(f"batch {batch}", captures, tracking={"batch": batch})
    return outputs


def _recorded(file: Path, *, told: bool) -> list[Any]:
    """Captures as `golden` wrote them."""
    Capture, Channel = named("impactcell.records:Capture"), named("impactcell.records:Channel")
    captures = []
    with np.load(file) as held:
        for number, header in enumerate(json.loads(str(held["headers"]))):
            channels: dict[str, Any] = {"force": None, "position": None}
            for name, std in header.pop("noise_std").items():
                if f"{number} {name}" in held:
                    time_s, values = (held[f"{number} {name}{what}"] for what in (" time_s", ""))
                    channels[name] = Channel(time_s, values, std)
            batch_id = header.pop("batch_id")
            captures.append(Capture(**header, **channels, batch_id=batch_id if told else None))
    return captures


def _stepped(what: str, captures: list[Any], **changes: dict[str, Any]) -> Outputs:
    """Take captures through the cell; what it shows of each, by part of the snapshot."""
    cell_design = named("impactcell.service.factory:cell_design", "impactcell.service.design:cell_design")
    read_cell = named("impactcell.settings:read_cell")
    initial_state, step = (named(f"impactcell.cell:{name}") for name in ("initial_state", "step"))
    nothing = named("impactcell.records:PositioningState")()
    here = Path.cwd()
    module = {**CELL["module"], "register_map": str(here / CELL["module"]["register_map"])}
    content = {**CELL, "cell": "golden", "module": module, "model": str(here / CELL["model"]), **changes}
    with tempfile.TemporaryDirectory() as directory:
        file = Path(directory, "golden.yaml")
        file.write_text(yaml.safe_dump(content), encoding="utf-8")
        design = cell_design(read_cell(file))
    state = initial_state(design)
    outputs: Outputs = {}
    for number, capture in enumerate(captures):
        result = step(design, state, capture, nothing)
        state = result.state
        for place, leaf in leaves(result.snapshot):
            part = place.split("/")[1]
            part = part if part in PARTS else "all else"
            if place.endswith("/message"):
                part = "messages of alarms"
            outputs.setdefault(f"{what}: {part}", {})[f"/cycle {number}{place}"] = leaf
        raised = outputs.setdefault(f"{what}: alarms that moved", {})
        raised[f"/cycle {number}"] = ", ".join(sorted(_name(alarm) for alarm in result.changed))
    return outputs


if __name__ == "__main__":
    import impactcell as product  # noqa: F401  # says how many threads numpy takes

    topics = {topic.__name__: topic for topic in (estimate, discrepancy, track, journal, cycles)}
    print(json.dumps(topics[sys.argv[1]](Path(sys.argv[2]), Path(sys.argv[3]))))
