"""What goes into the workflow: shots with covariates, replicate groups, checks of units, and the split.

A driven record is cut into blocks longer than its correlation time; a shot, or a block, is the unit of every
test that follows.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactcell.campaign import Campaign, Excitation, from_contact
from impactcell.discrepancy.data.campaign_checks import (
    check_shot_units,
    refuse_rotation,
    without_outliers,
    without_unlike_shots,
)
from impactcell.discrepancy.data.clipped_samples import without_clipped_samples
from impactcell.discrepancy.data.excitation import ExcitationStrategy
from impactcell.discrepancy.data.prepared_shots import (
    MOTION_COVARIATES,
    OWN_COVARIATES,
    POSITION,
    IndexArray,
    PreparedShot,
    ShotSet,
    concatenate_shots,
)
from impactcell.discrepancy.data.replicate_groups import replicate_groups, start_places
from impactcell.discrepancy.data.shot_making import STRATEGIES, prepared_shot
from impactcell.discrepancy.data.shots_unlike import notes_of_unlike
from impactcell.errors import CampaignError
from impactcell.features import NoiseAtRest, noise_at_rest, noise_std
from impactcell.quality import inspect_campaign, notes_of, refuse_unusable
from impactcell.records import Capture, Channel

MIN_SHOTS = 4
"""Fewer cannot be divided into shots to fit and one to hold out."""
TIME_GAP_FACTOR = 5.0
"""A step of time this many times the median one is a gap in the record."""
ROUNDING = 1e-6
"""Of a sampling step: a sample that comes one after contact is of that step."""


@dataclass(frozen=True, slots=True, eq=False)
class PreparedCampaign:
    """A campaign made ready.

    Attributes
    ----------
    shots : tuple of PreparedShot
    batches : tuple of str
        In order of appearance.
    covariates : tuple of str
        Names of the covariates that vary: `OWN_COVARIATES` first, then further columns of `shots.csv`.
    stated_noise : tuple of float
        Of force, position and actuator as stated, with what a coarse raster adds; nan where nothing is.
    noise_at_rest : mapping
        Of channels whose noise is not stated and is more than neighbouring samples show.
    notes : tuple of str
        What the data lack and what that costs; part of the report.
    """

    excitation: ExcitationStrategy
    gravity_m_s2: float
    stroke_m: float
    shots: tuple[PreparedShot, ...]
    batches: tuple[str, ...]
    covariates: tuple[str, ...]
    stated_noise: tuple[float, float, float]
    noise_at_rest: Mapping[str, NoiseAtRest]
    notes: tuple[str, ...]

    @property
    def lacks_mass(self) -> bool:
        """Whether no shot states its mass, and none shows it."""
        stated = [shot.covariates["mass"] for shot in self.shots]
        return not self.excitation.mass_is_visible and bool(np.isnan(stated).all())


def prepare(campaign: Campaign) -> PreparedCampaign:
    """Make a campaign ready for the workflow.

    Raises
    ------
    CampaignError
        Too few shots for any test, a unit that is wrong by a large factor, or an angle for a coordinate.
    """
    refuse_rotation(campaign)
    strategy = STRATEGIES[campaign.excitation]
    whole, taken = _without_taken_names(campaign)
    campaign, pretrigger = from_contact(whole)
    data_faults = inspect_campaign(campaign)
    refuse_unusable(campaign, data_faults)
    campaign, unlike = without_unlike_shots(campaign, data_faults)
    whole = replace(whole, shots=tuple(shot for shot in whole.shots if shot.cycle not in unlike))
    notes = [*taken, *pretrigger, *notes_of(data_faults), *notes_of_unlike(unlike)]
    campaign = _without_outliers(campaign, notes)
    captures = strategy.cut(campaign, notes)
    if len(captures) < MIN_SHOTS:
        message = (
            f"{len(captures)} {strategy.unit} are too few: the shot is the unit of all fits and tests; with "
            f"fewer than {MIN_SHOTS} none can be made. Record at least 12, better 30"
        )
        raise CampaignError(message)
    batches = tuple(dict.fromkeys(capture.batch_id or "" for capture, _ in captures))
    recorded = [capture for capture, _ in captures]
    places = start_places(recorded)
    groups = replicate_groups(recorded, places) if strategy.has_replicates else [*range(len(recorded))]
    shots = []
    for (capture, record), group in zip(captures, groups, strict=True):
        batch = batches.index(capture.batch_id or "")
        shots.append(prepared_shot(strategy, capture, (record, len(campaign.shots)), batch, group))
    if any(capture.onset_std_s for capture, _ in captures):
        shots = list(map(_with_open_onset, shots))
    notes += strategy.missing_information(shots)
    notes += _time_gaps(shots)
    check_shot_units(campaign, shots)
    if campaign.excitation is not Excitation.DRIVEN:
        shots = without_clipped_samples(shots, data_faults, notes)
    shots = strategy.with_unstated_masses(shots)
    covariates = _varying_covariates(strategy, shots)
    if strategy.has_replicates and not any(places):
        covariates = tuple(name for name in covariates if name != "start")  # it was measured, and is one
    return PreparedCampaign(
        strategy,
        campaign.gravity_m_s2,
        campaign.stroke_m,
        tuple(shots),
        batches,
        covariates,
        (
            _stated_noise(campaign.shots, "force"),
            _stated_noise(campaign.shots, "position"),
            _stated_noise(campaign.shots, "actuator"),
        ),
        noise_at_rest(whole.shots, campaign.shots, rest_after=whole.excitation is Excitation.TAP),
        tuple(notes),
    )


def _without_taken_names(campaign: Campaign) -> tuple[Campaign, list[str]]:
    """Leave out further columns with a name that the workflow itself has for something else, and say so."""
    taken = {
        name: None
        for shot in campaign.shots
        for name, value in shot.covariates.items()
        if isinstance(value, float) and name in (*OWN_COVARIATES, *MOTION_COVARIATES)
    }
    if not taken:
        return campaign, []
    shots = tuple(
        replace(
            shot, covariates={name: value for name, value in shot.covariates.items() if name not in taken}
        )
        for shot in campaign.shots
    )
    notes = [
        f"Column {name} of shots.csv is not used: the workflow calls something else so; give the column "
        "another name."
        for name in taken
    ]
    return replace(campaign, shots=shots), notes


def _without_outliers(campaign: Campaign, notes: list[str]) -> Campaign:
    """Leave lone outliers out, and tell of how many shots."""
    cleaned = without_outliers(campaign)
    changed = sum(after is not before for before, after in zip(campaign.shots, cleaned.shots, strict=True))
    if changed:
        notes.append(f"Outliers of {changed} shots are left out of the fits.")
    return cleaned


def split_held_out(prepared: PreparedCampaign, seed: int) -> tuple[IndexArray, IndexArray]:
    """Divide the shots into training and held-out ones: their indices, each in file order."""
    return prepared.excitation.split(prepared.shots, seed)


def shot_set(
    prepared: PreparedCampaign, indices: IndexArray, noise_std: tuple[float, float, float]
) -> ShotSet:
    """Lay out some of the shots for fits."""
    items = tuple(prepared.shots[int(index)] for index in indices)
    items = prepared.excitation.reduce(items, prepared.shots, prepared.gravity_m_s2, noise_std[POSITION])
    return concatenate_shots(prepared.excitation, prepared.gravity_m_s2, prepared.stroke_m, items, noise_std)


def with_open_onset(prepared: PreparedCampaign) -> PreparedCampaign:
    """Let first contact of every shot lie within a sampling step of t = 0."""
    return replace(prepared, shots=tuple(map(_with_open_onset, prepared.shots)))


def _with_open_onset(shot: PreparedShot) -> PreparedShot:
    """Let first contact lie within a sampling step of t = 0; the samples of that step say nothing.

    A recorder shows contact by its samples only, and at 4000 mm/min the actuator goes 13 um in a step of
    0.2 ms. The step is that of the force, of the position where there is none.
    """
    kept = [times > (1.0 + ROUNDING) * shot.sampling_step_s for times in shot.times]
    force, position, actuator = (times[part] for times, part in zip(shot.times, kept, strict=True))
    values = [samples[part] for samples, part in zip(shot.values, kept, strict=True)]
    return replace(
        shot,
        times=(force, position, actuator),
        values=(values[0], values[1], values[2]),
        onset_is_open=True,
    )


def _varying_covariates(strategy: ExcitationStrategy, shots: Sequence[PreparedShot]) -> tuple[str, ...]:
    """Covariates that vary; from block to block of a record, where blocks of it share their friction."""
    record = np.array([strategy.record_of(shot) for shot in shots])
    names: list[str] = []
    for name in shots[0].covariates:
        values = np.array([shot.covariates.get(name, math.nan) for shot in shots])
        threshold = 1e-12 * np.abs(values).max()
        if np.isfinite(values).all() and any(
            np.ptp(values[record == number]) > threshold for number in set(record)
        ):
            names.append(name)
    return tuple(names)


def _stated_noise(captures: tuple[Capture, ...], name: str) -> float:
    for capture in captures:
        channel: Channel | None = getattr(capture, name)
        if channel is not None and channel.noise_std is not None:
            return noise_std(channel)
    return math.nan


def _time_gaps(shots: Sequence[PreparedShot]) -> list[str]:
    """Name the first shot of which samples are missing."""
    for shot in shots:
        steps = [np.diff(times) for times in shot.times if len(times) > 1]
        if any(step.max() > TIME_GAP_FACTOR * np.median(step) for step in steps):
            return [f"Shot {shot.number} has a gap in time; what happened in it is lost."]
    return []
