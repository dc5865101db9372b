"""Taps of a journal as a campaign: what their cell states is filled in, and what is left out is told."""

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from impactcell.campaign import Campaign
from impactcell.campaign.recorded_campaign import from_captures
from impactcell.cell.preprocessing import with_noise
from impactcell.errors import CampaignError
from impactcell.process.console import print_note
from impactcell.records import Capture
from impactcell.settings import CellConfig


def campaign_of_taps(
    journal: Path, captures: Iterable[Capture], gravity_m_s2: float = 9.81, cell: CellConfig | None = None
) -> Campaign:
    """Put recorded captures together as a campaign, and say which of them are left out.

    Parameters
    ----------
    journal : Path
        Where they were recorded.
    captures : iterable of Capture
    gravity_m_s2 : float
    cell : CellConfig, optional
        Cell that recorded them: mass, stroke and noise are as it states them where the module reported none.

    Raises
    ------
    CampaignError
        There is no capture with samples.
    """
    try:
        recorded = from_captures(
            captures if cell is None else [_as_stated(cell, one) for one in captures], gravity_m_s2
        )
    except CampaignError as error:
        raise CampaignError(f"{journal}: {error}") from error
    for note in recorded.notes:
        print_note(note)
    return recorded.campaign


def _as_stated(cell: CellConfig, capture: Capture) -> Capture:
    mass_kg, stroke_mm = cell.settings.part.mass_kg, cell.settings.actuator.stroke_mm
    if mass_kg is not None and math.isnan(capture.mass_kg):
        capture = replace(capture, mass_kg=mass_kg)
    if stroke_mm is not None and math.isinf(capture.stroke_m):
        capture = replace(capture, stroke_m=1e-3 * stroke_mm)
    sensors = cell.settings.sensors
    said = sensors.model_fields_set  # what is not said is a guess, worse than what the samples show
    if "force_noise_std_n" in said:
        capture = replace(capture, force=with_noise(capture.force, sensors.force_noise_std_n))
    if "position_noise_std_um" in said:
        noise_m = 1e-6 * sensors.position_noise_std_um
        capture = replace(capture, position=with_noise(capture.position, noise_m))
    return capture
