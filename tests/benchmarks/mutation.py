"""Single faults put into the code: how many of them a test of the same room notices.

Mutants are drawn with a seed. Each runs in a process of its own, forked off one that has the libraries
loaded, and only with the tests of its room that go through the function it is in, the quickest first, until
one fails. A mutant is a place in a function, and is not tried twice.
`python -m tests.benchmarks.mutation ROOM NUMBER [SECONDS]` tries so many of a room, and begins none after
SECONDS; with `--again` those that survived, with all tests of the room. ROOM `named` tries the faults of
`_named_faults` that are not on file as noticed. The topic prints what is on file.
"""

import argparse
import hashlib
import json
import math
import multiprocessing
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from tests.benchmarks._mutants import Mutant, compiled_with, mutants, users_of
from tests.benchmarks._mutation_run import LIBRARIES, ROOT, as_it_is, with_fault
from tests.benchmarks._named_faults import NAMED_FAULTS, faulty_source
from tests.benchmarks.table import Table

ROWS = ROOT / "tests" / "benchmarks" / "rows"
RESULTS = ROWS / "mutation.jsonl"
NAMED, NAMED_RESULTS = "named", ROWS / "mutation-named.jsonl"
TESTS_FAILED = 1
"""Exit code of pytest when all could be collected and a test failed."""
SEED = 20261122
BAR = 0.9
"""Share of the faults that is to be noticed."""
LONGEST_S, LONGER = 60.0, 5.0
"""A mutant whose tests take LONGEST_S and LONGER times as long as without it hangs, and counts as noticed."""
ROOMS: Final[dict[str, tuple[tuple[str, ...], tuple[str, ...]]]] = {
    "cell": (("impactcell/cell/*.py",), ("tests/unit/cell", "tests/unit/service/test_worker.py")),
    "journal": (
        ("impactcell/journal/*.py",),
        (
            "tests/unit/journal",
            "tests/unit/service/test_journal_damaged.py",
            "tests/unit/service/test_journal_gone.py",
        ),
    ),
    "intake": (
        ("impactcell/service/worker.py", "impactcell/service/journal_writer.py"),
        ("tests/unit/service", "tests/unit/journal"),
    ),
    "fieldbus": (
        ("impactcell/fieldbus/*.py", "impactcell/fieldbus/transports/*.py"),
        ("tests/unit/fieldbus",),
    ),
    "tracking": (("impactcell/tracking/*/*.py",), ("tests/unit/tracking", "tests/unit/cell")),
    "prediction": (("impactcell/prediction/*.py",), ("tests/unit/prediction",)),
    "discrepancy": (
        ("impactcell/discrepancy/*.py", "impactcell/discrepancy/*/*.py"),
        ("tests/discrepancy",),
    ),
    "scada access": (
        (
            "impactcell/scada/users.py",
            "impactcell/opcua/certificates/trust_list.py",
            "impactcell/opcua/transport/secure_channel.py",
        ),
        (
            "tests/unit/opcua",
            "tests/integration/test_opcua_identity.py",
            "tests/integration/test_opcua_rights.py",
        ),
    ),
}  # fmt: skip
"""What is mutated, and the tests that have to notice."""


Start = Callable[..., Any]
"""Makes a process."""
Key = tuple[str, str, str, str, int]
"""File, function, before, after, and which of those that look the same."""


def files_of(room: str) -> tuple[str, ...]:
    """Sources of a room."""
    patterns, _ = ROOMS[room]
    return tuple(str(f.relative_to(ROOT)) for f in sorted(f for p in patterns for f in ROOT.glob(p)))


def drawn(room: str) -> dict[Key, Mutant]:
    """All mutants of a room in the order in which they are tried."""
    every: dict[Key, Mutant] = {}
    alike: Counter[tuple[str, ...]] = Counter()
    for file in files_of(room):
        for mutant in mutants((ROOT / file).read_text(encoding="utf-8")):
            look = (file, mutant.function, mutant.before, mutant.text)
            every[(*look, alike[look])] = mutant
            alike[look] += 1
    keys = list(every)
    random.Random(f"{SEED} {room}").shuffle(keys)
    return {key: every[key] for key in keys}


