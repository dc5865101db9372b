"""A cell's first model: a plant fitted to taps, and whether it is good enough."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from impactcell.api.friction import with_masses
from impactcell.campaign import Campaign, Excitation, from_contact
from impactcell.errors import CampaignError, PhysicsError, PredictionError
from impactcell.features import Features, extract, impulse_balance, with_noise_at_rest
from impactcell.prediction.contact_onset import fit_plant_and_onset, is_late, onset_sentence
from impactcell.prediction.plant_fit import PlantFit
from impactcell.process.console import print_note
from impactcell.records import MM_PER_MIN

TAPS: Final = 30
"""Taps that a running cell's first model is fitted to at first: k, b and mu_k/mu_s to a per cent or so."""
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
    def may_want_taps(self) -> bool:
        """Whether more taps may mend what it lacks: what is missing in the model they do not."""
        return bool(self.shortcomings) and self.fit.gap <= LARGEST_GAP

    @property
    def sentence(self) -> str:
        """What was found, and in how many taps."""
        return (
            f"{self.fit.sentence}, from {len(self.fit.used)} of {self.taps} taps; "
            f"residuals {self.fit.gap:.3g} noise floors"
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
    shots, told = with_noise_at_rest(campaign.shots, struck.shots)
    for note in told:
        print_note(note)
    taps = with_masses([extract(shot) for shot in shots])
    doubt = _common_doubt(taps)
    try:
        fit, used = fit_plant_and_onset(_with_one_contact(taps), struck.gravity_m_s2, name)
    except (PredictionError, PhysicsError) as fault:
        if not doubt:
            raise
        raise PredictionError(f"{source}: {doubt}; so no plant could be fitted: {fault}") from fault
    provenance = {"made by": "impactcell", "fitted to": f"{len(fit.used)} taps of {source}"}
    fit = replace(fit, model=replace(fit.model, provenance=provenance))
    shortcomings = _shortcomings(fit, float(np.median([t.capture.mass_kg for t in taps])))
    if is_late(fit, used):
        shortcomings.append(
            f"{onset_sentence(fit.onset_s)}: cells take it there, which bends mu_s; let the module count its "
            "times from first contact, as by a lower threshold of its trigger, and strike again"
        )
    return FirstModel(fit, len(taps), (*([doubt] if doubt else []), *shortcomings))


def _common_doubt(taps: Sequence[Features]) -> str:
    """Say what cannot be in most of the taps, as of a wrong unit or sign; empty where nothing is."""
    found = [(tap.capture.cycle, texts[0]) for tap in taps if (texts := impulse_balance.doubts(tap))]
    if 2 * len(found) <= len(taps):
        return ""
    cycle, text = found[0]
    return f"in {len(found)} of {len(taps)} taps, cycle {cycle} for one, {text}"


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
        slow = plant.mu_s * weight_n / max(plant.damping_n_s_per_m, 1.0) / MM_PER_MIN
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
