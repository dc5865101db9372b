"""Makes one shot, or one block of a driven record, ready: channels as arrays, covariates as numbers."""

import math

import numpy as np

from impactcell.campaign import Excitation
from impactcell.discrepancy.data.driven import Driven
from impactcell.discrepancy.data.excitation import ExcitationStrategy
from impactcell.discrepancy.data.free_slide import FreeSlide
from impactcell.discrepancy.data.prepared_shots import PreparedShot
from impactcell.discrepancy.data.tap import Tap
from impactcell.records import Capture, Channel, Samples, sampling_step_s

STRATEGIES: dict[Excitation, ExcitationStrategy] = {
    strategy.excitation: strategy for strategy in (Tap(), FreeSlide(), Driven())
}
"""Whom the workflow asks what an excitation is like, by its word in `campaign.yaml`."""
MIN_DWELL_S = 0.1
"""Dwell [s] from which on stiction ages, as the law of `stiction_ageing` has it."""
NO_SAMPLES = np.empty(0)
"""Samples of a channel that was not recorded."""


def prepared_shot(
    strategy: ExcitationStrategy, capture: Capture, record_of: tuple[int, int], batch: int, group: int
) -> PreparedShot:
    """Give a shot, or a block, with its covariates; `record_of` is its record and how many there are."""
    record, records = record_of
    dwell = math.log10(max(capture.dwell_s, MIN_DWELL_S)) if math.isfinite(capture.dwell_s) else math.nan
    covariates = {
        "shot": float(record),
        "velocity": capture.velocity_m_s,
        "mass": capture.mass_kg,
        "direction": float(capture.direction),
        "batch": float(batch),
        "dwell": dwell,
        "start": capture.start_m,
    }
    covariates |= {name: value for name, value in capture.covariates.items() if isinstance(value, float)}
    channels = strategy.predicted_channels(capture)
    return PreparedShot(
        number=capture.cycle,
        record=record,
        records=records,
        velocity_m_s=capture.velocity_m_s,
        mass_kg=capture.mass_kg,
        direction=capture.direction,
        batch=batch,
        dwell_s=capture.dwell_s,
        start_m=capture.start_m,
        group=group,
        times=_channel_arrays(channels, "time_s"),
        values=_channel_arrays(channels, "values"),
        drive=strategy.drive(capture),
        covariates=strategy.adjust_covariates(covariates),
        sampling_step_s=sampling_step_s(capture),
    )


def _channel_arrays(
    channels: tuple[Channel | None, Channel | None, Channel | None], attribute: str
) -> tuple[Samples, Samples, Samples]:
    force, position, actuator = (
        NO_SAMPLES if channel is None else getattr(channel, attribute) for channel in channels
    )
    return force, position, actuator
