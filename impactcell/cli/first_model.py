"""A cell's first model: fitted to a campaign or to the running cell's own first taps, and judged."""

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Final

import numpy as np

from impactcell.api.friction import with_masses
from impactcell.campaign import Campaign, Excitation, from_contact, read
from impactcell.campaign.recorded import from_captures
from impactcell.cli.accept_model import previous_model
from impactcell.cli.calibrate import calibrated_model
from impactcell.cli.paths import note_damage, open_journal
from impactcell.errors import CampaignError, PredictionError, SettingsError
from impactcell.features import Features, extract
from impactcell.prediction.joint_plant_fit import PlantFit, fit_plant
from impactcell.process.console import print_note, print_result
from impactcell.settings import CellConfig, read_cell
from impactcell.settings.model_file import write_model

TAPS: Final = 30
"""Taps that a running cell's first model is fitted to at first: k, b and mu_k/mu_s to a per cent or so."""
MOST_TAPS: Final = 240
"""Taps that are taken at most where fewer are not good enough: more of the same would not be either."""
FEWEST_TAPS: Final = 10
"""Below this the spread from tap to tap is hardly seen."""
LARGEST_STIFFNESS_ERROR: Final = 0.02
"""Relative standard deviation of k; mu_s from the peak force is off by about half of it."""
LARGEST_DAMPING_ERROR: Final = 0.2
"""Relative standard deviation of b, which matters less."""
LARGEST_RATIO_ERROR: Final = 0.05
"""Standard deviation of mu_k/mu_s."""
TOUCHING: Final = 0.1
"""Share of the peak force above which actuator and part touch."""
APART: Final = 0.1
"""Share of the time until the last separation; apart for longer, they have met again."""
LARGEST_GAP: Final = 1.5
"""Residuals in noise floors; above it something is missing in the model."""


@dataclass(frozen=True, slots=True)
class FirstModel:
    """A fitted plant with what is to be said of it.

    Attributes
    ----------
    shortcomings : tuple of str
        Why it is not good enough yet, each with the way out; empty where it is.
    """

    fit: PlantFit
    taps: int
    shortcomings: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """What was found, with one standard deviation."""
        plant, prior = self.fit.model.plant, self.fit.model.prior
        return (
            f"k {plant.stiffness_n_per_m:.6g} ± {prior.stiffness_std_n_per_m:.2g} N/m, "
            f"b {plant.damping_n_s_per_m:.5g} ± {prior.damping_std_n_s_per_m:.2g} N s/m, "
            f"mu_k/mu_s {self.fit.model.ratio:.4f} ± {prior.ratio_std:.2g}, "
            f"from {len(self.fit.used)} of {self.taps} taps; residuals {self.fit.gap:.3g} noise floors"
        )


def fit_first_model(campaign: Campaign, name: str, source: str) -> FirstModel:
    """Fit a plant to a campaign of taps and judge it.

    Raises
    ------
    CampaignError
        The campaign has no taps.
    PredictionError
        No plant could be fitted.
    """
    if campaign.excitation is not Excitation.TAP:
        raise CampaignError(f"{source}: a first model needs taps, this campaign is {campaign.excitation}")
    struck, notes = from_contact(campaign)
    for note in notes:
        print_note(note)
    taps = with_masses([extract(shot) for shot in struck.shots])
    fit = fit_plant(_with_one_contact(taps), struck.gravity_m_s2, name)
    provenance = {"made by": "impactcell", "fitted to": f"{len(fit.used)} taps of {source}"}
    fit = replace(fit, model=replace(fit.model, provenance=provenance))
    return FirstModel(
        fit, len(taps), tuple(_shortcomings(fit, float(np.median([t.capture.mass_kg for t in taps]))))
    )


def _with_one_contact(taps: Sequence[Features]) -> Sequence[Features]:
    """Leave out taps in which the actuator caught up with the part, if enough others are there."""
    simple = [tap for tap in taps if not _meets_again(tap)]
    if len(simple) == len(taps):
        return taps
    way_out = "shorten the stroke, or strike faster, for a single contact"
    if len(simple) < FEWEST_TAPS:
        print_note(
            f"in {len(taps) - len(simple)} of {len(taps)} taps the actuator meets the part again; {way_out}"
        )
        return taps
    print_note(
        f"{len(taps) - len(simple)} of {len(taps)} taps are not used, as the actuator meets the part again; "
        f"{way_out}"
    )
    return simple


