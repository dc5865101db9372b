"""Clients of others against our simulator: pymodbus's, and mbpoll, which has to agree with the map's text."""

import asyncio
import math
import re
import shutil
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from pymodbus.client import AsyncModbusTcpClient

from impactcell.fieldbus.registers import RegisterMap
from simulator.modbus_server import ModbusServer
from simulator.scripted import ScriptedDevice

pytestmark = pytest.mark.interop
MAP = Path(__file__).resolve().parents[2] / "config" / "maps" / "fpga-v1.yaml"
DECLARED: dict[str, Any] = yaml.safe_load(MAP.read_text(encoding="utf-8"))["registers"]
FORCE = np.array([0.0, 12.5, -3.25, 400.0])
POSITION = np.array([0.0, 1e-6, 2.5e-3])


def module() -> ScriptedDevice:
    device = ScriptedDevice(
        RegisterMap.from_mapping(yaml.safe_load(MAP.read_text(encoding="utf-8"))), session=9
    )
    device.put("serial_number", "SN-0042")
    device.complete(
        {"force": FORCE, "position": POSITION},
        velocity=0.05,
        mass=18.9,
        dwell=1.5,
        direction=-1,
        force_rate=1e6,
        force_start=-2e-6,
        position_rate=1e5,
        peak_force=213.5,
        sliding_distance=0.0042,
        batch_id="B-17",
        cycle_time=1_795_255_128_123_456_789,
    )
    device.write(DECLARED["slot_select"]["address"], np.array([1], dtype=">u2"))
    return device


async def test_pymodbus_client_reads_and_writes() -> None:
    device = module()
    async with ModbusServer(device) as server:
        client = AsyncModbusTcpClient("127.0.0.1", port=server.port)
        assert await client.connect()
        status = await client.read_holding_registers(DECLARED["session"]["address"], count=4, device_id=1)
        assert client.convert_from_registers(status.registers, client.DATATYPE.UINT32) == [9, 1]
        same = await client.read_input_registers(DECLARED["session"]["address"], count=4, device_id=1)
        assert same.registers == status.registers
        force = await client.read_holding_registers(DECLARED["force"]["address"], count=4, device_id=1)
        codes = client.convert_from_registers(force.registers, client.DATATYPE.INT16)
        np.testing.assert_allclose(np.array(codes) * DECLARED["force"]["scale"], FORCE, atol=1e-9)
        written = await client.write_registers(
            DECLARED["acknowledge_session"]["address"], [0, 9, 0, 1], device_id=1
        )
        assert not written.isError()
        assert device.acknowledged == [(9, 1)]
        single = await client.write_register(DECLARED["slot_select"]["address"], 3, device_id=1)
        assert not single.isError()
        assert (await client.write_register(DECLARED["state"]["address"], 3, device_id=1)).exception_code == 2
        assert (
            await client.write_register(DECLARED["slot_select"]["address"], 99, device_id=1)
        ).exception_code == 3
        assert (await client.read_coils(0, count=1, device_id=1)).exception_code == 1
        client.close()


OPTION = {
    "u16": "4",
    "i16": "4",
    "string": "4:hex",
    "u32": "4:int",
    "i32": "4:int",
    "f32": "4:float",
    "u64": "4:hex",
}


async def mbpoll(port: int, entry: dict[str, Any], count: int) -> list[str]:
    """Values as mbpoll prints them; addresses and word order as the map's text says."""
    process = await asyncio.create_subprocess_exec(
        "mbpoll", "-m", "tcp", "-p", str(port), "-a", "1", "-0", "-B", "-1", "-q",
        "-r", str(entry["address"]), "-c", str(count), "-t", OPTION[entry["type"]], "127.0.0.1",
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    out, error = await process.communicate()
    assert process.returncode == 0, error.decode()
    return re.findall(r"^\[\d+\]:\s+(\S+)", out.decode(), flags=re.MULTILINE)


def as_documented(entry: dict[str, Any], shown: list[str]) -> Any:
    """Value of a register from what mbpoll shows, by the words of the map file alone."""
    if entry["type"] in ("string", "u64"):
        data = b"".join(struct.pack(">H", int(word, 16)) for word in shown)
        return data.split(b"\0")[0].decode() if entry["type"] == "string" else int.from_bytes(data, "big")
    if entry["type"] == "f32":
        numbers: list[float] = [float(text) for text in shown]
    else:
        # mbpoll marks values beyond the signed range with the signed value behind them
        bits = int(entry["type"][1:])
        raw = [int(text) & (2**bits - 1) for text in shown]
        signed = entry["type"][0] == "i"
        numbers = [value - 2**bits if signed and value >= 2 ** (bits - 1) else value for value in raw]
    scaled = [number * entry.get("scale", 1) for number in numbers]
    return scaled if len(scaled) > 1 else scaled[0]


EXPECTED: dict[str, Any] = {
    "module_name": "IMPACT-FPGA",
    "serial_number": "SN-0042",
    "map_version": 1,
    "state": 1,
    "session": 9,
    "cycle_counter": 1,
    "ring_cycle": [0, 1] + 14 * [0],
    "slot_select": 1,
    "window_slot": 1,
    "window_cycle": 1,
    "window_session": 9,
    "direction": -1,
    "cycle_time": 1_795_255_128_123_456_789,
    "velocity": 3000.0,  # mm/min
    "mass": 18.9,
    "dwell": 1.5,
    "peak_force": 213.5,
    "sliding_distance": 4200.0,  # um
    "batch_id": "B-17",
    "force_rate": 1_000_000,
    "force_start": -2000,  # ns
    "force_count": 4,
    "position_count": 3,
    "force": [0.0, 12.5, -3.25, 400.0],
    "position": [0, 1000, 2_500_000],  # nm
}


@pytest.mark.slow
@pytest.mark.parametrize("name", EXPECTED)
async def test_mbpoll_agrees_with_the_map(name: str) -> None:
    if shutil.which("mbpoll") is None:
        pytest.skip("mbpoll is not installed")
    entry, expected = DECLARED[name], EXPECTED[name]
    registers = entry.get("length") or (4 if entry["type"] == "u64" else None)
    count = registers or (len(expected) if isinstance(expected, list) else 1)
    async with ModbusServer(module()) as server:
        value = as_documented(entry, await mbpoll(server.port, entry, count))
    if isinstance(expected, str):
        assert value == expected
    else:
        assert value == pytest.approx(expected, rel=1e-5)


async def test_mbpoll_writes_and_is_refused_as_the_map_says() -> None:
    if shutil.which("mbpoll") is None:
        pytest.skip("mbpoll is not installed")
    device = module()
    async with ModbusServer(device) as server:

        async def write(name: str, value: str, kind: str) -> int | None:
            process = await asyncio.create_subprocess_exec(
                "mbpoll", "-m", "tcp", "-p", str(server.port), "-a", "1", "-0", "-B", "-1", "-q",
                "-r", str(DECLARED[name]["address"]), "-t", kind, "127.0.0.1", value,
                stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.DEVNULL,
            )  # fmt: skip
            return await process.wait()

        assert await write("slot_select", "3", "4") == 0
        assert device.get("window_slot") == 0
        assert device.get("window_cycle") == 0
        assert await write("command_velocity", "4500", "4:float") == 0
        assert math.isclose(device.get("command_velocity"), 0.075, rel_tol=1e-6)
        assert await write("cycle_counter", "5", "4:int") != 0
        assert device.get("cycle_counter") == 1
