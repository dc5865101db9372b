"""A cell that runs with its page, people who log in to it, and what every page is held to."""

import asyncio
import contextlib
import os
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import pytest

from impactcell.journal.audit_entries import AuditEntry
from impactcell.journal.store import Journal
from impactcell.records import Snapshot
from impactcell.scada import Role
from impactcell.scada.users import User, with_password, write_users
from tests.browser.chromium import Browser
from tests.integration.processes import write_cell
from tests.integration.stepped import SteppedModule, stepped
from tests.integration.watched import Watched, serving

T = TypeVar("T")
CELL = "press-1"
PERIOD_S = 0.5
"""Between the cycles of a cell that somebody looks at."""
PASSWORDS = {"eva": "engineer-1", "otto": "operator-1", "olga": "observer-1"}
ROLES = {"eva": Role.ENGINEER, "otto": Role.OPERATOR, "olga": Role.OBSERVER}
ASKED_BY_AXE = "Failed to execute 'postMessage'"
"""What the browser complains of where axe-core asks a report in its sandbox, which has no origin."""
AXE = Path(__file__).parent / "node_modules" / "axe-core" / "axe.min.js"

WRAPPED = """
    const lines = (link) => link.clientHeight / parseFloat(getComputedStyle(link).lineHeight);
    const entries = [...document.querySelectorAll("nav a")];
    return entries.filter((link) => lines(link) > 2.2).map((link) => link.innerText);
"""
"""Entries of the navigation that take more than their line and the room around it."""


@dataclass
class Shop:
    """A cell that runs, with its page."""

    watched: Watched
    directory: Path
    module: SteppedModule
    cell: str = CELL

    @property
    def page(self) -> str:
        return self.watched.service.pages[self.cell]

    @property
    def endpoint(self) -> str:
        return self.watched.service.endpoints[self.cell]

    @property
    def last(self) -> Snapshot:
        return self.watched.snapshots[self.cell][-1]

    def audit(self) -> tuple[AuditEntry, ...]:
        """What people did, as the journal has it."""
        with Journal(self.directory / f"{self.cell}.sqlite", self.cell, read_only=True) as journal:
            return journal.audit()

    async def beside(self, work: Callable[[], T]) -> T:
        """Let a person do something in a thread, while the service runs on."""
        return await asyncio.to_thread(work)


@contextlib.asynccontextmanager
async def at_work(
    directory: Path, cycles: int, scenario: dict[str, Any], name: str = CELL, **cell: Any
) -> AsyncIterator[Shop]:
    """Run a cell with its page that has so many cycles behind it and goes on striking."""
    write_shop_users(directory)
    async with stepped(**scenario) as module:
        file = write_cell(directory, module.port, name, web={"endpoint": "http://127.0.0.1:0"}, **cell)
        async with serving(file) as watched:
            for made in range(1, cycles + 1):
                module.strike()
                await watched.until(name, made)
            striking = asyncio.create_task(_go_on(module))
            try:
                yield Shop(watched, directory, module, name)
            finally:
                striking.cancel()


async def _go_on(module: SteppedModule) -> None:
    while True:
        await asyncio.sleep(PERIOD_S)
        module.strike()


def write_shop_users(directory: Path) -> None:
    """Write the users file: one of each role."""
    users = {name: with_password(User(name, role), PASSWORDS[name]) for name, role in ROLES.items()}
    write_users(directory / "users.yaml", users)


def enter(browser: Browser, shop: Shop, user: str) -> None:
    browser.open(shop.page)
    browser.log_in(user, PASSWORDS[user])
    browser.until(lambda: browser.path == "/", "the cells")


def judge(browser: Browser, name: str, picture: Path, width: int) -> list[str]:
    """Take a picture; say what is too wide, what the browser complains of, what axe-core finds serious."""
    browser.screenshot(picture)
    faults = [f"{name}: {fault}" for fault in browser.faults()]
    if browser.run("return Math.max(document.documentElement.scrollWidth, innerWidth)") > width:
        faults.append(f"{name}: is too wide")
    faults += [f"{name}: {entry} takes two lines" for entry in browser.run(WRAPPED)]
    if not AXE.is_file():
        if os.environ.get("IMPACTCELL_CI"):
            pytest.fail("CI installs axe-core; it is missing")
        return faults
    # The policy of the page lets no script in; this one comes in as a debugger's.
    browser.driver.execute_cdp_cmd("Runtime.evaluate", {"expression": AXE.read_text()})
    run = "const done = arguments[arguments.length - 1]; axe.run().then((found) => done(found.violations));"
    violations = browser.driver.execute_async_script(run)
    faults += [f"{name}: {fault}" for fault in browser.faults() if ASKED_BY_AXE not in fault]
    serious = [v for v in violations if v["impact"] in ("serious", "critical")]
    return faults + [f"{name}: {v['id']}: {[node['html'][:160] for node in v['nodes']]}" for v in serious]