def key_of(row: dict[str, Any]) -> Key:
    """Name the mutant that a row is about."""
    return row["file"], row["function"], row["before"], row["after"], row["number"]


def on_file() -> list[dict[str, Any]]:
    """What has been tried."""
    return [json.loads(line) for line in RESULTS.read_text().splitlines()] if RESULTS.exists() else []


def attempt(room: str, number: int, seconds: float, *, again: bool) -> None:
    """Try the next mutants of a room, so many; or those that survived."""
    every = drawn(room)
    rows = {key_of(row): row for row in on_file()}
    survived = [key for key, row in rows.items() if not row["killed"] and "equivalent" not in row]
    order = [key for key in (survived if again else every) if key in every and (again or key not in rows)]
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload(list(LIBRARIES))
    profile, begin = _profile(room, processes.Process), time.monotonic()
    for key in order[:number]:
        if time.monotonic() - begin > seconds:
            break
        noticed = _is_noticed(every[key], key[0], profile, again, processes.Process)
        row = dict(zip(("file", "function", "before", "after", "number"), key, strict=True))
        more = {"at first": False} if key in rows and noticed else {}
        more |= {"hangs": True} if noticed == "hangs" else {}
        rows[key] = {"room": room, "line": every[key].line, **row, "killed": bool(noticed), **more}
        RESULTS.write_text("".join(json.dumps(row) + "\n" for row in rows.values()))
        said = f"{time.monotonic() - begin:.0f} s: {noticed or 'SURVIVED'}"
        print(f"{said} line {every[key].line} {key}", file=sys.stderr, flush=True)


def _profile(room: str, start: Start) -> dict[str, dict[str, Any]]:
    """Tests of a room, the quickest first, with their duration and what they go through.

    What a file of tests goes through is kept while neither it nor the room changes.
    """
    profile: dict[str, dict[str, Any]] = {}
    room_text = b"".join((ROOT / file).read_bytes() for file in files_of(room))
    for tests in ROOMS[room][1]:
        for file in [ROOT / tests] if tests.endswith(".py") else sorted((ROOT / tests).rglob("test_*.py")):
            digest = hashlib.sha256(room_text + file.read_bytes()).hexdigest()
            path = Path(tempfile.gettempdir()) / f"impactcell-mutation-{digest}.json"
            if not path.exists():
                name = str(file.relative_to(ROOT))
                process = start(target=as_it_is, args=((name,), files_of(room), path))
                process.start()
                process.join()
                if not path.exists():
                    sys.exit(f"the tests of {name} do not pass as they are")
            profile |= json.loads(path.read_text())
    return dict(sorted(profile.items(), key=lambda item: item[1]["s"]))


def _is_noticed(
    mutant: Mutant, file: str, profile: dict[str, dict[str, Any]], all_tests: bool, start: Start
) -> str:
    """Say how tests notice a mutant; empty if they do not."""
    source = (ROOT / file).read_text(encoding="utf-8")
    product = [(path.stem, path.read_text(encoding="utf-8")) for path in (ROOT / "impactcell").rglob("*.py")]
    files = {name.split("::")[0] for name in profile}
    beside = [(Path(name).stem, (ROOT / name).read_text(encoding="utf-8")) for name in sorted(files)]
    changed = frozenset((Path(file).stem, name) for name in compiled_with(source, mutant.line))
    users = users_of(changed, product + beside) if changed else changed
    names_of_users = frozenset(name for _, name in users)

    def goes_through(place: str, test: dict[str, Any]) -> bool:
        itself = Path(place.partition("::")[0]).stem, place.rpartition("::")[2].partition("[")[0]
        entered = (name.split(".<locals>")[0].split(".")[-1] for _, name in test["through"])
        return (
            [file, mutant.function] in test["through"]
            or itself in users
            or any(name in names_of_users for name in entered)
            or (not mutant.function and any(entered == file for entered, _ in test["through"]))
        )

    tests = tuple(name for name, test in profile.items() if all_tests or goes_through(name, test))
    if not tests:
        return ""
    process = start(target=with_fault, args=(tests, file, mutant.applied(source), names_of_users))
    process.start()
    process.join(LONGEST_S + LONGER * sum(profile[name]["s"] for name in tests))
    code = process.exitcode
    process.kill()
    process.join()
    return {0: "", None: "hangs"}.get(code, "fails")


