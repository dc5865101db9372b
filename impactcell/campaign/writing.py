"""Writes a campaign directory; what is written reads back to the same values."""

import csv
import io
import math
from pathlib import Path

import numpy as np

from impactcell.campaign.contents import CHANNELS, COLUMNS, Campaign, Coordinate
from impactcell.campaign.header import FORMAT, SUMMED_UP
from impactcell.errors import CampaignError
from impactcell.process.path_kind import Kind, kind_at
from impactcell.process.whole_files import directory_beside
from impactcell.records import MM_PER_MIN, Capture, Channel


def write(campaign: Campaign, directory: Path) -> None:
    """Write `campaign` to a directory that does not exist yet, or is empty.

    The directory appears complete or not at all: it is written beside its place and renamed.

    Raises
    ------
    CampaignError
        The directory holds something already, is a link, cannot be written, or two shots share a number.
    """
    numbers = [shot.cycle for shot in campaign.shots]
    if len(set(numbers)) < len(numbers):
        message = f"{directory}: two shots have the same number; number them anew"
        raise CampaignError(message)
    try:
        _check_place(directory)
        with directory_beside(directory) as beside:
            (beside / "campaign.yaml").write_text(_header(campaign), encoding="utf-8")
            (beside / "shots.csv").write_text(_shots(campaign), encoding="utf-8")
            traces = beside / "traces"
            traces.mkdir()
            for shot in campaign.shots:
                (traces / f"{shot.cycle}.csv").write_text(_trace(shot, campaign.coordinate), encoding="utf-8")
            if directory.is_dir():
                directory.rmdir()
            beside.rename(directory)
    except OSError as error:
        message = f"{directory}: cannot be written: {error.strerror}"
        raise CampaignError(message) from error


def _check_place(directory: Path) -> None:
    kind = kind_at(directory)
    if directory.is_symlink():
        message = f"{directory}: is a symbolic link; name the directory itself"
        raise CampaignError(message)
    if kind is Kind.FILE or (kind is Kind.DIRECTORY and any(directory.iterdir())):
        message = f"{directory}: exists already; choose another name or remove it"
        raise CampaignError(message)


def _header(campaign: Campaign) -> str:
    lines = [
        f"format: {FORMAT}",
        f"excitation: {campaign.excitation}",
        f"gravity_m_s2: {_text(campaign.gravity_m_s2)}",
    ]
    if campaign.coordinate is not Coordinate.TRANSLATION:
        lines.append(f"coordinate: {campaign.coordinate}")
    if math.isfinite(campaign.stroke_m):
        lines += ["actuator:", f"  stroke_m: {_text(campaign.stroke_m)}"]
    if campaign.sensors:
        lines.append("sensors:")
    for name, sensor in campaign.sensors.items():
        rate = "" if sensor.rate_hz is None else f"rate_hz: {_text(sensor.rate_hz)}, "
        summed_up = f"{SUMMED_UP}: true, " if sensor.summed_up else ""
        std = sensor.speed_noise_std if sensor.summed_up else sensor.noise_std
        key = COLUMNS[campaign.coordinate][f"{'speed' if sensor.summed_up else name}_noise"]
        noise = "null" if std is None else _text(std)
        lines.append(f"  {name}: {{{rate}{summed_up}{key}: {noise}}}")
    return "\n".join(lines) + "\n"


def _shots(campaign: Campaign) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(campaign.columns)
    writer.writerows([_cell(shot, name) for name in campaign.columns] for shot in campaign.shots)
    return out.getvalue()


def _cell(shot: Capture, name: str) -> str:
    match name:
        case "shot":
            return str(shot.cycle)
        case "velocity_mm_per_min":
            return _velocity(shot.velocity_m_s)
        case "mass_kg" | "inertia_kg_m2":
            return _text(shot.mass_kg)
        case "direction":
            return str(shot.direction)
        case "batch":
            return shot.batch_id or ""
        case "dwell_s":
            return _text(shot.dwell_s)
        case "start_m" | "start_rad":
            return _text(shot.start_m)
        case _:
            value = shot.covariates.get(name, "")
            return value if isinstance(value, str) else _text(value)


def _trace(shot: Capture, coordinate: Coordinate) -> str:
    channels: dict[str, Channel] = {
        COLUMNS[coordinate][sensor]: channel
        for sensor, channel in zip(CHANNELS, (shot.force, shot.position, shot.actuator), strict=True)
        if channel is not None
    }
    out = [",".join(["time_s", *channels])]
    times = np.unique(np.concatenate([channel.time_s for channel in channels.values()] or [np.empty(0)]))
    columns = [[_text(time) for time in times.tolist()]]
    for channel in channels.values():
        cells = [""] * len(times)
        places = np.searchsorted(times, channel.time_s)
        for place, value in zip(places.tolist(), channel.values.tolist(), strict=True):
            cells[place] = _text(value)
        columns.append(cells)
    out += [",".join(row) for row in zip(*columns, strict=True)]
    return "\n".join(out) + "\n"


def _velocity(velocity_m_s: float) -> str:
    """Shortest number of millimetres per minute that reads back to the same velocity."""
    value = velocity_m_s / MM_PER_MIN
    for text in (f"{value:.12g}", f"{value:.15g}", f"{value:.16g}"):
        if float(text) * MM_PER_MIN == velocity_m_s:
            return text
    return _text(value)


def _text(value: float) -> str:
    """Shortest text that reads back to the same number; empty for nan."""
    return "" if math.isnan(value) else repr(float(value)).removesuffix(".0")
