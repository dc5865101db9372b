"""What the demo runs on: a simulator in a process of its own, and a cell made to talk to it."""

import contextlib
import json
import math
import secrets
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import yaml

from impactcell.demo.tour import tour
from impactcell.errors import ImpactCellError, SettingsError
from impactcell.physics.effect_names import in_words
from impactcell.process.console import is_quiet
from impactcell.process.progress import named_steps
from impactcell.process.shipped import ROOT, shipped_config
from impactcell.scada import Role
from impactcell.scada.users import User, with_password, write_users
from impactcell.service.factory import cell_design
from impactcell.service.warmup import warm_up
from impactcell.settings import CellConfig, read_cell
from impactcell.web import TourStop

CONFIG = shipped_config()
"""Cells and scenarios that come with the program."""
SCENARIOS = ("demo", "new-effect", "positioning")
USER = "demo"
EVENT_SECTIONS = (("batches", "from_cycle"), ("deviations", "cycle"), ("appearances", "from_cycle"))
TOUR_OVER = "that was the tour: acknowledge the alarms on the page, drop a measurement there; Ctrl-C ends"
AFTERMATH_CYCLES = 40
"""After the last event, in which what it does is found and can be looked at."""
PREFERRED_PORT = 4840
"""Registered port of OPC UA (IANA)."""
PREFERRED_PAGE_PORT = 8480
"""Customary port of the page."""


@dataclass(frozen=True, slots=True)
class DemoSetup:
    """A cell whose module answers, and the user who may look at it.

    Attributes
    ----------
    cell : CellConfig
    story : tuple of (int, str)
        What happens in the cell: from which cycle on, and in words.
    password : str
        Of the user `demo`; made anew for each demo.
    last_target_m : float
        Where the last part should go; nan where cycles come without end.
    stops : tuple of TourStop
        The same as the page tells it.
    tour_end : tuple of (int, str)
        What is said once all has happened; empty where the demo finds the end itself.
    """

    cell: CellConfig
    story: tuple[tuple[int, str], ...]
    password: str
    last_target_m: float = math.nan
    stops: tuple[TourStop, ...] = ()
    tour_end: tuple[tuple[int, str], ...] = ()


@contextlib.contextmanager
def set_up_scenario(scenario: str, cycles: int | None) -> Iterator[DemoSetup]:
    """Start the simulator with a scenario of `config/sim`; what it needs is gone afterwards.

    Raises
    ------
    SettingsError
        There is no such scenario.
    ImpactCellError
        The simulator did not start.
    """
    source = CONFIG / "sim" / f"{scenario}.yaml"
    if scenario not in SCENARIOS:
        raise SettingsError(f"there is no scenario '{scenario}'; choose one of {', '.join(SCENARIOS)}")
    if not source.is_file():
        raise SettingsError(
            f"the demo's scenarios are missing: there is no {source}; install the program anew"
        )
    directory = Path(tempfile.mkdtemp(prefix="impactcell-demo-"))
    try:
        content = yaml.safe_load(source.read_text(encoding="utf-8"))
        content["register_map"] = str((source.parent / content["register_map"]).resolve())
        content = fit_events(content, cycles)
        played = directory / "scenario.yaml"
        played.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
        password = secrets.token_urlsafe(9)
        write_users(directory / "users.yaml", {USER: with_password(User(USER, Role.ENGINEER), password)})
        with contextlib.nullcontext(lambda _: None) if is_quiet() else named_steps() as begin_step:
            begin_step("setting up")
            warm_up(cell_design(read_cell(CONFIG / "cells" / f"{scenario}.yaml")))
        with (
            _simulator(played) as module_port,
            customary_port(PREFERRED_PORT) as opcua_port,
            customary_port(PREFERRED_PAGE_PORT) as page_port,
        ):
            cell = read_cell(_write_cell_file(scenario, directory, module_port, opcua_port, page_port))
            yield DemoSetup(
                cell, story(content), password, last_target_m(content), tour(content), tour_end(content)
            )
    finally:
        shutil.rmtree(directory, ignore_errors=True)


def fit_events(content: dict, cycles: int | None) -> dict:  # type: ignore[type-arg]
    """Move what happens in a scenario to where a demo of `cycles` cycles has it in view."""
    if cycles is None:
        return content
    last = max([1, *(entry[key] for section, key in EVENT_SECTIONS for entry in content.get(section, []))])
    scale = min(1.0, 0.9 * cycles / last)
    moved = {
        section: _moved(content[section], key, scale) for section, key in EVENT_SECTIONS if section in content
    }
    return {**content, **moved}