def attempt_named() -> None:
    """Try every fault that has a name, with the tests that have to notice it."""
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload(list(LIBRARIES))
    rows = [row for row in _named_on_file() if row["killed"]]
    for fault in NAMED_FAULTS:
        if any(row["what"] == fault.what for row in rows):
            continue
        source = faulty_source(fault, (ROOT / fault.file).read_text(encoding="utf-8"))
        process = processes.Process(target=with_fault, args=(fault.tests, fault.file, source, frozenset()))
        process.start()
        process.join()
        rows.append({"what": fault.what, "tests": fault.tests, "killed": process.exitcode == TESTS_FAILED})
        print(f"exit code {process.exitcode}: {fault.what}", file=sys.stderr, flush=True)
        NAMED_RESULTS.write_text("".join(json.dumps(row) + "\n" for row in rows))


def interval(killed: int, tried: int) -> str:
    """Wilson's interval of a share, 95 %."""
    share, z2 = killed / tried, 1.96**2
    middle = (share + z2 / (2 * tried)) / (1.0 + z2 / tried)
    half = math.sqrt(z2 * (share * (1.0 - share) + z2 / (4 * tried)) / tried) / (1.0 + z2 / tried)
    return f"{100 * (middle - half):.0f} to {100 * (middle + half):.0f} %"


def tables() -> list[Table]:
    """How many of the mutants on file were noticed, by room, and those that were not."""
    rows = []
    for room in ROOMS:
        tried = [row for row in on_file() if row["room"] == room]
        real = [row for row in tried if "equivalent" not in row]
        killed = sum(row["killed"] for row in real)
        first = sum(row["killed"] and row.get("at first", True) for row in real)
        noticed = f"{100 * killed / len(real):.0f} % ({killed} of {len(real)})" if real else "not tried"
        shown = noticed if real and killed >= BAR * len(real) else f"**{noticed}**"
        sure = interval(killed, len(real)) if real else ""
        equal = len(tried) - len(real)
        rows.append((room, f"{len(drawn(room))}", f"{equal}", f"{first}", f">= {BAR:.0%}", shown, sure))
    survivors = []
    for row in on_file():
        if not row["killed"]:
            fault = f"`{row['before']}` to `{row['after']}`".replace("|", "\\|")
            why = row.get("equivalent", "**not noticed**")
            survivors.append((row["room"], f"{row['file']}: {row['function']}", fault, why))
    return [
        Table(
            "Single faults in the code that a test of the same room notices",
            ("room", "possible", "explained", "noticed at first", "bar", "noticed", "interval (95 %)"),
            rows,
            f"Drawn with seed {SEED} from comparisons, operators, constants, conditions, calls and results. "
            "Noticed at first: before tests were written for those that survived. Explained: nothing that "
            "can be seen changes, or a choice is made otherwise; listed below with the reason, not counted.",
        ),
        Table("Faults that no test notices", ("room", "where", "fault", "why"), survivors),
        _named_table(),
    ]


def _named_on_file() -> list[dict[str, Any]]:
    lines = NAMED_RESULTS.read_text().splitlines() if NAMED_RESULTS.exists() else []
    return [json.loads(line) for line in lines]


def _named_table() -> Table:
    killed = {row["what"]: row["killed"] for row in _named_on_file()}
    said = {True: "yes", False: "**no**", None: "**not tried**"}
    rows = [
        (fault.what, ", ".join(f"`{test}`" for test in fault.tests), said[killed.get(fault.what)])
        for fault in NAMED_FAULTS
    ]
    return Table("Faults that had survived once", ("fault", "tests", "noticed"), rows)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.mutation", description=__doc__)
    parser.add_argument("room", choices=(*ROOMS, NAMED))
    parser.add_argument("number", type=int, nargs="?", default=1)
    parser.add_argument("seconds", type=float, nargs="?", default=math.inf)
    parser.add_argument("--again", action="store_true", help="those that survived")
    arguments = parser.parse_args()
    if arguments.room == NAMED:
        attempt_named()
    else:
        attempt(arguments.room, arguments.number, arguments.seconds, again=arguments.again)
