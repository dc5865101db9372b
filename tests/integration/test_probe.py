"""`impactcell probe` looks at a live module. Truth: what the simulator says it did."""

import asyncio
import re
import ssl
from pathlib import Path

import pytest
import yaml

from tests.certificates import Authority
from tests.integration.forked import forked
from tests.integration.processes import CONFIG, simulator, write_cell


async def probed(cell: Path) -> tuple[int | None, str, str]:
    async with forked("impactcell", "probe", str(cell)) as process:
        assert process.output is not None
        out = await process.output.read()
        code = await process.process.wait()
    return code, out.decode(), "".join(f"{line}\n" for line in process.lines)


@pytest.mark.slow
async def test_identity_status_and_one_tap_are_shown(tmp_path: Path) -> None:
    strikes = {"period_s": 0.1, "cycles": 20, "velocities_mm_per_min": [4200.0]}
    async with simulator(tmp_path, strikes=strikes) as module:
        cell = write_cell(tmp_path, module["port"])
        for _ in range(100):
            code, out, err = await probed(cell)
            if "cycle 20, the ring holds 16 of 16" in out:
                break
    assert (code, err) == (0, "")
    for said in (
        "identity    module_name IMPACT-FPGA, serial_number SIM-0001, map_version 1, firmware_version 256",
        "made by     vendor impactcell, product code SIM, revision 1.0, product Simulated measuring module",
        "status      ready, session ",
        "tap         cycle 20, 20",
        "4200 mm/min, 18.9 kg, stroke 1.5 mm, direction +1",
        "force       ",
        "position    ",
    ):
        assert said in out, out


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            {"word_order": "little"},
            r"press-1: .*the word order is wrong, with `word_order: big` all of it can be; see \S+:\d+:\d+$",
        ),
        ({"device_id": 9}, r"press-1: .*device_id 9 is wrong; see \S+press-1\.yaml:\d+:14$"),
    ],
)
async def test_what_is_wrong_is_named(tmp_path: Path, change: dict[str, object], told: str) -> None:
    async with simulator(tmp_path, strikes={"period_s": 0.1}) as module:
        cell = write_cell(tmp_path, module["port"], module={"timeout_ms": 4000, **change})
        code, out, err = await probed(cell)
    assert (code, out) == (1, "")
    assert re.search(told, err, re.MULTILINE)
    place = re.search(r"see (\S+):(\d+):(\d+)$", err, re.MULTILINE)
    assert place is not None
    lines = await asyncio.to_thread(Path(place[1]).read_text)
    assert next(iter(change)) in lines.splitlines()[int(place[2]) - 1]


async def test_addresses_that_are_off_by_one_lead_to_the_map(tmp_path: Path) -> None:
    content = yaml.safe_load((CONFIG / "maps" / "fpga-v1.yaml").read_text())
    for register in content["registers"].values():
        register["address"] += 1
        register.pop("expect", None)
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text(yaml.safe_dump(content))
    async with simulator(tmp_path, strikes={"period_s": 0.1}) as module:
        cell = write_cell(tmp_path, module["port"], module={"timeout_ms": 4000, "register_map": str(wrong)})
        code, out, err = await probed(cell)
    assert (code, out) == (1, "")
    place = re.search(
        r"press-1: .* 8 readings of the status block do not fit its CRC; addresses of map fpga-v1 may be .*, "
        rf"or off by one: .*; see {re.escape(str(wrong))}:(\d+):\d+$",
        err,
        re.MULTILINE,
    )
    assert place is not None, err
    assert "status_crc32:" in wrong.read_text().splitlines()[int(place[1]) - 1]


