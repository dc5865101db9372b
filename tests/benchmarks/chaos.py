"""Faulty exchanges of 47 kinds on the fieldbus: nothing wrong, twice or untold.

Cells with a fieldbus map, a relay and a scripted module each; what comes is compared with what was made. A
run is a line of a file, and is not done twice.
"""

import asyncio
import contextlib
import json
import logging
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
import yaml

from impactcell.fieldbus.acquisition import ModuleAcquisition, ReceivedCycle
from impactcell.fieldbus.registers import RegisterMap
from simulator.faults import Fault, FaultInjector, FaultKind
from simulator.scripted import ScriptedDevice
from tests.benchmarks._chaos_faults import KINDS, REBOOTS, FaultPlan, FaultyDevice
from tests.benchmarks._chaos_links import Reached, over_faulty_tcp
from tests.benchmarks._fieldbus_faults import MAP, RESULTS, outages
from tests.benchmarks.table import Table

CELLS, FAULTS_A_CELL = 10, 50
"""At a time, and faulty exchanges of each in a run."""
PROBABILITY = 0.001
"""Of each fault of the server in a reply; of all of memory and wire together it is `MEMORY_AND_WIRE`."""
MEMORY_AND_WIRE = 0.04
"""Probability that something befalls a reading in the module's memory, and a reply on the wire."""
SAMPLES = 600
EPOCH_NS = 1_795_255_128_000_000_000
"""Time of the cycle before the first; each is a second later, so that its time tells which it is."""
LATE_S = 0.2
"""How late a late reply is: beyond the timeout, and within twice of it."""
MOST_UNSEEN = 5
"""So many cycles are made at most before the next poll, where counter or session outlive a restart."""
PATIENCE_S = 30.0
"""So long nothing new may come before a run counts as stuck."""


