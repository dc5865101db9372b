"""Campaigns with hidden effects, made on the simulator's own plant without going through files.

Everything about a campaign follows from its `Job`: plant, scatter, noise, sensors and the shapes of what is
hidden are drawn from its seed; how strong it is, is given, or calibrated to a gap by the benchmark.
"""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from impactcell.campaign import Campaign, Excitation, Sensor
from impactcell.discrepancy.workflow import DiscrepancyResult, investigate
from impactcell.records import Capture, Channel
from simulator.campaign import MadeShot, make
from simulator.campaign_scenario import CampaignScenario
from simulator.effects import LIBRARY as LAWS
from simulator.effects import UNLISTED
from simulator.effects import Parameter as Value

MM_PER_MIN = 1e-3 / 60.0
RATE_HZ = 5000.0
NOISE = {"force": 0.4, "position": 1.5e-6, "actuator": 1.5e-6}
FINER = 8
"""How many times as often the plant is sampled as a logger samples it, which sees contact by its samples."""
LOGGED = "logged"
"""How kinds of jobs begin whose campaigns a logger has recorded."""
TOLD = "told"
"""How kinds of jobs begin whose velocities and masses are a little off what is told of them."""
SIGNED = frozenset(
    {
        "batch_shift", "direction_asymmetry", "force_sensor_gain", "force_sensor_offset", "friction_drift",
        "friction_patch", "mass_error", "position_dependent_friction", "surface_tilt",
    }
)  # fmt: skip
"""Effects whose strength may have either sign."""
JOINED = ("position_sensor_lag",)
"""Effects that joined when studies had been run: campaigns of the others stay what they were."""


@dataclass(frozen=True)
class Job:
    """One campaign: what is hidden, how strongly, and what the campaign is like.

    Attributes
    ----------
    strength : float
        Multiple of the effects' default strengths.
    target : float
        Gap of the nominal model that each effect alone is to make; 0 leaves it at `strength` and at the
        default shapes (periods, ranges, time constants), else these are drawn as well.
    removed : str
        Effect that the library lacks.
    """

    kind: str
    hidden: tuple[str, ...]
    seed: int
    strength: float = 1.0
    target: float = 0.0
    shots: int = 60
    coloured: bool = False
    replicates: bool = True
    actuator: bool = True
    removed: str = ""

    @property
    def key(self) -> str:
        """The same for the same campaign and library."""
        return json.dumps(asdict(self), sort_keys=True)


def numbered(effects: Iterable[str]) -> list[str]:
    """Effects as seeds count them: by name, and behind them those that joined later."""
    names = sorted(effects)
    return [*(one for one in names if one not in JOINED), *(one for one in JOINED if one in names)]


def strengths(effect: str, strength: float, seed: int | None = None) -> dict[str, float | list[float]]:
    """Parameters of an effect at a multiple of its default strength; with a seed its shapes are drawn."""
    defaults: dict[str, Value] = dict({**LAWS, **UNLISTED}[effect].defaults)
    if seed is not None:
        rng = np.random.default_rng([seed, 7, numbered({**LAWS, **UNLISTED}).index(effect)])
        defaults = _drawn(effect, defaults, rng)
    (name, value), *rest = defaults.items()
    if isinstance(value, Sequence):
        scaled: float | list[float] = [one * strength for one in value]
    elif effect == "hertz_contact":
        scaled = 1.0 + (value - 1.0) * strength
    elif effect in {"presliding_compliance", "force_saturation"}:
        scaled = value / strength
    else:
        scaled = value * strength
    return {name: scaled} | {key: one if isinstance(one, float) else list(one) for key, one in rest}


def _drawn(effect: str, defaults: dict[str, Value], rng: np.random.Generator) -> dict[str, Value]:
    """Draw the sign of the strength, and every shape within a factor of 1.4 of its default."""
    made: dict[str, Value] = {}
    for place, (name, value) in enumerate(defaults.items()):
        if isinstance(value, Sequence):
            made[name] = [float(one * rng.choice([-1.0, 1.0])) for one in value]
        elif place == 0:
            made[name] = float(value * rng.choice([-1.0, 1.0])) if effect in SIGNED else value
        elif name == "phase_rad":
            made[name] = float(rng.uniform(-np.pi, np.pi))
        else:
            made[name] = float(value * 1.4 ** rng.uniform(-1.0, 1.0))
    return made


