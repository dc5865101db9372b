"""`impactcell estimate`: friction of every shot of a campaign, by every predictor."""

import csv
import io
import json
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from impactcell.api.friction import calibrated_where_possible, with_masses
from impactcell.campaign import Campaign, Excitation, from_contact, naming, read
from impactcell.cli.direction_note import note_of_direction
from impactcell.cli.estimate_columns import COLUMNS
from impactcell.cli.free_slides import estimate_free_slides, no_estimate
from impactcell.cli.paths import check_output
from impactcell.discrepancy.data import (
    check_campaign_units,
    notes_of_unlike,
    refuse_rotation,
    without_unlike_shots,
)
from impactcell.errors import CampaignError, PredictionError
from impactcell.features import Features, extract, with_noise_at_rest
from impactcell.prediction import Model, estimate_from_features
from impactcell.prediction.contact_onset import fit_plant_and_onset, is_late, onset_sentence
from impactcell.prediction.slide_friction import friction_of_slide
from impactcell.process.console import print_note, print_result
from impactcell.process.progress import progress
from impactcell.process.whole_files import write_whole
from impactcell.quality import inspect_campaign, notes_of, refuse_unusable
from impactcell.records import FrictionEstimate, Quality, as_recorded

WORDS = ("estimator", "quality", "mu_k_quality", "reason")
"""Columns that are no numbers."""


def estimate(
    campaign: Path, cell: Path | None = None, output: Path | None = None, *, as_json: bool = False
) -> None:
    """Write a row a shot: mu_s by equations (4), (5), (6) and the waveform, and mu_k.

    `mu_s_common_std` is the part of `mu_s_std` that all taps share: their mean is no better than that.

    Parameters
    ----------
    campaign : Path
        A campaign directory of taps, or of free slides (then only mu_k).
    cell : Path, optional
        Cell whose model is used; without it the plant is fitted to the campaign, k_v = 0. Of free slides the
        effects that act on a free part, and the mass where none is stated.
    output : Path, optional
        CSV file; without it the rows go to standard output.
    as_json : bool
        Print the rows as one JSON list, numbers as numbers and null where there is none.

    Raises
    ------
    CampaignError, SettingsError
        What was given cannot be read, or the rows cannot be written.
    PredictionError
        No plant could be fitted.
    """
    if output is not None:
        check_output(output, CampaignError)
    recorded = read(campaign)
    campaign_data, notes = from_contact(recorded)
    with naming(campaign):
        refuse_rotation(campaign_data)
    for note in notes:
        print_note(note)
    if campaign_data.excitation is Excitation.DRIVEN:
        raise CampaignError(f"{campaign}: estimate needs taps or free slides, this campaign is driven")
    data_faults = inspect_campaign(campaign_data)
    for note in notes_of(data_faults):
        print_note(note)
    with naming(campaign):
        refuse_unusable(campaign_data, data_faults)
        check_campaign_units(campaign_data)
    order = [shot.cycle for shot in campaign_data.shots]
    campaign_data, unlike = without_unlike_shots(campaign_data, data_faults)
    for note in notes_of_unlike(unlike):
        print_note(note)
    if campaign_data.excitation is Excitation.FREE_SLIDE:
        rows = estimate_free_slides(campaign_data, cell)
    else:
        shots, told = with_noise_at_rest(recorded.shots, campaign_data.shots)
        for note in told:
            print_note(note)
        taps = with_masses([extract(shot) for shot in shots])
        rows = _of_taps(campaign_data, taps, cell)
    if note := note_of_direction(campaign_data, {number: row.mu_k.value for number, row in rows}):
        print_note(note)
    rows += [(number, no_estimate(told, told)) for number, told in unlike.items()]
    rows.sort(key=lambda row: order.index(row[0]))
    if as_json:
        sys.stdout.write(_as_json(rows))
    elif output is None:
        _write(rows, sys.stdout)
    if output is None:
        return
    text = io.StringIO()
    _write(rows, text)
    try:
        if output.exists() and not output.is_file():  # a pipe or a terminal has nothing to be replaced
            output.write_text(text.getvalue(), encoding="utf-8")
        else:
            write_whole(output.resolve(), text.getvalue())
    except OSError as fault:
        raise CampaignError(f"{output}: cannot be written: {fault.strerror}") from fault
    if not as_json:
        print_result(f"{len(rows)} shots in {output}")


