"""`impactcell model fit`: a cell's first model, from a campaign or the running cell's own first taps."""

import json
import sys
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Final

from impactcell.api.first_model import TAPS, FirstModel, fit_first_model
from impactcell.campaign import Campaign, read
from impactcell.cli.accept_model import put_into_service
from impactcell.cli.calibrate import calibrated_model
from impactcell.cli.paths import note_damage, open_journal
from impactcell.cli.recorded_taps import campaign_of_taps
from impactcell.errors import CampaignError, PredictionError, SettingsError
from impactcell.process.console import print_note, print_result
from impactcell.settings import CellConfig, read_cell
from impactcell.settings.judgement import judge_cell

MOST_TAPS: Final = 240
"""Taps that are taken at most where fewer are not good enough: more of the same would not be either."""


def fit_model(
    cell: Path, campaign: Path | None, taps: int | None, *, anyway: bool = False, as_json: bool = False
) -> None:
    """Fit a cell's model to a campaign, or to the first taps of its own journal, and put it into service.

    Where no number of taps is said, 30 are taken, and twice as many while more may help and there are more:
    whoever strikes further taps, as he is told, need say nothing else.

    The model that it replaces is kept beside it, as `model accept` does. One that is not good enough is put
    into service only where that is asked for with `anyway`.

    Raises
    ------
    SettingsError, CampaignError, JournalError
        A file cannot be read or written, or there are no taps.
    PredictionError
        No plant could be fitted, or it is not good enough.
    """
    config = read_cell(cell)
    first = _fit(config, campaign, taps)
    if first.shortcomings and not anyway:
        say_first_model(first, None, as_json=as_json)
        raise PredictionError("not put into service (--anyway would)")
    model = calibrated_model(replace(config, model=first.fit.model))
    put_into_service(config, model)
    say_first_model(first, config.settings.model, as_json=as_json)
    if config.model.is_provisional:
        print_note("wear and batches are learned anew: what was learned by the provisional model is not kept")
    for finding in judge_cell(read_cell(cell)):
        if finding.is_fault or finding.section == "sensors":  # taps show what noise there is
            print_note(str(finding))


def _fit(config: CellConfig, campaign: Path | None, taps: int | None) -> FirstModel:
    count = taps or TAPS
    while True:
        source, data = _taps(config, campaign, count)
        first = fit_first_model(data, config.name, source)
        has_more = campaign is None and taps is None and first.taps == count < MOST_TAPS
        if not (first.may_want_taps and has_more):
            return first
        print_note(f"{count} taps are not enough ({first.shortcomings[0]}); twice as many are fitted")
        count *= 2


def say_first_model(first: FirstModel, target: Path | None, *, as_json: bool = False) -> None:
    """Say what was fitted, where it was written (None: nowhere), and whether it is good enough."""
    plant, prior = first.fit.model.plant, first.fit.model.prior
    if as_json:
        content = {
            "model": None if target is None else str(target),
            "stiffness_n_per_m": {"value": plant.stiffness_n_per_m, "std": prior.stiffness_std_n_per_m},
            "damping_n_s_per_m": {"value": plant.damping_n_s_per_m, "std": prior.damping_std_n_s_per_m},
            "ratio": {"value": first.fit.model.ratio, "std": prior.ratio_std},
            "taps": first.taps,
            "used": len(first.fit.used),
            "gap": first.fit.gap,
            "good_enough": not first.shortcomings,
            "shortcomings": list(first.shortcomings),
        }
        sys.stdout.write(json.dumps(content) + "\n")
        return
    print_result(first.sentence if target is None else f"{target}: {first.sentence}")
    if first.shortcomings:
        print_result("not good enough yet: " + "; ".join(first.shortcomings))
    else:
        print_result("good enough to estimate friction with")


def _taps(config: CellConfig, recorded: Path | None, taps: int) -> tuple[str, Campaign]:
    if recorded is not None:
        return recorded.name, read(recorded)
    if config.settings.journal is None:
        raise SettingsError(f"{config.path}: the cell keeps no journal; name a campaign with --campaign")
    path = config.settings.journal.file
    with open_journal(path, config.name) as journal:
        captures = list(islice(journal.captures(damaged=note_damage), taps))
    if not captures:
        raise CampaignError(
            f"{path.name}: no taps are in it yet; run the cell, and come back after {TAPS} taps"
        )
    campaign = campaign_of_taps(path, captures, config.model.plant.gravity_m_s2, config)
    return f"journal {path.name}", campaign
