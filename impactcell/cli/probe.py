"""`impactcell probe`: one look at the live module of a cell."""

import asyncio
import math
import ssl
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from impactcell.cell.preprocessing import fill_defaults
from impactcell.errors import (
    ConnectionLostError,
    FieldbusError,
    LinkError,
    NoAnswerError,
    ProtocolError,
    WrongDeviceError,
)
from impactcell.features import extract, impulse_balance
from impactcell.fieldbus.acquisition import ModuleAcquisition
from impactcell.fieldbus.cycles.cycle_dates import clock_ahead, seconds_ahead
from impactcell.fieldbus.map_promises import not_promised
from impactcell.fieldbus.modbus_client import ModbusClient
from impactcell.fieldbus.probe import ProbeResult
from impactcell.fieldbus.probe import probe as probe_module
from impactcell.fieldbus.transports import transport_for
from impactcell.prediction.mass_interpolation import velocity_range_m_s
from impactcell.process import yaml_loader
from impactcell.process.console import print_result
from impactcell.records import MM_PER_MIN, Capture, Channel
from impactcell.service.factory import cell_design
from impactcell.settings import CellConfig, read_cell
from impactcell.settings.service_files import of_module_tls

ROUNDING: Final = 1e-3
"""Share by which the steps of a register may lead out of a range at whose edge the value is."""
UNIT_FACTOR: Final = 3.0
"""Factor beside a calibrated range from which on a wrong unit or scale is likelier than another tap: mm/min
and mm/s are 60 apart."""

OTHER_NAME: Final = (62, 64)
"""OpenSSL's codes of a certificate that is another host's (X509_V_ERR_HOSTNAME_MISMATCH) or address's."""


def probe(cell: Path) -> None:
    """Print identity, status and the newest tap of a cell's module, read as its map says.

    Only the slot that the module's window shows is changed. The service may run meanwhile.

    Raises
    ------
    SettingsError
        The cell cannot be read.
    FieldbusError
        The module does not answer, is another one, or shows what its map cannot mean.
    """
    config = read_cell(cell)
    link = config.settings.module.link
    module = ModuleAcquisition(config.name, ModbusClient(transport_for(link)), config.register_map)
    try:
        result = asyncio.run(probe_module(module))
    except FieldbusError as error:
        own = str(error).removeprefix(f"{config.name}: ")
        raise FieldbusError(f"{config.name}: {own}{_hint(config, error)}") from error
    rows = [("link", f"{link}, {1e3 * result.round_trip_s:.2f} ms a request"), *_rows(result)]
    rows.insert(1, ("in flight", result.window))
    if result.capture is not None:
        tap = extract(fill_defaults(cell_design(config).defaults, result.capture))
        rows += [
            ("look at", text) for text in (*impulse_balance.doubts(tap), *_unlike(config, result.capture))
        ]
        ahead = clock_ahead(config.register_map, seconds_ahead(result.capture.time_ns))
        rows += [("look at", ahead)] if ahead else []
    rows += [("no promise", text) for text in not_promised(config.register_map)]
    print_result("\n".join(f"{name:12}{text}" for name, text in rows))
    if result.faults:
        raise FieldbusError("\n".join(result.faults))


def _hint(config: CellConfig, error: FieldbusError) -> str:
    """Say what may be wrong where the message does not, and which line says it."""
    device_id, device = config.settings.module.device_id, config.place("module.device_id")
    if isinstance(error, NoAnswerError):
        return (
            f"; device_id {device_id} may be wrong, for a module may be silent to another's (see {device}); "
            "or another client, the service for one, holds a module that takes one: end that, then probe"
        )
    if isinstance(error, ConnectionLostError):
        return (
            "; a module that takes one client may have closed it for another, the service for one: end that, "
            "then probe"
        )
    if isinstance(error, LinkError) and (place := _tls_place(config, error.__cause__)):
        return f"; see {place}"
    if isinstance(error, LinkError):
        return f"; {_address_place(config)}"
    if isinstance(error, ProtocolError) and "Modbus TCP" in str(error):
        return f"; give the module's own host and port, and its transport: {_address_place(config)}"
    if isinstance(error, ProtocolError) and "of the status block" in str(error):
        register_map = config.settings.module.register_map
        _, positions = yaml_loader.load(register_map)
        return (
            f"; addresses of map {config.register_map.name} may be another module's, or off by one: compare "
            f"them with its manual; see {register_map}:{positions.key(('registers', 'status_crc32'))}"
        )
    return f"; see {_line_of(config, str(error))}" if isinstance(error, WrongDeviceError) else ""


def _address_place(config: CellConfig) -> str:
    """Refer to the line that says where the module is."""
    return f"see {config.place('module.host', 'module.port')}"


def _tls_place(config: CellConfig, cause: BaseException | None) -> str:
    """Say which of the link's certificates it fails by, and where that is named; empty where by none."""
    tls = config.settings.module.tls
    if tls is None:
        return ""
    fault = next((remark for remark in of_module_tls(tls) if remark.is_fault), None)
    if fault is not None:
        return f"{config.place('.'.join(fault.place))}: {fault.message}"
    while not isinstance(cause, ssl.SSLCertVerificationError):
        if cause is None:
            return ""
        cause = cause.__cause__
    is_name = cause.verify_code in OTHER_NAME
    return config.place("module.tls.server_name" if is_name else "module.tls.ca_certificate")


