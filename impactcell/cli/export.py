"""`impactcell export`: the captures of a journal as a campaign directory."""

from pathlib import Path

from impactcell import campaign
from impactcell.campaign.recorded_campaign import from_captures
from impactcell.cli.paths import note_damage, open_journal
from impactcell.errors import CampaignError
from impactcell.process.console import print_note, print_result


def export(
    journal: Path, output: Path, *, first_cycle: int | None = None, last_cycle: int | None = None
) -> None:
    """Write the recorded captures between two cycles, both included, to a new campaign directory.

    Raises
    ------
    JournalError
        The journal cannot be read.
    CampaignError
        It is not there, holds no captures in that range, or the directory exists already.
    """
    with open_journal(journal) as source:
        try:
            recorded = from_captures(source.captures(first_cycle, last_cycle, note_damage))
        except CampaignError as error:
            raise CampaignError(f"{journal}: {error}") from error
    campaign.write(recorded.campaign, output)
    if recorded.other_stroke:
        print_note(f"{recorded.other_stroke} cycles with another stroke were left out")
    if recorded.no_channels:
        print_note(f"{recorded.no_channels} cycles without samples were left out")
    if recorded.sessions > 1:
        print_note(
            f"the module restarted meanwhile: cycles of {recorded.sessions} sessions have these numbers"
        )
    print_result(f"{len(recorded.campaign.shots)} shots in {output}")