def hidden(job: Job, multiples: Sequence[float] = ()) -> dict[str, dict[str, float | list[float]]]:
    """Parameters of everything hidden in a job's campaign."""
    seed = job.seed if job.target else None
    each = multiples or [job.strength] * len(job.hidden)
    return {effect: strengths(effect, one, seed) for effect, one in zip(job.hidden, each, strict=True)}


def scenario(job: Job, multiples: Sequence[float] = ()) -> CampaignScenario:
    """The simulator's scenario of a job; `multiples` are strengths, one an effect, instead of the job's."""
    rng = np.random.default_rng([job.seed, 5])
    plant = {
        "stiffness_n_per_m": float(rng.uniform(5e5, 9e5)),
        "damping_n_s_per_m": float(rng.uniform(300, 600)),
        "mu_s": float(rng.uniform(0.15, 0.25)),
        "ratio": float(rng.choice([0.7, 0.76, 0.82])),
    }
    scatter = float(rng.choice([0.008, 0.012, 0.016]))
    noisier = 1.6 ** rng.uniform(-1.0, 1.0, 3) if job.target or job.kind == "none" else np.ones(3)
    sensors = {
        name: {"rate_hz": RATE_HZ, "noise_std": std * float(factor)}
        for (name, std), factor in zip(NOISE.items(), noisier, strict=True)
        if name != "actuator" or job.actuator
    }
    return CampaignScenario.model_validate(
        {
            "format": 1,
            "told": off_told(job) if job.kind.startswith(TOLD) else {},
            "seed": job.seed,
            "plant": plant,
            "velocity_jitter": 0.0 if job.replicates else 0.1,
            "shots": job.shots,
            "batches": ["A", "B"],
            "dwell_s": [1.0, 1000.0],
            "friction_scatter": scatter,
            "sensors": sensors,
            "noise": {"colour": "coloured" if job.coloured else "white"},
            "hide": list(job.hidden),
            "strengths": hidden(job, multiples),
        }
    )


def off_told(job: Job) -> dict[str, float]:
    """How far the settings of a job's shots are from what is told: velocities in common, too, by 0.2 %.

    A mass that is off in common is an effect of the library.
    """
    rng = np.random.default_rng([job.seed, 78])
    return {
        "velocity_error": float(0.002 * rng.standard_normal()),
        "velocity_scatter": float(np.exp(rng.uniform(*np.log([3e-4, 3e-3])))),
        "mass_scatter": float(np.exp(rng.uniform(*np.log([3e-4, 5e-3])))),
    }


def campaign(job: Job, multiples: Sequence[float] = ()) -> Campaign:
    """Make the campaign of a job; of a kind that is `LOGGED` as a logger has it."""
    if job.kind.startswith(LOGGED):
        return logged(job, multiples)[0]
    plan = scenario(job, multiples)
    return recorded(plan, make(plan)[1])