def _line_of(config: CellConfig, fault: str) -> str:
    """Say which line of cell file or map makes a module another than it should be."""
    module = config.settings.module
    if "word_order" not in fault:
        return config.place("module.device_id" if "device_id" in fault else "module.register_map")
    if module.word_order is not None:
        return config.place("module.word_order")
    _, positions = yaml_loader.load(module.register_map)
    return f"{module.register_map}:{positions.key(('word_order',))}"


def _rows(result: ProbeResult) -> Iterator[tuple[str, str]]:
    status = result.status
    identity = ", ".join(f"{name} {value}" for name, value in result.identity.items())
    yield "identity", identity or "the map has no register of it"
    if result.identification:
        yield "made by", ", ".join(f"{name} {text}" for name, text in result.identification.items())
    held = sum(1 for cycle in status.ring if cycle)
    ring = f"the ring holds {held} of {len(status.ring)}" if len(status.ring) > 1 else "one buffer"
    yield "status", f"{status.state}, session {status.session}, cycle {status.cycle_counter}, {ring}"
    if status.batch is not None and status.batch.sequence:
        yield "batch", f"{status.batch.batch_id} announced from cycle {status.batch.from_cycle} on"
    if status.positioning is not None:
        part_mm, target_mm = 1e3 * status.positioning.position_m, 1e3 * status.positioning.target_m
        yield (
            "positioning",
            f"{status.positioning.state}, part at {part_mm:.3f} mm, target {target_mm:.3f} mm",
        )
    if result.capture is None:
        yield "tap", "none yet" if not status.cycle_counter else "cannot be read"
        return
    yield from _tap_rows(result.capture)


def _tap_rows(capture: Capture) -> Iterator[tuple[str, str]]:
    made = "at no known time"
    if capture.time_ns:
        made = f"{datetime.fromtimestamp(1e-9 * capture.time_ns, UTC):%Y-%m-%d %H:%M:%S} UTC"
    mass, stroke = _or_unknown(capture.mass_kg, "kg"), _or_unknown(1e3 * capture.stroke_m, "mm")
    velocity = f"{capture.velocity_m_s / MM_PER_MIN:.5g} mm/min"
    how = f"{velocity}, {mass}, stroke {stroke}, direction {capture.direction:+d}"
    yield "tap", f"cycle {capture.cycle}, {made}, {how}"
    summary = capture.summary
    force, position = capture.force, capture.position
    if force is None:
        figure = "" if summary is None else f"; the module says {summary.peak_force_n:.4g} N"
        yield "force", f"no samples{figure}"
    else:
        figure = "" if summary is None else f" (the module says {summary.peak_force_n:.4g} N)"
        yield "force", f"{_samples(force)}, largest {force.values.max():.4g} N{figure}"
    if position is None:
        figure = "" if summary is None else f"; slid {1e3 * summary.sliding_distance_m:.4g} mm, it says"
        yield "position", f"no samples{figure}"
    else:
        figure = "" if summary is None else f" (slid {1e3 * summary.sliding_distance_m:.4g} mm, it says)"
        yield "position", f"{_samples(position)}, moved {1e3 * abs(position.values[-1]):.4g} mm{figure}"


def _unlike(cell: CellConfig, capture: Capture) -> Iterator[str]:
    """Say what of a tap the cell's model is not for: a unit or a scale is wrong, or the model is."""
    predictors = cell.model.predictors
    if not predictors:
        return
    mass_kg = capture.mass_kg if math.isfinite(capture.mass_kg) else predictors[0].mass_kg
    slowest, fastest = (velocity / MM_PER_MIN for velocity in velocity_range_m_s(cell.model, mass_kg))
    for name, value, low, high, unit in (
        ("velocity", abs(capture.velocity_m_s) / MM_PER_MIN, slowest, fastest, "mm/min"),
        ("mass", capture.mass_kg, predictors[0].mass_kg, predictors[-1].mass_kg, "kg"),
    ):
        if math.isfinite(value) and not low * (1.0 - ROUNDING) <= value <= high * (1.0 + ROUNDING):
            is_far = not low / UNIT_FACTOR <= value <= high * UNIT_FACTOR
            what = f"see unit and scale of {name} in the map, or calibrate" if is_far else "calibrate for it"
            yield (
                f"{name} {value:.6g} {unit} is not within the {low:.4g} to {high:.4g} {unit} that "
                f"model '{cell.model.name}' is calibrated for: {what}"
            )


def _samples(channel: Channel) -> str:
    count = len(channel.values)
    span_s = float(channel.time_s[-1] - channel.time_s[0])
    return f"{count} samples in {1e3 * span_s:.4g} ms"


def _or_unknown(value: float, unit: str) -> str:
    return f"{value:.5g} {unit}" if math.isfinite(value) else "unknown"
