"""`impactcell export`: the captures of a journal as a campaign directory."""

import math
from pathlib import Path

from impactcell import campaign
from impactcell.cli.paths import note_damage, open_journal
from impactcell.cli.recorded_taps import campaign_of_taps
from impactcell.errors import CampaignError
from impactcell.journal.store import Journal
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
        Cell that recorded them: mass, stroke and noise are as it states them where the module reported none.
    first_cycle, last_cycle : int, optional

    Raises
    ------
    JournalError, SettingsError
        The journal, or the cell, cannot be read; the journal is another cell's.
    CampaignError
        It is not there, holds no captures in that range, or the directory exists already.
    """
    config = None if cell is None else read_cell(cell)
    gravity_m_s2 = 9.81 if config is None else config.model.plant.gravity_m_s2
    if first_cycle is not None and last_cycle is not None and first_cycle > last_cycle:
        raise CampaignError(
            f"--first-cycle {first_cycle} is above --last-cycle {last_cycle}: put them the other way round"
        )
    with open_journal(journal, None if config is None else config.name) as source:
        captures = list(source.captures(first_cycle, last_cycle, note_damage))
        if not captures and (first_cycle, last_cycle) != (None, None):
            raise _nothing_between(source, first_cycle, last_cycle)
        recorded = campaign_of_taps(journal, captures, gravity_m_s2, config)
    campaign.write(recorded, output)
    if config is None and math.isinf(recorded.stroke_m):
        print_note(
            "the module did not report its stroke, and without one the actuator is taken to halt as it loses "
            "contact: name the cell that recorded these taps, --cell CELL.yaml, or state "
            f"`actuator: {{stroke_m: ...}}` in {output}/campaign.yaml"
        )
    print_result(f"{len(recorded.shots)} shots in {output}")


def _nothing_between(source: Journal, first_cycle: int | None, last_cycle: int | None) -> CampaignError:
    """Say which cycles the journal has samples of, where none lie between the two that were named."""
    stored = [one.cycle for one in source.captures(damaged=lambda _: None)]
    has = f"samples of cycles {min(stored)} to {max(stored)}" if stored else "no samples at all"
    asked = " ".join(
        f"{word} {cycle}" for word, cycle in (("from", first_cycle), ("to", last_cycle)) if cycle is not None
    )
    return CampaignError(f"{source.path}: of cycles {asked} there are no samples: the journal has {has}")
