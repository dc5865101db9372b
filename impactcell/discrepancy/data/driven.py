"""Driven parts: a measured force moves the part to and fro, in long records that are cut into blocks."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from impactcell.campaign import Campaign, Excitation
from impactcell.discrepancy.data.driven_blocks import cut_blocks
from impactcell.discrepancy.data.excitation import ExcitationStrategy
from impactcell.discrepancy.data.measured_drive import friction_of_slip, mass_from_momentum, whiten_block
from impactcell.discrepancy.data.phases import DRIVEN, Trajectory
from impactcell.discrepancy.data.prepared_shots import IndexArray, PreparedShot, ShotSet
from impactcell.discrepancy.data.unit_checks import PlausibleRatio
from impactcell.errors import CampaignError
from impactcell.records import Capture, Channel, Samples

MASS_UNIT_FACTOR = 30.0
"""Ratio of stated mass and mass that the motion shows which only a wrong unit can explain."""
RATIOS = (1.05, 1.3)
"""mu_s / mu_k at which fits start beside the one that the breakaways show."""


class Driven(ExcitationStrategy):
    """The measured force is the input of the model, the position what it predicts."""

    excitation = Excitation.DRIVEN
    unit = "blocks"
    free_plant_parameters = ("mu_k", "ratio")
    # Blocks of one record share what acts between records; there are too few of those for any test.
    tests_between_shots = False
    selects_blocks = True
    guess_shares = (0.0, 0.05)
    state_comes_first = True

    def cut(self, campaign: Campaign, notes: list[str]) -> list[tuple[Capture, int]]:
        """Cut the records into blocks; a mass that is not stated is what the motion shows."""
        mass = [_record_mass(record, notes) for record in campaign.shots]
        return [
            (replace(block, covariates={**block.covariates, "mass": mass[number - 1]}), number)
            for block, number in cut_blocks(campaign.shots)
        ]

    def predicted_channels(self, capture: Capture) -> tuple[Channel | None, Channel | None, Channel | None]:
        """Return the position; the force is the input."""
        return None, capture.position, None

    def drive(self, capture: Capture) -> Samples:
        """Return the measured force."""
        if capture.force is None:
            return super().drive(capture)
        return np.vstack([capture.force.time_s, capture.force.values])

    def adjust_covariates(self, covariates: dict[str, float]) -> dict[str, float]:
        """Give a block the direction in which it begins."""
        return covariates | {"direction": math.copysign(1.0, covariates["initial_speed"])}

    def record_of(self, shot: PreparedShot) -> int:
        """Blocks of one record: its friction is one draw for all of them."""
        return shot.record

    def unit_ratios(self, shot: PreparedShot, gravity_m_s2: float) -> Mapping[PlausibleRatio, float]:
        """None: the mass of a record is checked where it is cut."""
        del shot, gravity_m_s2
        return {}

    def split(self, shots: Sequence[PreparedShot], seed: int) -> tuple[IndexArray, IndexArray]:
        """Hold out the last third of each record."""
        del seed
        n = len(shots)
        indices = np.arange(n)
        record = np.array([shot.record for shot in shots])
        last = [
            members[len(members) - len(members) // 3 :]
            for members in (indices[record == number] for number in np.unique(record))
        ]
        held_out = np.concatenate(last) if sum(map(len, last)) > n // 4 else indices[n - max(n // 3, 1) :]
        return np.setdiff1d(indices, held_out), held_out

    def reduce(
        self, items: tuple[PreparedShot, ...], every: tuple[PreparedShot, ...], gravity_m_s2: float,
        position_noise_m: float,
    ) -> tuple[PreparedShot, ...]:  # fmt: skip
        """Give each block a smooth drive, fewer samples and the whitener of its residuals."""
        mu_k, _ = friction_of_slip(every, gravity_m_s2)
        return tuple(whiten_block(shot, position_noise_m, gravity_m_s2, mu_k) for shot in items)

    def plant_guesses(self, shots: Sequence[PreparedShot], gravity_m_s2: float) -> list[dict[str, float]]:
        """Friction by momentum in slip, mu_s / mu_k by the drive at breakaway."""
        mu_k, ratio = friction_of_slip(tuple(shots), gravity_m_s2)
        return [{"mu_k": mu_k, "ratio": value} for value in (ratio, *RATIOS)]

    def initial_mass(self, shots: Sequence[PreparedShot]) -> Samples:
        """Mass as stated, else what the motion of the record shows."""
        return np.array([shot.covariates["mass"] for shot in shots])

    def initial_state(self, shot: PreparedShot, share: float) -> tuple[float, float]:
        """By a parabola, or with a share of 0 by the speed that was measured at the cut."""
        if share > 0.0:
            return super().initial_state(shot, share)
        return shot.covariates["initial_speed"] * shot.direction, float(shot.values[1][0])

    def sample_phases(self, shots: ShotSet, trajectory: Trajectory) -> IndexArray:
        """All driven."""
        del trajectory
        return np.full(shots.values.size, DRIVEN, dtype=np.int64)

    def misfit_level(self, misfit_per_sample: Samples, sizes: IndexArray) -> float:
        """Median: a block in which stick ends at the wrong moment is far off whatever the model."""
        del sizes
        return float(np.median(misfit_per_sample))


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
