"""Investigations with a base model up to what is established, for tests that look at no more."""

import pytest

from impactcell.campaign import Campaign
from impactcell.discrepancy.machine import BaseModel, MachineFinding, investigate_machine, investigation


def establish_in(campaign: Campaign, base: BaseModel) -> MachineFinding:
    """Investigate without what comes once it is known what is established, which has tests of its own.

    Columns in another unit, laws, experiments, and terms that simulate better: where something remains each
    is looked for with fits and simulations of all records.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(investigation, "slip_in_columns", lambda *_: None)
        for later in ("with_law", "with_experiments", "with_closing_notes"):
            patch.setattr(investigation, later, lambda _, finding: finding)
        return investigate_machine(campaign, base)
