"""`impactcell export`: the captures of a journal as a campaign directory."""

import math
from pathlib import Path

from impactcell import campaign
from impactcell.cli.paths import note_damage, open_journal
from impactcell.cli.recorded_taps import campaign_of_taps
from impactcell.process.console import print_note, print_result
from impactcell.settings import read_cell


def export(
    journal: Path,
    output: Path,
    *,
    cell: Path | None = None,
    first_cycle: int | None = None,
    last_cycle: int | None = None,
) -> None:
    """Write the recorded captures between two cycles, both included, to a new campaign directory.

    Parameters
    ----------
    journal, output : Path
    cell : Path, optional
        Cell that recorded them: mass and stroke are as it states them where the module reported none.
    first_cycle, last_cycle : int, optional

    Raises
    ------
    JournalError, SettingsError
        The journal, or the cell, cannot be read.
    CampaignError
        It is not there, holds no captures in that range, or the directory exists already.
    """
    config = None if cell is None else read_cell(cell)
    gravity_m_s2 = 9.81 if config is None else config.model.plant.gravity_m_s2
    with open_journal(journal) as source:
        captures = source.captures(first_cycle, last_cycle, note_damage)
        recorded = campaign_of_taps(journal, captures, gravity_m_s2, config)
    campaign.write(recorded, output)
    if config is None and math.isinf(recorded.stroke_m):
        print_note(
            "the module did not report its stroke, and without one the actuator is taken to halt as it loses "
            "contact: name the cell that recorded these taps, --cell CELL.yaml, or state "
            f"`actuator: {{stroke_m: ...}}` in {output}/campaign.yaml"
        )
    print_result(f"{len(recorded.shots)} shots in {output}")
