"""Free slides of a campaign: the mass that they do not show, and what each of them says of mu_k."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from impactcell.campaign import Campaign, Excitation
from impactcell.errors import PredictionError
from impactcell.features import noise_std, without_spikes
from impactcell.features.channels import MIN_SAMPLES
from impactcell.physics import Plant
from impactcell.physics.free_motion import acts_on_speed, depends_on_mass
from impactcell.prediction.free_slide_friction import (
    FreeSlideFit,
    fit_free_slide,
    free_slide_friction,
    is_missed,
    misfit,
)
from impactcell.process.console import print_note
from impactcell.records import Capture, Coefficient, Estimator, FrictionEstimate, as_recorded

if TYPE_CHECKING:
    from impactcell.settings import CellConfig

MU_K_ONLY = "a free slide shows mu_k only"


def with_cell_mass(data: Campaign, config: "CellConfig | None") -> Campaign:
    """Take the mass of free slides, which do not show it, from their cell where they state none."""
    mass_kg = None if config is None else config.settings.part.mass_kg
    unstated = sum(math.isnan(shot.mass_kg) for shot in data.shots)
    if mass_kg is None or not unstated or data.excitation is not Excitation.FREE_SLIDE:
        return data
    print_note(f"note: the mass of {unstated} slides is not stated: {mass_kg:g} kg, as the cell has it")
    shots = (replace(one, mass_kg=mass_kg) if math.isnan(one.mass_kg) else one for one in data.shots)
    return replace(data, shots=tuple(shots))


def estimate_free_slides(data: Campaign, cell: Path | None) -> list[tuple[int, FrictionEstimate]]:
    """Estimate mu_k of every slide; what the effects of a cell's model do to a free part is taken off.

    A law that the model lacks bends mu_k of all slides alike, and by more than one slide shows: those that
    are met one by one are looked at together.
    """
    plant: Plant | None = None
    errors: tuple[float, ...] = ()
    if cell is not None:
        from impactcell.settings import read_cell

        config = read_cell(cell)
        data = with_cell_mass(data, config)
        plant, errors = config.model.plant, config.settings.recorder_std
        _note_forces(plant, data.shots)
    fits: dict[int, FreeSlideFit] = {}
    reasons: dict[int, list[str]] = {}
    for shot, left_out in map(without_spikes, _with_noise_of_all(data.shots)):
        reasons[shot.cycle] = list(left_out)
        try:
            fits[shot.cycle] = fit_free_slide(as_recorded(shot, *errors), data.gravity_m_s2, plant)
        except PredictionError as fault:
            reasons[shot.cycle].append(str(fault))
    has_laws = plant is not None and any(map(acts_on_speed, plant.effects))
    misses = "the model misses" if has_laws else "constant friction misses"
    missed = {
        cycle: f"{misses} this slide: {_residuals([fit])}" for cycle, fit in fits.items() if is_missed([fit])
    }
    others = {cycle: fit for cycle, fit in fits.items() if cycle not in missed}
    if is_missed(list(others.values())):
        missed |= dict.fromkeys(others, f"{misses} these slides: {_residuals(list(others.values()))}")
    rows = []
    for cycle, notes in reasons.items():
        why = "; ".join([missed[cycle], *notes] if cycle in missed else notes)
        row = no_estimate("; ".join(filter(None, [MU_K_ONLY, why])), why)
        if (fit := fits.get(cycle)) is not None:
            row = replace(row, mu_k=free_slide_friction(fit, why, missed=cycle in missed), gap=fit.gap)
        rows.append((cycle, row))
    return rows


def no_estimate(why_no_mu_s: str, why_no_mu_k: str) -> FrictionEstimate:
    """Give a row without friction that says why."""
    nothing = Coefficient(reason=why_no_mu_s)
    return FrictionEstimate(
        mu_s=nothing, mu_k=Coefficient(reason=why_no_mu_k), by_force=nothing, by_distance=nothing,
        combined=nothing, estimator=Estimator.NONE, peak_force_n=math.nan, sliding_distance_m=math.nan,
    )  # fmt: skip


def _note_forces(plant: Plant, shots: Sequence[Capture]) -> None:
    """Tell which effects are left out for a mass that nobody says."""
    forces = [name for name in plant.effects if acts_on_speed(name) and depends_on_mass(name)]
    unstated = sum(math.isnan(shot.mass_kg) for shot in shots)
    if forces and unstated:
        print_note(
            f"note: {', '.join(forces)} of the cell's model is left out of {unstated} slides that state no "
            "mass: state mass_kg in shots.csv, or part.mass_kg in the cell file"
        )


def _with_noise_of_all(shots: Sequence[Capture]) -> list[Capture]:
    """Give slides that state no noise that of the median slide: one alone shows it to a quarter."""
    shown = [
        noise_std(shot.position)
        for shot in shots
        if shot.position is not None and len(shot.position.values) >= MIN_SAMPLES
    ]
    usual = float(np.median(shown)) if shown else None
    return [
        shot
        if shot.position is None or shot.position.noise_std is not None
        else replace(shot, position=replace(shot.position, noise_std=usual))
        for shot in shots
    ]


def _residuals(fits: Sequence[FreeSlideFit]) -> str:
    return f"residuals by eighths of a slide are {misfit(fits):.3g} times noise; run `impactcell discrepancy`"
