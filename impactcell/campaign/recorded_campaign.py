"""Captures recorded by a running cell, put together as a campaign."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from impactcell.campaign.contents import CHANNELS, Campaign, Excitation, Sensor
from impactcell.errors import CampaignError
from impactcell.records import Capture

_COLUMNS = ("shot", "velocity_mm_per_min", "mass_kg", "direction", "batch", "dwell_s", "start_m")


@dataclass(frozen=True, slots=True, eq=False)
class RecordedCampaign:
    """A campaign of recorded cycles, and how many cycles it had to leave out.

    Attributes
    ----------
    campaign : Campaign
    other_stroke : int
        Cycles struck with another stroke than most; a campaign has one.
    no_channels : int
        Cycles without any samples.
    sessions : int
        From how many sessions of the module they are: with each it counts its cycles anew.
    """

    campaign: Campaign
    other_stroke: int
    no_channels: int
    sessions: int

    @property
    def notes(self) -> tuple[str, ...]:
        """Say what was left out, and where numbers repeat."""
        said = (
            (self.other_stroke > 0, f"{self.other_stroke} cycles with another stroke were left out"),
            (self.no_channels > 0, f"{self.no_channels} cycles without samples were left out"),
            (
                self.sessions > 1,
                f"the module restarted meanwhile: cycles of {self.sessions} sessions have these numbers",
            ),
        )
        return tuple(note for holds, note in said if holds)


def from_captures(captures: Iterable[Capture], gravity_m_s2: float = 9.81) -> RecordedCampaign:
    """Make a tap campaign of recorded captures, in their order.

    Shots keep their cycle numbers; where the module restarted and numbers repeat, they are counted
    anew from 1, and `session` and `cycle` are columns.

    Raises
    ------
    CampaignError
        There is no capture with samples.
    """
    every = tuple(captures)
    recorded = tuple(c for c in every if any(getattr(c, name) is not None for name in CHANNELS))
    if not recorded:
        raise CampaignError(
            "no capture with samples is among these cycles; keep captures longer, or choose others"
        )
    stroke_m, _ = Counter(c.stroke_m for c in recorded).most_common(1)[0]
    kept = [c for c in recorded if c.stroke_m == stroke_m]
    restarted = len({c.cycle for c in kept}) < len(kept)
    shots = tuple(
        replace(c, cycle=number, covariates={**c.covariates, "session": c.session, "cycle": c.cycle})
        if restarted
        else c
        for number, c in enumerate(kept, start=1)
    )
    covariates = tuple(dict.fromkeys(name for shot in shots for name in shot.covariates))
    campaign = Campaign(
        Excitation.TAP,
        shots,
        gravity_m_s2=gravity_m_s2,
        stroke_m=stroke_m,
        sensors=_sensors(shots),
        columns=(*_COLUMNS, *covariates),
    )
    sessions = len({capture.session for capture in kept})
    return RecordedCampaign(campaign, len(recorded) - len(kept), len(every) - len(recorded), sessions)


def _sensors(shots: Sequence[Capture]) -> dict[str, Sensor]:
    sensors = {}
    for name in CHANNELS:
        channels = [channel for shot in shots if (channel := getattr(shot, name)) is not None]
        if channels:
            first = channels[0]
            span_s = first.time_s[-1] - first.time_s[0] if len(first.time_s) > 1 else 0.0
            rate_hz = float((len(first.time_s) - 1) / span_s) if span_s > 0 else None
            sensors[name] = Sensor(rate_hz, first.noise_std)
    return sensors