@pytest.mark.parametrize("transport", ["tcp", "rtu_over_tcp", "udp"])
async def test_a_module_that_stays_silent_has_its_device_id_named(tmp_path: Path, transport: str) -> None:
    """A module may answer no device_id but its own, or no client but its first."""
    loop = asyncio.get_running_loop()
    if transport == "udp":
        server, _ = await loop.create_datagram_endpoint(asyncio.DatagramProtocol, ("127.0.0.1", 0))
        port = server.get_extra_info("sockname")[1]
    else:
        server = await loop.create_server(asyncio.Protocol, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
    cell = write_cell(tmp_path, port, module={"device_id": 7, "transport": transport, "window": 1})
    code, out, err = await probed(cell)
    server.close()
    assert (code, out) == (1, "")
    assert re.match(
        rf"impactcell: press-1: 127\.0\.0\.1:{port}.* device 7: no answer to .* within 500 ms \(timeout_ms\)",
        err,
    )
    assert re.search(r"device_id 7 may be wrong, .* \(see \S+press-1\.yaml:\d+:14\); or another client", err)


async def test_another_protocol_at_the_address_is_named_with_its_line(tmp_path: Path) -> None:
    class Web(asyncio.Protocol):
        def data_received(self, _: bytes) -> None:
            self.transport.write(b"HTTP/1.1 400 Bad Request\r\n\r\n")

        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            assert isinstance(transport, asyncio.Transport)
            self.transport = transport

    server = await asyncio.get_running_loop().create_server(Web, "127.0.0.1", 0)
    code, out, err = await probed(write_cell(tmp_path, server.sockets[0].getsockname()[1]))
    server.close()
    assert (code, out) == (1, "")
    told = "HTTP answers there, not Modbus TCP; give the module's own host and port, and its transport: see "
    assert re.search(
        rf"press-1: 127\.0\.0\.1:\d+ device 1: {told}\S+press-1\.yaml:\d+:\d+$", err, re.MULTILINE
    )


async def test_a_module_that_closes_the_connection_may_be_held_by_another(tmp_path: Path) -> None:
    class Closing(asyncio.Protocol):
        def data_received(self, _: bytes) -> None:
            self.transport.close()

        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            self.transport = transport

    server = await asyncio.get_running_loop().create_server(Closing, "127.0.0.1", 0)
    code, out, err = await probed(write_cell(tmp_path, server.sockets[0].getsockname()[1]))
    server.close()
    assert (code, out) == (1, "")
    assert "press-1: " in err
    assert (
        "connection lost; a module that takes one client may have closed it for another, the service" in err
    )


@pytest.mark.parametrize(
    ("name", "unit", "wrong", "told", "doubts"),
    [
        ("velocity", "mm/min", "mm/s", "velocity 252000 mm/min is not within the 2000 to 6000 mm/min", 1),
        ("mass", "kg", "g", "mass 0.0189 kg is not within the ", 2),  # force and motion contradict it, too
    ],
)
async def test_a_wrong_unit_of_what_the_model_knows_is_named(
    tmp_path: Path, name: str, unit: str, wrong: str, told: str, doubts: int
) -> None:
    content = yaml.safe_load((CONFIG / "maps" / "fpga-v1.yaml").read_text())
    assert content["registers"][name]["unit"] == unit
    content["registers"][name]["unit"] = wrong
    (tmp_path / "wrong.yaml").write_text(yaml.safe_dump(content))
    strikes = {"period_s": 0.1, "cycles": 1, "velocities_mm_per_min": [4200.0]}
    async with simulator(tmp_path, strikes=strikes) as module:
        cell = write_cell(tmp_path, module["port"], module={"register_map": str(tmp_path / "wrong.yaml")})
        while "tap         cycle 1" not in (out := (await probed(cell))[1]):
            pass
    assert f"look at     {told}" in out
    assert f"see unit and scale of {name} in the map" in out
    assert out.count("look at") == doubts


async def test_a_scale_that_contradicts_the_motion_is_named(tmp_path: Path) -> None:
    text = (CONFIG / "maps" / "fpga-v1.yaml").read_text()
    (tmp_path / "wrong.yaml").write_text(text.replace("unit: N, scale: 0.025", "unit: N, scale: 0.1"))
    strikes = {"period_s": 0.1, "cycles": 1, "velocities_mm_per_min": [4200.0]}
    async with simulator(tmp_path, strikes=strikes) as module:
        cell = write_cell(tmp_path, module["port"], module={"register_map": str(tmp_path / "wrong.yaml")})
        while "tap         cycle 1" not in (out := (await probed(cell))[1]):
            pass
    (look,) = [line for line in out.splitlines() if line.startswith("look at")]
    assert "its motion shows " in look
    assert "see unit and scale of force, position and mass" in look


async def test_a_tap_beside_the_calibration_of_its_mass_is_blamed_on_no_unit(tmp_path: Path) -> None:
    strikes = {"period_s": 0.1, "cycles": 1, "velocities_mm_per_min": [1900.0]}
    async with simulator(tmp_path, strikes=strikes) as module:
        cell = write_cell(tmp_path, module["port"])
        while "tap         cycle 1" not in (out := (await probed(cell))[1]):
            pass
    assert "look at     velocity 1900 mm/min is not within the 2000 to 6000 mm/min" in out
    assert "calibrate for it" in out
    assert "see unit" not in out


async def test_a_wrong_scale_is_named_beside_the_tap(tmp_path: Path) -> None:
    text = (CONFIG / "maps" / "fpga-v1.yaml").read_text()
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text(text.replace("scale: 0.025, saturation: [-32767, 32767]", "scale: 25.0"))
    async with simulator(tmp_path, strikes={"period_s": 0.1, "cycles": 1}) as module:
        cell = write_cell(tmp_path, module["port"], module={"register_map": str(wrong)})
        for _ in range(100):
            code, out, err = await probed(cell)
            if "tap         cycle 1" in out:
                break
    assert code == 1
    assert "scale or unit of one of them is wrong in the map" in err


async def test_a_module_that_is_not_there_is_named(tmp_path: Path) -> None:
    async with simulator(tmp_path, strikes={"period_s": 0.1}) as module:
        cell = write_cell(tmp_path, module["port"])
    code, out, err = await probed(cell)
    assert (code, out) == (1, "")
    assert re.search(
        r"impactcell: press-1: \S+ device 1: .* nothing listens at this host and port; see \S+press-1",
        err,
    )


@pytest.mark.parametrize("transport", ["tcp", "tls"])
@pytest.mark.parametrize("wrong", ["server_name", "ca_certificate", "nonsense"])
async def test_a_certificate_that_the_link_fails_by_is_named(
    tmp_path: Path, transport: str, wrong: str
) -> None:
    authority, other = Authority(tmp_path, "plant"), Authority(tmp_path, "other")
    tls = {"ca_certificate": str(authority.file), "server_name": "module.test"}
    key = "ca_certificate" if wrong == "nonsense" else wrong
    tls[key] = "pump.test" if wrong == "server_name" else str(other.file)
    if wrong == "nonsense":
        await asyncio.to_thread(other.file.write_bytes, b"")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(*authority.issue("module"))
    server = await asyncio.start_server(_silent, "127.0.0.1", 0, ssl=context)
    port = server.sockets[0].getsockname()[1]
    module = {"transport": transport, "window": 1, "timeout_ms": 30_000, "tls": tls}
    code, out, err = await probed(write_cell(tmp_path, port, module=module))
    server.close()
    assert (code, out) == (1, "")
    place = re.search(r"; see (\S+):(\d+):\d+", err)
    assert place is not None, err
    lines = await asyncio.to_thread(Path(place[1]).read_text)
    assert lines.splitlines()[int(place[2]) - 1].strip() == f"{key}: {tls[key]}"


async def _silent(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    await reader.read(-1)
    writer.close()
