"""What goes into the workflow: shots with covariates, replicate groups, checks of units, and the split.

A driven record is cut into blocks longer than its correlation time; a shot, or a block, is the unit of every
test that follows.
"""

import math
from dataclasses import dataclass

import numpy as np

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.data.driven_blocks import cut_blocks
from impactcell.discrepancy.data.measured_drive import friction_of_slip, mass_from_momentum, whiten_block
from impactcell.discrepancy.data.shots import POSITION, IndexArray, PreparedShot, ShotSet, concatenate_shots
from impactcell.discrepancy.data.unit_checks import check_units
from impactcell.errors import CampaignError
from impactcell.records import Capture, Channel, Samples

MIN_SHOTS = 6
HELD_OUT_SHARE = 0.25
TIME_GAP_FACTOR = 5.0
MASS_UNIT_FACTOR = 30.0
NO_SAMPLES = np.empty(0)


@dataclass(frozen=True, slots=True, eq=False)
class PreparedCampaign:
    """A campaign made ready.

    Attributes
    ----------
    shots : tuple of Shot
    batches : tuple of str
        In order of appearance.
    covariates : tuple of str
        Names of the covariates that vary, in the order of `shots.csv`.
    stated_noise : tuple of float
        Of force, position and actuator as stated; nan where nothing is.
    notes : tuple of str
        What the data lack and what that costs; part of the report.
    """

    excitation: Excitation
    gravity_m_s2: float
    stroke_m: float
    shots: tuple[PreparedShot, ...]
    batches: tuple[str, ...]
    covariates: tuple[str, ...]
    stated_noise: tuple[float, float, float]
    notes: tuple[str, ...]


def prepare(campaign: Campaign) -> PreparedCampaign:
    """Make a campaign ready for the workflow.

    Raises
    ------
    CampaignError
        Too few shots for any test, or a unit that is wrong by a large factor.
    """
    captures = campaign.shots
    notes: list[str] = []
    records = list(range(1, len(captures) + 1))
    weights: list[float] = []
    if campaign.excitation is Excitation.DRIVEN:
        weights = [_record_mass(capture, notes) for capture in captures]
        cut = cut_blocks(captures)
        captures, records = tuple(block for block, _ in cut), [record for _, record in cut]
    if len(captures) < MIN_SHOTS:
        unit = "blocks" if campaign.excitation is Excitation.DRIVEN else "shots"
        message = (
            f"{len(captures)} {unit} are too few: the shot is the unit of every test, and with fewer than "
            f"{MIN_SHOTS} none can be made. Record at least {MIN_SHOTS}, better 30"
        )
        raise CampaignError(message)
    batches: list[str] = []
    for capture in captures:
        name = capture.batch_id or ""
        if name not in batches:
            batches.append(name)
    groups: dict[tuple[float, ...], int] = {}
    shots = []
    for place, (capture, record) in enumerate(zip(captures, records, strict=True), 1):
        batch = batches.index(capture.batch_id or "")
        settings = (
            round(capture.velocity_m_s, 9) if math.isfinite(capture.velocity_m_s) else -1.0,
            round(capture.mass_kg, 9) if math.isfinite(capture.mass_kg) else -1.0,
            float(capture.direction),
            round(capture.start_m, 9),
        )
        key = settings if campaign.excitation is Excitation.TAP else (float(place),)
        group = groups.setdefault(key, len(groups))
        shots.append(_prepared_shot(capture, record, len(campaign.shots), batch, group, campaign.excitation))
    if weights:
        for shot in shots:
            shot.covariates["mass"] = weights[shot.place - 1]
    _note_missing_information(campaign, shots, notes)
    check_units(campaign.excitation, campaign.gravity_m_s2, shots)
    stated = (
        _stated_noise(captures, "force"),
        _stated_noise(captures, "position"),
        _stated_noise(captures, "actuator"),
    )
    if campaign.excitation is Excitation.DRIVEN:
        stated = (math.nan, stated[1], math.nan)
    return PreparedCampaign(
        campaign.excitation,
        campaign.gravity_m_s2,
        campaign.stroke_m,
        tuple(shots),
        tuple(batches),
        _varying_covariates(shots, campaign.excitation),
        stated,
        tuple(notes),
    )