def _of_taps(
    campaign: Campaign, taps: Sequence[Features], cell: Path | None
) -> list[tuple[int, FrictionEstimate]]:
    """Estimate every tap, by the cell's model or by one that is fitted to the campaign."""
    estimate_of: Callable[[Features, Model], FrictionEstimate] = estimate_from_features
    if cell is not None:
        from impactcell.settings import read_cell

        known = read_cell(cell)
        plant, errors = known.model, known.settings.recorder_std
        taps = [replace(tap, capture=as_recorded(tap.capture, *errors)) for tap in taps]
    else:
        try:
            with progress("fitting the plant", 1):
                fitted, taps = fit_plant_and_onset(taps, campaign.gravity_m_s2)
        except PredictionError as fault:
            return _by_slides(taps, campaign.gravity_m_s2, fault)
        plant, estimate_of = fitted.model, fitted.estimate
        if is_late(fitted, taps):
            print_note(f"{onset_sentence(fitted.onset_s)}; it is fitted with each shot")
        print_note(
            f"plant fitted to {len(fitted.used)} of {len(taps)} shots: {fitted.sentence}; "
            f"residuals {fitted.gap:.3g} times the noise"
        )
    model = calibrated_where_possible(plant, [tap.capture for tap in taps])
    rows = []
    with progress("estimating", len(taps)) as advance:
        for tap in taps:
            rows.append((tap.capture.cycle, estimate_of(tap, model)))
            advance()
    return rows


def _by_slides(
    taps: Sequence[Features], gravity_m_s2: float, fault: PredictionError
) -> list[tuple[int, FrictionEstimate]]:
    """Give mu_k of taps to which no plant could be fitted, by their slides.

    Raises
    ------
    PredictionError
        The fault of the fit: no slide shows friction either.
    """
    taps = [replace(tap, capture=as_recorded(tap.capture)) for tap in taps]
    rows = [(tap.capture.cycle, friction_of_slide(tap, gravity_m_s2)) for tap in taps]
    if all(row.mu_k.quality is Quality.BAD for _, row in rows):
        raise fault
    print_note(f"no plant could be fitted, mu_k alone is given, by the slides: {fault}")
    return rows


def _as_json(rows: Sequence[tuple[int, FrictionEstimate]]) -> str:
    """Write the rows as they are in CSV; what is empty there is null."""
    text = io.StringIO()
    _write(rows, text)
    shots = []
    for row in csv.DictReader(io.StringIO(text.getvalue())):
        numeric = {k: float(v) if v else None for k, v in row.items() if k not in WORDS}
        shots.append({**row, **numeric, "shot": int(row["shot"])})
    return json.dumps(shots) + "\n"


def _write(rows: Iterable[tuple[int, FrictionEstimate]], file: TextIO) -> None:
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(COLUMNS)
    for shot, friction in rows:
        by_equation = (friction.by_force, friction.by_distance, friction.combined)
        numbers = (
            *(coefficient.value for coefficient in by_equation),
            *(number for c in (friction.mu_s, friction.mu_k) for number in (c.value, c.std)),
            *(coefficient.std for coefficient in by_equation),
        )
        measured = (friction.peak_force_n, friction.sliding_distance_m, friction.gap)
        writer.writerow(
            [
                shot,
                *map(_number, numbers),
                friction.estimator.value,
                friction.mu_s.quality.name.lower(),
                friction.mu_k.quality.name.lower(),
                *map(_number, measured),
                friction.mu_s.reason,
                _number(friction.mu_s.common_std),
            ]
        )


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.7g}"