def _meets_again(tap: Features) -> bool:
    if isinstance(tap.force, Exception) or isinstance(tap.slide, Exception):
        return False  # the fit says what is missing
    force = tap.force
    pushed = force.time_s[
        (force.values > TOUCHING * force.values.max()) & (force.time_s < tap.slide.separation_s)
    ]
    return bool(np.diff(pushed).max(initial=0.0) > APART * tap.slide.separation_s)


def _shortcomings(fit: PlantFit, mass_kg: float) -> list[str]:
    plant, prior = fit.model.plant, fit.model.prior
    found = []
    if len(fit.used) < FEWEST_TAPS:
        found.append(f"only {len(fit.used)} taps could be used; strike {TAPS}")
    if not prior.stiffness_std_n_per_m <= LARGEST_STIFFNESS_ERROR * plant.stiffness_n_per_m:
        found.append("k is not known well enough; strike more taps, and faster ones")
    if not prior.damping_std_n_s_per_m <= LARGEST_DAMPING_ERROR * max(plant.damping_n_s_per_m, 1.0):
        found.append("b is not known well enough; vary the velocity")
    if not prior.ratio_std <= LARGEST_RATIO_ERROR:
        weight_n = mass_kg * plant.gravity_m_s2
        slow = 6e4 * plant.mu_s * weight_n / max(plant.damping_n_s_per_m, 1.0)
        found.append(
            "mu_k/mu_s is not known well enough; strike more taps, slower ones too, which stick "
            f"first: with this part those well below {round(slow, -2):.0f} mm/min"
        )
    if not fit.gap <= LARGEST_GAP:
        found.append(
            f"the taps are {fit.gap:.2g} noise floors off the model: something is missing in it; "
            "`impactcell discrepancy` names it"
        )
    return found


def fit_model(
    cell: Path, campaign: Path | None, taps: int | None, *, anyway: bool = False, as_json: bool = False
) -> None:
    """Fit a cell's model to a campaign, or to the first taps of its own journal, and put it into service.

    Where no number of taps is said, 30 are taken, and twice as many while they are not good enough and there
    are more: whoever strikes further taps, as he is told, need say nothing else.

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
    target = config.settings.model
    previous_model(target).write_bytes(target.read_bytes())
    write_model(model, target)
    say_first_model(first, target, as_json=as_json)


def _fit(config: CellConfig, campaign: Path | None, taps: int | None) -> FirstModel:
    count = taps or TAPS
    while True:
        source, data = _taps(config, campaign, count)
        first = fit_first_model(data, config.name, source)
        has_more = campaign is None and taps is None and first.taps == count < MOST_TAPS
        if not first.shortcomings or not has_more:
            return first
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


def _taps(config: CellConfig, campaign: Path | None, taps: int) -> tuple[str, Campaign]:
    if campaign is not None:
        return campaign.name, read(campaign)
    if config.settings.journal is None:
        raise SettingsError(f"{config.path}: the cell keeps no journal; name a campaign with --campaign")
    path = config.settings.journal.file
    with open_journal(path) as journal:
        captures = list(islice(journal.captures(damaged=note_damage), taps))
    if not captures:
        raise CampaignError(
            f"{path.name}: no taps are in it yet; run the cell, and come back after {TAPS} taps"
        )
    mass_kg, stroke_mm = config.settings.part.mass_kg, config.settings.actuator.stroke_mm
    if mass_kg is not None:
        captures = [replace(c, mass_kg=mass_kg) if math.isnan(c.mass_kg) else c for c in captures]
    if stroke_mm is not None:
        stroke_m = 1e-3 * stroke_mm
        captures = [replace(c, stroke_m=stroke_m) if math.isinf(c.stroke_m) else c for c in captures]
    return f"journal {path.name}", from_captures(captures, config.model.plant.gravity_m_s2).campaign