def split_held_out(prepared: PreparedCampaign, seed: int) -> tuple[IndexArray, IndexArray]:
    """Places of the training and of the held-out shots, each in file order.

    A quarter is held out, spread over the settings; of a driven record it is the last third of each. Held-out
    shots come first from settings that have replicates, so that no setting is lost to training.
    """
    n = len(prepared.shots)
    indices = np.arange(n)
    if prepared.excitation is Excitation.DRIVEN:
        record = np.array([shot.place for shot in prepared.shots])
        last = [
            members[len(members) - len(members) // 3 :]
            for members in (indices[record == r] for r in np.unique(record))
        ]
        held = np.concatenate(last) if sum(map(len, last)) > n // 4 else indices[n - max(n // 3, 1) :]
        return np.setdiff1d(indices, held), held
    rng = np.random.default_rng([seed, 1])
    order = rng.permutation(n)
    keys = np.array([_stratum(shot) for shot in prepared.shots])
    # Round after round one shot of every stratum: the later rounds go to training last, so that
    # the held-out shots are those of the first rounds of the fullest strata.
    rank = np.empty(n, dtype=np.int64)
    count_of_stratum: dict[tuple[float, ...], int] = {}
    for index in order:
        key = tuple(keys[index])
        rank[index] = count_of_stratum.get(key, 0)
        count_of_stratum[key] = rank[index] + 1
    count = np.array([count_of_stratum[tuple(key)] for key in keys])
    share = (rank + rng.random(n)) / count
    held_out_count = max(round(HELD_OUT_SHARE * n), 1)
    held = np.sort(np.lexsort((order, share))[:held_out_count])
    return np.setdiff1d(indices, held), held


def _stratum(shot: PreparedShot) -> tuple[float, float]:
    velocity = shot.velocity_m_s if math.isfinite(shot.velocity_m_s) else 0.0
    return (velocity, float(shot.direction))


def _prepared_shot(
    capture: Capture, place: int, shots: int, batch: int, group: int, excitation: Excitation
) -> PreparedShot:
    channels = [capture.force, capture.position, capture.actuator]
    drive = np.empty((2, 0))
    if excitation is Excitation.DRIVEN and capture.force is not None:
        drive = np.vstack([capture.force.time_s, capture.force.values])
        channels[0] = None
    if excitation is not Excitation.TAP:
        channels[0] = channels[2] = None
    dwell = math.log10(max(capture.dwell_s, 0.1)) if math.isfinite(capture.dwell_s) else math.nan
    covariates = {
        "shot": float(place),
        "velocity": capture.velocity_m_s,
        "mass": capture.mass_kg,
        "direction": float(capture.direction),
        "batch": float(batch),
        "dwell": dwell,
        "start": capture.start_m,
    }
    covariates |= {name: value for name, value in capture.covariates.items() if isinstance(value, float)}
    if excitation is Excitation.DRIVEN:
        covariates["direction"] = math.copysign(1.0, covariates["initial_speed"])
    return PreparedShot(
        number=capture.cycle,
        place=place,
        shots=shots,
        velocity_m_s=capture.velocity_m_s,
        mass_kg=capture.mass_kg,
        direction=capture.direction,
        batch=batch,
        dwell_s=capture.dwell_s,
        start_m=capture.start_m,
        group=group,
        times=_channel_arrays(channels, "time_s"),
        values=_channel_arrays(channels, "values"),
        drive=drive,
        covariates=covariates,
    )


def _record_mass(record: Capture, notes: list[str]) -> float:
    """Mass of a driven record's part as stated; else about what the motion says, and it is fitted.

    Raises
    ------
    CampaignError
        It is neither, or one contradicts the other by what only a wrong unit can explain.
    """
    if record.position is None or record.force is None:
        return record.mass_kg
    estimated = mass_from_momentum(record.position, record.force)
    if math.isnan(record.mass_kg):
        if math.isnan(estimated):
            message = f"shot {record.cycle}: its mass_kg is not stated, and its motion does not tell it"
            raise CampaignError(message)
        notes.append(f"The mass of shot {record.cycle} is not stated and is fitted, block by block.")
        return estimated
    if estimated > MASS_UNIT_FACTOR * record.mass_kg or estimated < record.mass_kg / MASS_UNIT_FACTOR:
        message = (
            f"shot {record.cycle}: its part is stated as {record.mass_kg:.3g} kg, but moves as one of "
            f"{estimated:.3g} kg would; check the units of mass_kg, force_n, position_m and time_s"
        )
        raise CampaignError(message)
    return record.mass_kg


def _channel_arrays(channels: list[Channel | None], attribute: str) -> tuple[Samples, Samples, Samples]:
    force, position, actuator = (
        NO_SAMPLES if channel is None else getattr(channel, attribute) for channel in channels
    )
    return force, position, actuator


def _varying_covariates(shots: list[PreparedShot], excitation: Excitation) -> tuple[str, ...]:
    """Covariates that vary; from block to block of a driven record, as its friction is one draw for all."""
    record = np.array([shot.place if excitation is Excitation.DRIVEN else 0 for shot in shots])
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
            return channel.noise_std
    return math.nan


def _note_missing_information(campaign: Campaign, shots: list[PreparedShot], notes: list[str]) -> None:
    tap = campaign.excitation is Excitation.TAP
    if tap and not any(len(shot.times[0]) for shot in shots):
        notes.append("No force channel: effects of contact and force sensor are seen in the motion only.")
    if tap and not any(len(shot.times[1]) for shot in shots):
        notes.append("No position channel: effects on the slide are hardly seen.")
    if tap and not any(len(shot.times[2]) for shot in shots):
        notes.append("No actuator channel: droop and ramp of the actuator are hard to tell from damping.")
    if tap and len({shot.direction for shot in shots}) < 2:
        notes.append("One direction only: tilt and asymmetry of direction cannot be seen.")
    if tap and len({round(shot.velocity_m_s, 9) for shot in shots}) < 2:
        notes.append("One velocity only: terms that depend on speed are hard to tell apart.")
    if tap and len({round(shot.mass_kg, 9) for shot in shots if math.isfinite(shot.mass_kg)}) < 2:
        notes.append("One mass only: mass and stiffness, tilt and restoring force lose their contrast.")
    unknown = [shot.number for shot in shots if not math.isfinite(shot.mass_kg)]
    if tap and unknown:
        notes.append(f"The mass of {len(unknown)} shots is not stated and is fitted.")
    groups = {shot.group for shot in shots}
    if len(groups) == len(shots) and tap:
        notes.append(
            "No replicates: the sensors' noise is only a lower bound of the floor, and gap (b) is null."
        )
    for shot in shots:
        steps = [np.diff(times) for times in shot.times if len(times) > 1]
        if any(step.max() > TIME_GAP_FACTOR * np.median(step) for step in steps):
            notes.append(f"Shot {shot.number} has a gap in time; what happened in it is lost.")
            break


def shot_set(
    prepared: PreparedCampaign, places: IndexArray, noise_std: tuple[float, float, float]
) -> ShotSet:
    """Lay out some of the shots for fits; driven blocks with a smooth drive and their whiteners."""
    items = tuple(prepared.shots[int(place)] for place in places)
    if prepared.excitation is Excitation.DRIVEN:
        mu_k, _ = friction_of_slip(prepared.shots, prepared.gravity_m_s2)
        items = tuple(whiten_block(shot, noise_std[POSITION], prepared.gravity_m_s2, mu_k) for shot in items)
    return concatenate_shots(prepared.excitation, prepared.gravity_m_s2, prepared.stroke_m, items, noise_std)