def _moved(entries: list, key: str, scale: float) -> list:  # type: ignore[type-arg]
    """Move entries by a factor, each behind the one before, as a scenario wants its batches."""
    moved, cycle = [], 0
    for entry in entries:
        cycle = max(cycle + 1, round(entry[key] * scale))
        moved.append({**entry, key: cycle})
    return moved


def story(content: dict) -> tuple[tuple[int, str], ...]:  # type: ignore[type-arg]
    """Tell what a scenario does, from which cycle on."""
    events = [(1, "the surface wears: mu_s grows slowly")] if content.get("wear") else []
    if content.get("positioning"):
        events.append((1, "parts come one after the other and are tapped to their targets"))
    events += [
        (
            batch["from_cycle"],
            f"batch {batch['id']} is on the table"
            + ("" if batch.get("announced", True) else ", and the PLC says nothing of it"),
        )
        for batch in content.get("batches", [])
        if batch["from_cycle"] > 1
    ]
    events += [
        (deviation["cycle"], f"cycle {deviation['cycle']} is odd: a {deviation['kind']} along its slide")
        for deviation in content.get("deviations", [])
    ]
    events += [
        (entry["from_cycle"], f"a new effect acts in the plant: {', '.join(map(in_words, entry['effects']))}")
        for entry in content.get("appearances", [])
    ]
    return tuple(sorted(events))


def tour_end(content: dict) -> tuple[tuple[int, str], ...]:  # type: ignore[type-arg]
    """Say from which cycle on the tour is over; nothing where a last part or a new model ends it."""
    if content.get("positioning") or content.get("appearances"):
        return ()
    last = max((cycle for cycle, _ in story(content)), default=1)
    return ((last + AFTERMATH_CYCLES + 1, TOUR_OVER),)


def last_target_m(content: dict) -> float:  # type: ignore[type-arg]
    """Find where the last part of a scenario should go; nan where no parts come."""
    tasks = content.get("positioning", {}).get("tasks", [])
    return float(tasks[-1]["target_m"]) if tasks else math.nan


@contextlib.contextmanager
def _simulator(scenario: Path) -> Iterator[int]:
    errors = (scenario.parent / "simulator.log").open("w+", encoding="utf-8")
    process = subprocess.Popen(  # noqa: S603 - our own simulator
        [sys.executable, "-m", "simulator", "serve", str(scenario), "--until-stdin-ends"],
        stdin=subprocess.PIPE,  # it ends with this process, whatever ends that
        stdout=subprocess.PIPE,
        stderr=errors,
        text=True,
        cwd=ROOT,
    )
    try:
        assert process.stdout is not None  # noqa: S101 - a pipe was asked for
        line = process.stdout.readline()
        if not line:
            process.wait(timeout=5)
            errors.seek(0)
            raise ImpactCellError(f"the simulator did not start: {errors.read().strip()}")
        yield int(json.loads(line)["port"])
    finally:
        process.terminate()
        process.communicate()
        errors.close()


def _write_cell_file(
    scenario: str, directory: Path, module_port: int, opcua_port: int, page_port: int
) -> Path:
    """Write the scenario's cell file anew: for these ports, with all that it writes in `directory`."""
    source = CONFIG / "cells" / f"{scenario}.yaml"
    content = yaml.safe_load(source.read_text(encoding="utf-8"))
    model = directory / "model.yaml"
    shutil.copy(source.parent / content["model"], model)
    content["model"] = str(model)
    content["module"]["port"] = module_port
    content["module"]["register_map"] = str((source.parent / content["module"]["register_map"]).resolve())
    content["opcua"]["endpoint"] = f"opc.tcp://127.0.0.1:{opcua_port}/impactcell"
    content["web"] = {"endpoint": f"http://127.0.0.1:{page_port}"}
    path = directory / "cell.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return path


@contextlib.contextmanager
def customary_port(preferred: int) -> Iterator[int]:
    """Have a customary port while the demo runs; 0, any free one, where it is taken.

    The datagram port of the same number is held meanwhile, so that of demos that start at once one has it.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mark:
        port = preferred
        try:
            mark.bind(("127.0.0.1", preferred))
            socket.create_server(("127.0.0.1", preferred)).close()
        except OSError:
            port = 0
        yield port