def logged(
    job: Job, multiples: Sequence[float] = (), before: tuple[int, int] | None = None
) -> tuple[Campaign, list[float]]:
    """Make the campaign of a job as a logger has it: contact lies anywhere between two samples.

    Parameters
    ----------
    before : tuple of int, optional
        So many samples, at least and fewer than, that a record has before contact; without it a record begins
        with the first sample of contact.

    Returns
    -------
    campaign : Campaign
    onsets : list of float
        Time of contact of each shot [s].
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tests.discrepancy.study.RATE_HZ", FINER * RATE_HZ)
        plan = scenario(job, multiples)
        fine = recorded(plan, make(plan)[1])
    rng = np.random.default_rng([job.seed, 77])
    shots, onsets = [], []
    for shot in fine.shots:
        phase = int(rng.integers(FINER))
        samples = int(rng.integers(*before)) if before else 0
        shots.append(_logged_shot(shot, phase, samples, rng))
        assert shot.force is not None
        onsets.append(samples / RATE_HZ - float(shot.force.time_s[phase]))
    sensors = {name: replace(one, rate_hz=RATE_HZ) for name, one in fine.sensors.items()}
    return replace(fine, shots=tuple(shots), sensors=sensors), onsets


def _logged_shot(shot: Capture, phase: int, before: int, rng: np.random.Generator) -> Capture:
    def seen(channel: Channel | None, speed_m_s: float) -> Channel | None:
        if channel is None:
            return None
        time_s, values = channel.time_s[phase::FINER], channel.values[phase::FINER]
        earlier_s = time_s[0] - np.arange(before, 0, -1) / RATE_HZ
        noise = channel.noise_std * rng.standard_normal(before) if channel.noise_std else np.zeros(before)
        time_s, values = np.append(earlier_s, time_s), np.append(speed_m_s * earlier_s + noise, values)
        return replace(channel, time_s=time_s - time_s[0], values=values)

    return replace(
        shot,
        force=seen(shot.force, 0.0),
        position=seen(shot.position, 0.0),
        actuator=seen(shot.actuator, shot.velocity_m_s),
    )


@lru_cache(maxsize=64)
def quick_campaign(job: Job) -> Campaign:
    """Make the campaign of a job with samples at 2 kHz, which is enough to tell effects apart.

    Once in a process: tests put channels in place of others and write into none.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tests.discrepancy.study.RATE_HZ", 2000.0)
        return campaign(job)


def name_effects(campaign: Campaign, **options: Any) -> DiscrepancyResult:
    """Investigate without looking for laws that nobody has listed: they have tests of their own.

    What is named is concluded before; see `impactcell.discrepancy.workflow.investigate`.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("impactcell.discrepancy.workflow.find_law", lambda *_: None)
        return investigate(campaign, **options)


def write_blank_report(_result: DiscrepancyResult, _source: str, directory: Path) -> None:
    """Take the place of `write_reports`, which has tests of its own: two seconds of pictures."""
    (directory / "report.html").touch()


def with_column(job: Job, name: str, low: float, high: float, law: Callable[[float], float]) -> Campaign:
    """Make the campaign of a job with a further column, and a law of it that friction is multiplied with."""
    values = np.linspace(low, high, 400).tolist()
    column = {"low": low, "high": high, "friction": [[value, law(value)] for value in values]}
    plan = CampaignScenario.model_validate(scenario(job).model_dump() | {"columns": {name: column}})
    return recorded(plan, make(plan)[1])


def recorded(plan: CampaignScenario, made: Sequence[MadeShot]) -> Campaign:
    """The taps made of a scenario as a campaign, as reading their files would give it."""
    shots = []
    for shot in made:
        channels = {
            name: Channel(time, values, getattr(plan.sensors, name).noise_std)
            for name, (time, values) in shot.channels.items()
        }
        shots.append(
            Capture(
                cycle=shot.plan.number,
                velocity_m_s=shot.plan.velocity * MM_PER_MIN,
                mass_kg=shot.plan.mass_kg,
                force=channels.get("force"),
                position=channels.get("position"),
                actuator=channels.get("actuator"),
                direction=shot.plan.direction,
                stroke_m=plan.stroke_m,
                batch_id=plan.batches[shot.plan.batch],
                dwell_s=shot.plan.dwell_s,
                start_m=shot.plan.start_m,
                covariates=dict(shot.plan.columns),
            )
        )
    sensors = {name: getattr(plan.sensors, name) for name in NOISE}
    return Campaign(
        Excitation.TAP,
        tuple(shots),
        stroke_m=plan.stroke_m,
        sensors={name: Sensor(one.rate_hz, one.noise_std) for name, one in sensors.items() if one},
        columns=("shot", "velocity_mm_per_min", "mass_kg", "direction", "batch", "dwell_s"),
    )
