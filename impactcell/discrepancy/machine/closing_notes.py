"""What is said of a finding once it is done: by simulation, and where a number rests at its bound."""

import math
from dataclasses import replace

import numpy as np

from impactcell.campaign import COLUMNS
from impactcell.discrepancy.machine.better_simulated import best_simulated
from impactcell.discrepancy.machine.finding import MachineFinding
from impactcell.discrepancy.machine.fits.machine_fits import MachineFits
from impactcell.discrepancy.machine.regression.held_number import DELAY
from impactcell.discrepancy.machine.terms.base_model import Response
from impactcell.german.findings import enumerated
from impactcell.german.open_loop import POOR_FIT_PERCENT
from impactcell.physics.effect_names import in_words

REST_SHARE = 0.1
"""Share of a record's motion below which what is held out of it is called at rest. Our choice."""
FOLLOWS_PERCENT = 90.0
"""Fit of a simulation from which on it follows what was held out but for something small. Our choice."""
FEW_NOISES = 4.0
"""Error of a simulated position over the noise that neighbouring samples show, up to which it may be noise of
which neighbours share much: correlated by 0.7 it is 2.4 times what they show. Our choice."""


def with_closing_notes(fits: MachineFits, finding: MachineFinding) -> MachineFinding:
    """Say which term simulates far better where none is established, and what else goes by the outcome."""
    better = best_simulated(fits, finding)
    notes = [*finding.notes, *_note_of_delay(finding)]
    if better is None:
        notes += _note_of_wandering(finding)
    if fits.held is None:
        notes += _note_of_rest(finding)
    if better is not None and not finding.clear_strengths:  # where these say it
        sensor = COLUMNS[finding.base.coordinate]["position_noise"]
        notes.append(
            f"{enumerated([*map(in_words, better.names)], 'or')}: blocks do not show it, but simulated open "
            f"loop, held-out records are {better.rmse:.3g} {finding.base.unit} off with it, "
            f"{finding.simulated[-1].rmse:.3g} without: put {better.names[0]} in the base model and compare. "
            "Longer records, a finer or faster sensor, or its noise where that is stated "
            f"({sensor}), would show it in blocks."
        )
    return replace(finding, notes=tuple(notes), better_simulated=better)


def _note_of_rest(finding: MachineFinding) -> list[str]:
    """Say that the last thirds, which are held out, hardly move, where a simulation follows them poorly."""
    if not finding.errs_beyond_noise or finding.simulated[-1].fit_percent >= POOR_FIT_PERCENT:
        return []
    shares = []
    for place, begin_s, end_s in finding.held_spans:
        record = finding.records[place]
        inside = (record.time_s >= begin_s) & (record.time_s <= end_s)
        shares.append(float(np.ptp(record.position[inside]) / np.ptp(record.position)))
    if max(shares, default=math.inf) > REST_SHARE:
        return []
    note = (
        f"What is held out, the last third of each record, is nearly at rest: it moves {max(shares):.2g} "
        "times as far as the whole record. Hold whole records out (--test), or end the records earlier."
    )
    return [note]


def _note_of_delay(finding: MachineFinding) -> list[str]:
    """Say that the delay of the force would be another if it might."""
    fit = finding.final.fit
    if DELAY not in fit.columns or not fit.at_bound[fit.columns.index(DELAY)]:
        return []
    note = (
        f"delay_s comes to rest at {finding.final.delay_s:.3g} s, the end of what the base model allows: see "
        "whether force and position have one clock, or give delay_s a larger std."
    )
    return [note]


def _note_of_wandering(finding: MachineFinding) -> list[str]:
    """Say that noise which goes on from sample to sample leaves the same as what was found.

    A force that is missing adds up in a simulation; noise does not: it errs by no more noises there than the
    equation of motion does, or by few.
    """
    records = finding.records
    unnamed = finding.verdict == "unknown" and finding.law is None
    if not unnamed or finding.base.response is Response.FORCE or not finding.simulated:
        return []
    if any(record.noise_is_stated[0] or record.summed_up for record in records):
        return []
    simulated, noise = finding.simulated[-1], max(record.position_noise for record in records)
    is_small = simulated.rmse <= max(FEW_NOISES, finding.fall.after) * noise
    if not is_small or finding.is_told_of or simulated.fit_percent < FOLLOWS_PERCENT:
        return []
    key, unit = COLUMNS[finding.base.coordinate]["position_noise"], finding.base.unit
    note = (
        f"Simulated open loop, the model follows held-out records to {simulated.rmse:.3g} {unit}, and "
        f"neighbouring samples differ by a noise of {noise:.3g}: noise that goes on from sample to "
        "sample, or a camera or zero that drifts, leaves as much. Record the part at rest for a while. If it "
        f"seems to move there, too, state {key} in campaign.yaml: the standard deviation at rest times "
        "sqrt((1 + r) / (1 - r)), r the correlation of one sample with the next."
    )
    return [note]
