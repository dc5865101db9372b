"""Serves a scenario over Modbus until it is told to stop."""

import asyncio
import contextlib
import errno
import json
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TextIO

from impactcell.errors import MapError, SettingsError
from impactcell.fieldbus.registers import RegisterMap
from impactcell.process import yaml_loader
from impactcell.process.signals import stop_on_end_of_input, stop_on_signals
from simulator.control import Control
from simulator.device import Device, Truth
from simulator.fault_schedule import arm
from simulator.faults import FaultInjector
from simulator.listening import server_of
from simulator.map_faults import map_faults
from simulator.scenario import Scenario, read_scenario
from simulator.serial_line import SerialServer

LONGEST_NAP_S = 0.5
"""The module is brought up to date at least so often, seconds."""


def read_register_map(file: Path) -> RegisterMap:
    """Read a register map.

    Raises
    ------
    SettingsError
        The file cannot be read, or is no map.
    """
    content, _ = yaml_loader.load(file)
    try:
        return RegisterMap.from_mapping(content)
    except (MapError, TypeError, AttributeError) as error:
        message = f"{file}: {error}"
        raise SettingsError(message) from error


def read_scenario_and_map(file: Path) -> tuple[Scenario, RegisterMap]:
    """Read a scenario, and the register map that it names.

    Raises
    ------
    SettingsError
        Every fault at once, as `file:line:column: message`: of the scenario, of the map, or of the scenario
        with that map.
    """
    scenario = read_scenario(file)
    registers = read_register_map(file.parent / scenario.register_map)
    faults = tuple(map_faults(scenario, registers))
    if faults:
        _, positions = yaml_loader.load(file)
        told = (
            yaml_loader.format_error(file, positions.value(fault.location), fault.message) for fault in faults
        )
        raise SettingsError("\n".join(told))
    return scenario, registers


@contextlib.contextmanager
def _truths(file: Path | None, *, verbose: bool) -> Iterator[Callable[[Truth], None]]:
    """Give a function that writes each truth as a JSON line, at once: to `file`, and to stderr if verbose."""
    with contextlib.ExitStack() as stack:
        outs: list[TextIO] = [sys.stderr] if verbose else []
        if file is not None:
            outs.append(stack.enter_context(file.open("w", encoding="utf-8")))

        def write(truth: Truth) -> None:
            for out in outs:
                out.write(json.dumps(truth) + "\n")
                out.flush()

        yield write


async def serve(
    scenario: Scenario,
    registers: RegisterMap,
    truth_file: Path | None = None,
    *,
    verbose: bool = False,
    until_stdin_ends: bool = False,
) -> bool:
    """Serve until SIGTERM or SIGINT; prints one JSON line with the addresses once it listens.

    Parameters
    ----------
    scenario : Scenario
    registers : RegisterMap
    truth_file : Path, optional
        Where each truth is written.
    verbose : bool
        Each truth is written to standard error, too.
    until_stdin_ends : bool
        It ends with standard input, too.

    Returns
    -------
    bool
        Whether SIGINT, as of Ctrl-C, has ended it.

    Raises
    ------
    SettingsError
        The scenario asks for what a module with this map cannot do or show.
    """
    faults = [f"{scenario.name}: {fault.message}" for fault in map_faults(scenario, registers)]
    if faults:
        raise SettingsError("\n".join(faults))
    loop = asyncio.get_running_loop()
    stop = asyncio.Event()
    with stop_on_signals(stop) as received, _truths(truth_file, verbose=verbose) as tell:
        epoch_ns = time.time_ns()
        device = Device(
            scenario,
            registers,
            session=epoch_ns // 1_000_000 % (2**32 - 1) + 1,
            epoch_ns=epoch_ns,
            now_s=loop.time(),
            on_truth=tell,
        )
        with stop_on_end_of_input(stop) if until_stdin_ends else contextlib.nullcontext():
            await _serve(scenario, device, stop)
    return signal.SIGINT in received


async def _serve(scenario: Scenario, device: Device, stop: asyncio.Event) -> None:
    loop = asyncio.get_running_loop()
    listen = scenario.listen
    faults = FaultInjector(scenario.seed)
    server = server_of(listen, device, faults, before=lambda: device.request_came(loop.time()))

    def restart() -> int:
        server.drop_clients()
        return device.restart()

    actions: dict[str, Callable[..., object]] = {
        "restart": restart,
        "set_counter": device.set_counter,
        "busy": device.busy,
        "overrun": device.overrun,
        "drop_clients": server.drop_clients,
    }
    async with contextlib.AsyncExitStack() as stack:
        await stack.enter_async_context(server)
        started = {
            "cell": scenario.name,
            "host": listen.host,
            "port": server.port,
            "device_id": listen.device_id,
        }
        if isinstance(server, SerialServer):
            started["serial"] = server.device_file
        if listen.control_port is not None:
            control = await stack.enter_async_context(Control(faults, actions, listen.control_port))
            started["control_port"] = control.port
        for handle in arm(scenario.faults, faults, actions):
            stack.callback(handle.cancel)
        print(json.dumps(started), flush=True)  # noqa: T201 - the address is this verb's output
        while not stop.is_set():
            device.update(loop.time())
            nap_s = min(max(device.due_s - loop.time(), 0.0), LONGEST_NAP_S)
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(nap_s):
                    await stop.wait()


def run(
    scenario: Scenario,
    registers: RegisterMap,
    truth_file: Path | None = None,
    *,
    verbose: bool = False,
    until_stdin_ends: bool = False,
) -> int:
    """Serve in an event loop of its own; returns the exit code.

    Raises
    ------
    KeyboardInterrupt
        Ended by Ctrl-C, after all was put away.
    """
    try:
        interrupted = asyncio.run(
            serve(scenario, registers, truth_file, verbose=verbose, until_stdin_ends=until_stdin_ends)
        )
    except OSError as error:
        way_out = "; --port chooses another" if error.errno == errno.EADDRINUSE else ""
        told = f"{scenario.name}: cannot listen or write: {error.strerror or error}{way_out}"
        print(told, file=sys.stderr)  # noqa: T201
        return 1
    if interrupted:
        raise KeyboardInterrupt
    return 0
