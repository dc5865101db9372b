"""Reads a whole campaign directory, or says everything that is wrong with it at once."""

import re
from dataclasses import replace
from pathlib import Path

from impactcell.campaign.contents import Campaign, Coordinate, Excitation, Sensor
from impactcell.campaign.faults import Faults
from impactcell.campaign.header import Header, read_header
from impactcell.campaign.shots import ShotRow, read_shots
from impactcell.campaign.trace import read_trace
from impactcell.numerics.raster import raster_of
from impactcell.process.path_kind import Kind, kind_at
from impactcell.records import Capture, Channel

FINE_RASTER = 0.1
"""Step of a raster over the stated noise up to which rounding adds nothing to it: less than 0.05 %."""
REQUIRED_CHANNELS = {
    Excitation.TAP: ({"force", "position"}, "force_n or position_m"),
    Excitation.FREE_SLIDE: ({"position"}, "position_m"),
    Excitation.DRIVEN: ({"force", "position"}, "force_n and position_m"),
}


def read(directory: Path) -> Campaign:
    """Read a campaign directory.

    Parameters
    ----------
    directory : Path
        Holds `campaign.yaml`, `shots.csv` and `traces/N.csv`.

    Returns
    -------
    Campaign
        In SI units, shots in the order of `shots.csv`. Positions count from where the part lay before the
        shot, also where the traces have places on the table.

    Raises
    ------
    CampaignError
        Every fault of every file, as `file:line: what is wrong; the way out`.
    """
    faults = Faults(directory)
    if not _is_directory(
        directory, "is not a directory; name the directory that holds campaign.yaml", faults
    ):
        faults.raise_any()
    header = read_header(directory / "campaign.yaml", faults)
    table = read_shots(
        directory / "shots.csv",
        header.excitation if header else None,
        faults,
        header.coordinate if header else Coordinate.TRANSLATION,
    )
    traces = directory / "traces"
    has_traces = _is_directory(traces, "is missing; it holds N.csv for every shot N", faults)
    shots: list[Capture] = []
    if has_traces and table is not None:
        _check_orphans(traces, {shot.number for shot in table[1]}, faults)
        for shot in table[1]:
            capture = _capture(traces / f"{shot.number}.csv", shot, header, faults)
            if capture is not None:
                shots.append(capture)
    faults.raise_any()
    if header is None or table is None:
        message = f"{directory}: cannot be read"
        raise AssertionError(message)
    return Campaign(
        excitation=header.excitation,
        shots=_from_start(_from_start(tuple(shots), "position"), "actuator"),
        gravity_m_s2=header.gravity_m_s2,
        stroke_m=header.stroke_m,
        sensors=header.sensors,
        columns=table[0],
        coordinate=header.coordinate,
    )


def _is_directory(path: Path, otherwise: str, faults: Faults) -> bool:
    """Whether there is a directory; what is wrong where there is none is noted."""
    try:
        kind = kind_at(path)
    except OSError as error:
        faults.add(path, None, f"cannot be read: {error.strerror}")
        return False
    if kind is not Kind.DIRECTORY:
        faults.add(path, None, otherwise)
    return kind is Kind.DIRECTORY


def _from_start(shots: tuple[Capture, ...], name: str) -> tuple[Capture, ...]:
    """Count a channel from where the part lay, should the campaign have recorded places on the table.

    The format says that a shot starts at `start_m`, not whether `position_m` is counted from there; the first
    samples of all shots together tell.
    """
    from_start = from_table = 0.0
    for shot in shots:
        channel: Channel | None = getattr(shot, name)
        if channel is not None:
            from_start += abs(channel.values[0])
            from_table += abs(channel.values[0] - shot.start_m)
    if from_start <= from_table:
        return shots
    return tuple(_shifted(shot, name) for shot in shots)


def _shifted(shot: Capture, name: str) -> Capture:
    channel: Channel | None = getattr(shot, name)
    if channel is None:
        return shot
    moved = replace(channel, values=channel.values - shot.start_m)
    return replace(shot, position=moved) if name == "position" else replace(shot, actuator=moved)


def _check_orphans(traces: Path, numbers: set[int], faults: Faults) -> None:
    for file in sorted(traces.glob("*.csv")):
        if not re.fullmatch(r"[1-9][0-9]*", file.stem):
            faults.add(file, None, "is not named after a shot; traces are called 1.csv, 2.csv, ...")
        elif int(file.stem) not in numbers:
            faults.add(file, None, f"has no shot {file.stem} in shots.csv; add the row or remove the trace")


def _capture(file: Path, shot: ShotRow, header: Header | None, faults: Faults) -> Capture | None:
    channels = read_trace(file, faults, header.coordinate if header else Coordinate.TRANSLATION)
    if channels is None or header is None:
        return None
    required, named = REQUIRED_CHANNELS[header.excitation]
    enough = (
        required & channels.keys() if header.excitation is Excitation.TAP else required <= channels.keys()
    )
    if not enough:
        faults.add(file, 1, f"a campaign of excitation {header.excitation} needs {named}")
        return None

    def channel(sensor: str) -> Channel | None:
        if sensor not in channels:
            return None
        time, values = channels[sensor]
        said = header.sensors.get(sensor, Sensor())
        noise_std = said.noise_std
        raster = raster_of(values)
        is_coarse = raster is not None and raster > FINE_RASTER * (noise_std or 0.0)
        return Channel(
            time,
            values,
            noise_std,
            resolution=raster if is_coarse else None,
            summed_up=said.summed_up,
            speed_noise_std=said.speed_noise_std,
        )

    return Capture(
        cycle=shot.number,
        velocity_m_s=shot.velocity_m_s,
        mass_kg=shot.mass_kg,
        force=channel("force"),
        position=channel("position"),
        actuator=channel("actuator"),
        direction=shot.direction,
        stroke_m=header.stroke_m,
        batch_id=shot.batch_id,
        dwell_s=shot.dwell_s,
        start_m=shot.start_m,
        covariates=shot.covariates,
    )