def samples_of(serial: int) -> dict[str, np.ndarray]:
    """Samples that no other cycle has."""
    draw = np.random.default_rng(serial)
    return {"force": draw.normal(0.0, 50.0, SAMPLES), "position": draw.normal(0.0, 1e-3, SAMPLES // 4)}


@dataclass
class Account:
    """What was made of a module, and what came of it."""

    made: int = 0
    made_in_life: int = 0
    came: Counter[int] = field(default_factory=Counter)
    unreadable: int = 0
    missed: int = 0
    wrong: int = 0
    restarts: int = 0
    at_reboot: set[int] = field(default_factory=set)
    """Cycles that nobody had read when the module was started anew: the restart is told, their number not."""

    @property
    def told(self) -> int:
        return len(self.came) + self.unreadable + self.missed + len(self.at_reboot)

    def take(self, received: ReceivedCycle) -> None:
        """Compare a cycle with what was made."""
        self.missed += received.missed
        self.restarts += received.restarted
        capture = received.capture
        if capture.force is None or capture.position is None:
            self.unreadable += 1
            return
        serial = (capture.time_ns - EPOCH_NS) // 10**9
        self.came[serial] += 1
        self.at_reboot.discard(serial)
        truth = samples_of(serial)
        is_right = (
            0 < serial <= self.made
            and capture.force.values.shape == truth["force"].shape
            and np.allclose(capture.force.values, truth["force"], atol=0.0126)
            and capture.position.values.shape == truth["position"].shape
            and np.allclose(capture.position.values, truth["position"], atol=0.6e-9)
            and abs(capture.velocity_m_s - 0.05) < 1e-8
        )
        self.wrong += not is_right


def make(device: FaultyDevice, account: Account, cycles: int) -> None:
    for _ in range(cycles):
        account.made += 1
        account.made_in_life += 1
        device.device.complete(
            samples_of(account.made), velocity=0.05, mass=18.9, stroke=0.0015, direction=1, force_rate=1e6,
            position_rate=1e5, cycle_time=EPOCH_NS + account.made * 10**9,
        )  # fmt: skip
        device.remember()


def reboot(kind: str, device: ScriptedDevice, account: Account, plan: FaultPlan) -> None:
    """Start the module anew, with an empty ring; its clock goes on."""
    session, counter = int(device.get("session")), int(device.get("cycle_counter"))
    if kind != "reboot_counter_kept":
        unread = account.made - account.told
        account.at_reboot |= {account.made - i for i in range(unread) if account.made - i not in account.came}
    match kind:
        case "reboot_same_session":
            device.start(session)
        case "reboot_counter_kept":
            device.start(session + 1, counter)
        case "reboot_counter_set":
            device.start(session + 1, 2**32 - 1 - plan.random.randrange(1, 10))
        case _:
            device.start(session + 1)
    account.made_in_life = 0


async def cell(seed: int, faults: int, reached: Reached = over_faulty_tcp) -> dict[str, int]:
    """Let one cell run until so many faults have happened, then in peace until all is there.

    `reached` is how its module is.
    """
    registers = RegisterMap.from_mapping(yaml.safe_load(MAP.read_text(encoding="utf-8")))
    plan, account = FaultPlan(seed, MEMORY_AND_WIRE), Account()
    device = FaultyDevice(ScriptedDevice(registers, session=7), plan)
    injector = FaultInjector(seed)
    for kind in FaultKind:
        injector.inject(Fault(kind, probability=PROBABILITY, seconds=LATE_S))
    stuck = goes_on = False

    def happened() -> int:
        return sum(plan.happened.values()) + sum(injector.happened.values())

    async with (
        reached(seed, device, plan, injector) as (server, client),
        ModuleAcquisition(f"cell-{seed}", client, registers) as module,
    ):

        async def follow() -> None:
            async with contextlib.aclosing(module.captures()) as cycles:
                async for received in cycles:
                    account.take(received)

        following = asyncio.create_task(follow())
        try:
            make(device, account, 1)
            while not account.came:  # what was overwritten before the first contact is nobody's loss
                await asyncio.sleep(0.002)
            while happened() < faults:
                for each in server.links:  # what was half open for good is a line that somebody has repaired
                    each._mute = each._mute and not server.is_line
                unread = account.made - account.told
                if plan.random.random() < 0.3 and account.made_in_life:
                    kind = plan.random.choice(REBOOTS)
                    if (
                        kind == "reboot_same_session"
                        and int(device.device.get("cycle_counter")) <= MOST_UNSEEN
                    ):
                        kind = "reboot_new_session"  # else nothing would show that the counter went back
                    if kind == "reboot_unread" or (not unread and account.made_in_life > MOST_UNSEEN):
                        plan.happened[kind] += 1
                        goes_on = kind not in ("reboot_new_session", "reboot_unread")
                        reboot(kind, device.device, account, plan)
                        if plan.random.random() < 0.5:
                            server.drop_clients()
                # Where session or counter go on, nobody can know of cycles that left the ring before a poll.
                most = MOST_UNSEEN if goes_on and account.made_in_life < registers.slots else 20
                make(device, account, min(most, plan.random.choice((1, 1, 1, 2, 5, 20))))
                if plan.random.random() < 0.9:
                    await until(lambda: account.told >= account.made or happened() >= faults, 5.0)
            plan.quiet = True
            injector.clear()
            make(device, account, 1)
            last = account.made
            stuck = not await until(lambda: last in account.came and account.told >= account.made, PATIENCE_S)
            await asyncio.sleep(0.1)
        finally:
            following.cancel()
            await asyncio.gather(following, return_exceptions=True)
    return {
        "made": account.made, "right": len(account.came), "wrong": account.wrong,
        "twice": sum(account.came.values()) - len(account.came),
        "untold": max(0, account.made - account.told), "falsely_missed": max(0, account.told - account.made),
        "stuck": stuck, "missed": account.missed, "unreadable": account.unreadable,
        "at_reboot": len(account.at_reboot), "restarts": account.restarts, "faults": happened(),
        **{f"fault {kind}": n for kind, n in (plan.happened + Counter(injector.happened)).items()},
    }  # fmt: skip


async def until(holds: object, longest_s: float) -> bool:
    """Wait until something holds, so long at most."""
    assert callable(holds)
    loop = asyncio.get_running_loop()
    end_s = loop.time() + longest_s
    while not holds():
        if loop.time() > end_s:
            return False
        await asyncio.sleep(0.002)
    return True


def study(wanted: int) -> tuple[Counter[str], int]:
    """Run until so many faulty exchanges are on file; sums over all runs, and their number."""
    file = RESULTS / "chaos.jsonl"
    file.parent.mkdir(exist_ok=True)
    runs = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    while sum(run["faults"] for run in runs) < wanted:

        async def together(first: int) -> list[dict[str, int]]:
            return await asyncio.gather(*(cell(first + i, FAULTS_A_CELL) for i in range(CELLS)))

        fresh = asyncio.run(together(len(runs)))
        with file.open("a") as out:
            out.writelines(json.dumps(run) + "\n" for run in fresh)
        runs += fresh
    total = Counter[str]()
    for run in runs:
        total.update(run)
    return total, len(runs)


def tables(quick: bool = False) -> list[Table]:
    """What came through, and how soon after an outage."""
    logging.disable(logging.CRITICAL)
    try:
        seen, runs = study(500 if quick else 10_000)
        trials = 8 if quick else 64
        trial = asyncio.run(outages(trials))
    finally:
        logging.disable(logging.NOTSET)
    kinds = [kind for kind in KINDS if seen[f"fault {kind}"]]
    first_s = np.array([each[0] for each in trial])
    rows = [
        ("faulty exchanges", ">= 10000", f"{seen['faults']}", f"{runs} runs, windows 1, 4, 16 and found"),
        (
            "kinds of them",
            ">= 40",
            f"{len(kinds)}",
            f"each {min(seen[f'fault {k}'] for k in kinds)} at least",
        ),
        ("cycles made / taken right", "", f"{seen['made']} / {seen['right']}", ""),
        ("wrong content", "0", f"{seen['wrong']}", f"<= {3.0 / seen['right']:.1e} a cycle (95 %)"),
        ("taken twice", "0", f"{seen['twice']}", ""),
        ("lost without being told", "0", f"{seen['untold']}", ""),
        ("told as lost and not lost", "0", f"{seen['falsely_missed']}", ""),
        ("runs that did not come to an end", "0", f"{seen['stuck']}", ""),
        ("told: overwritten / unreadable", "", f"{seen['missed']} / {seen['unreadable']}", ""),
        (
            "unread when the module was started anew",
            "",
            f"{seen['at_reboot']}",
            f"{seen['restarts']} restarts told; how many cycles were before them cannot be known",
        ),
        (
            "link back to first new cycle, default back-off",
            "<= 0.5 s",
            f"{first_s.max():.2f} s at most",
            f"median {np.median(first_s):.2f} s, {trials} outages",
        ),
    ]
    return [
        Table(
            "Faulty exchanges between module and service",
            ("what", "bar", "measured", "interval"),
            rows,
            "Kinds: " + ", ".join(f"{kind} {seen[f'fault {kind}']}" for kind in kinds) + ".",
        )
    ]
