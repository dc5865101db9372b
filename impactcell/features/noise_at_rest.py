"""What samples at rest say of the noise: all of it, where neighbouring ones show a part."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactcell.features.noise import white_noise_std
from impactcell.features.noise_kernel import correlated_noise
from impactcell.records import Capture, Channel, CorrelatedNoise, Samples
from impactcell.records.correlated_noise import variance_of_mean

CHANNELS = ("force", "position", "actuator")
"""Channels that are looked at."""
ESTIMATED_FROM = ("force", "position")
"""Channels that friction is estimated from."""
TOLD_IN = {
    "force": (1.0, "N", "noise_std_n"),
    "position": (1e6, "µm", "noise_std_m"),
    "actuator": (1e6, "µm", "noise_std_m"),
}
"""What the noise of each channel is told in: how many of a unit are one of SI, the unit, its key in YAML."""
MOVES_BEFORE_CONTACT = "actuator"
"""Channel that has no one value then; after its stroke it has."""
FREE_AFTER_CONTACT = "force"
"""Channel that shows nothing but noise after a tap, whatever the part does."""
LAST_SAMPLES = 3
"""Samples before contact that are left out: contact lies within a sampling step."""
TAIL_SAMPLES = 40
"""Last samples of a shot in which the part has to lie still for any of them to be used."""
BLOCK_SAMPLES, NEAR, DOUBTED_BLOCKS = 20, 3.0, 2
"""Earlier ones are taken in blocks, as long as their mean is that of the tail to so many of its standard
deviations; in the earliest two of them the part may still have moved, and they are left out."""
STILL_RATIO = 1.5
"""Scatter of the tail over that of its last half, up to which it lies still: 2 or more where it moves on."""
USUAL_RATIO = 4.0
"""Scatter of a shot over the median from which on it counts no more: a spike, or a part that moved; what has
heavy tails comes to 3."""
MIN_SHARE = 0.5
"""Of the shots, which must show rest."""
MIN_EXCESS, CERTAIN_EXCESS = 0.05, 4.0
"""Excess of the scatter at rest over that of neighbouring samples from which on it counts: at least, and by
the root of the samples. White noise exceeded it in 1 to 2 % of 300 draws (4 to 60 shots of 40 samples, 24 of
300), and then it is as good an estimate."""
MAX_BEYOND_STATED = 0.1
"""Excess of the scatter at rest over a noise that is stated up to which this is that of all of it. Our
choice: a sensor's noise is known to some per cent."""
BISECTIONS = 50
"""Halvings of the interval in which the correlation of neighbouring samples lies."""


@dataclass(frozen=True, slots=True)
class NoiseAtRest:
    """Noise of a channel as it shows at rest.

    Attributes
    ----------
    std : float
        Of one sample, in the unit of the channel.
    ratio : float
        Of it to what neighbouring samples show.
    where : str
        `before contact` or `after the tap`.
    """

    std: float
    ratio: float
    where: str

    def told(self, name: str) -> str:
        """Say where the noise of a channel comes from that is not stated."""
        scale, unit, key = TOLD_IN[name]
        return (
            f"The noise of {name} is not stated; {scale * self.std:.3g} {unit} was estimated from samples at "
            f"rest {self.where}, {self.ratio:.3g} times what neighbouring samples show: it is correlated or "
            f"has outliers. What moves at rest counts as noise: state {key} of sensors: {name} in "
            "campaign.yaml if it is known."
        )


def noise_at_rest(
    recorded: Sequence[Capture], counted: Sequence[Capture], *, rest_after: bool = True
) -> Mapping[str, NoiseAtRest]:
    """Find channels whose noise is not stated, and correlated or with outliers: more than neighbours show.

    Taps rest before contact, and where they were not recorded there after they have slid. The force is none
    after a tap as before it, and some ms before contact show little of hum: it may show its noise in either.

    Parameters
    ----------
    recorded, counted : sequence of Capture
        Of taps with the samples before contact, and what `from_contact` makes of them.
    rest_after : bool
        Whether the part lies still at the end of a record, as after a tap.
    """
    found = {}
    for channel in CHANNELS:
        before = list(_before_contact(recorded, counted, channel))
        rests = {"before contact": before} if before else {}
        if rest_after and (not before or channel == FREE_AFTER_CONTACT):
            rests["after the tap"] = list(_after_the_tap(counted, channel))
        shown = (_shown(where, pieces, len(counted)) for where, pieces in rests.items())
        if noise := next(filter(None, shown), None):
            found[channel] = noise
    return found


def _shown(where: str, resting: list[Samples], shots: int) -> NoiseAtRest | None:
    """Give the noise that pieces at rest show, if it is more than neighbouring samples of them do."""
    if len(resting) < MIN_SHARE * shots:
        return None
    if not np.median([np.ptp(values) for values in resting]) > 0.0:
        return None  # an encoder that stands still shows no noise
    std = std_of_pieces(resting)
    white = float(np.median([white_noise_std(values) for values in resting]))
    excess = max(CERTAIN_EXCESS / math.sqrt(sum(map(len, resting))), MIN_EXCESS)
    return NoiseAtRest(std, std / white, where) if std > (1.0 + excess) * white > 0.0 else None


def with_noise_at_rest(
    recorded: Sequence[Capture], counted: Sequence[Capture]
) -> tuple[tuple[Capture, ...], tuple[str, ...]]:
    """Give taps the noise that they show at rest, where it is more than neighbouring samples show.

    What neighbours share of it is looked for in all rest, before contact and after the slide. A standard
    deviation that is stated holds; what neighbours share is no matter of it, unless rest shows more than it.

    Parameters
    ----------
    recorded, counted : sequence of Capture
        As for `noise_at_rest`; of `recorded` those that are counted.

    Returns
    -------
    taps : tuple of Capture
    notes : tuple of str
    """
    numbers = {tap.cycle for tap in counted}
    recorded = [_unstated(tap) for tap in recorded if tap.cycle in numbers]
    unstated = [_unstated(tap) for tap in counted]
    shown, taps, notes = noise_at_rest(recorded, unstated), tuple(counted), []
    for name in ESTIMATED_FROM:
        if name not in shown:
            continue
        stated = next((one.noise_std for tap in counted if (one := getattr(tap, name)) is not None), None)
        if stated is None:
            notes.append(shown[name].told(name))
        elif shown[name].std > (1.0 + MAX_BEYOND_STATED) * stated:
            continue
        shared = _shared(recorded, unstated, name)
        taps = tuple(
            _told(tap, before, name, shown[name].std, shared)
            for tap, before in zip(taps, recorded, strict=True)
        )
    return taps, tuple(notes)


def _unstated(tap: Capture) -> Capture:
    """Take no noise of a tap as stated."""
    force, position = (
        channel if channel is None or channel.noise_std is None else replace(channel, noise_std=None)
        for channel in (tap.force, tap.position)
    )
    return replace(tap, force=force, position=position)


def _shared(recorded: Sequence[Capture], counted: Sequence[Capture], name: str) -> CorrelatedNoise | None:
    """Find what neighbouring samples share of a channel's noise; None where that is nothing."""
    pieces = [*_before_contact(recorded, counted, name), *_after_the_tap(counted, name)]
    channels: list[Channel | None] = [getattr(tap, name) for tap in counted]
    step_s = float(np.median([np.median(np.diff(one.time_s)) for one in channels if one is not None]))
    noise = correlated_noise(pieces, step_s)
    return noise if noise.parts else None


def _told(tap: Capture, recorded: Capture, name: str, std: float, shared: CorrelatedNoise | None) -> Capture:
    """Tell a tap the noise of a channel: its raster is beside it, and its zero no better known than its mean.

    Before contact a channel stood at what it is counted from, and noise that neighbours share moves that.
    """
    channel, whole = getattr(tap, name), getattr(recorded, name)
    if channel is None:
        return tap
    noise_std, zero_std = channel.noise_std, channel.zero_std
    if noise_std is None:
        noise_std = math.sqrt(max(std**2 - (channel.resolution or 0.0) ** 2 / 12.0, 0.0))
    before = len(whole.values) - len(channel.values)
    if shared is not None and before > 0:
        zero_std = max(zero_std, shared.mean_std(before))
    told = replace(channel, noise_std=noise_std, shared_noise=shared, zero_std=zero_std)
    return replace(tap, force=told) if name == "force" else replace(tap, position=told)


def std_of_pieces(pieces: list[Samples]) -> float:
    """Give the standard deviation of noise that is seen in short pieces, each about a level of its own.

    The mean of n correlated samples follows them, and what is left about it is too small. For noise of first
    order, of which neighbours correlate by rho, the mean square about the mean is sigma^2 (1 - v), and the
    mean product of neighbours sigma^2 (rho - v) but for terms of order 1/n, with v n^2 = sum_ij rho^|i-j|,
    the variance of the mean over sigma^2 (Bartlett 1946). Their ratio gives rho, and rho gives sigma.
    """
    stds = np.array([values.std() for values in pieces])
    usual = [piece for piece, std in zip(pieces, stds, strict=True) if std <= USUAL_RATIO * np.median(stds)]
    centred = [values - values.mean() for values in usual]
    square = sum(float(values @ values) for values in centred) / sum(map(len, centred))
    product = sum(float(values[1:] @ values[:-1]) for values in centred)
    ratio = product / sum(len(values) - 1 for values in centred) / square
    size = int(np.median([len(values) for values in centred]))
    lags = np.arange(1.0, size)
    low, high = 0.0, 1.0 - 1.0 / size
    for _ in range(BISECTIONS):
        rho = 0.5 * (low + high)
        v = variance_of_mean(rho**lags)
        low, high = (rho, high) if (rho - v) / (1.0 - v) < ratio else (low, rho)
    return math.sqrt(square / (1.0 - variance_of_mean(low**lags)))


def _before_contact(recorded: Sequence[Capture], counted: Sequence[Capture], name: str) -> Iterator[Samples]:
    if name == MOVES_BEFORE_CONTACT:
        return
    for before, after in zip(recorded, counted, strict=True):
        whole, kept = getattr(before, name), getattr(after, name)
        if whole is None or kept is None or whole.noise_std is not None:
            continue
        values = whole.values[: max(len(whole.values) - len(kept.values) - LAST_SAMPLES, 0)]
        values = values[np.isfinite(values)]
        if len(values) >= TAIL_SAMPLES:
            yield values


def _after_the_tap(counted: Sequence[Capture], name: str) -> Iterator[Samples]:
    """Last samples of each shot, as far back as they lie about the same value."""
    for shot in counted:
        channel = getattr(shot, name)
        if channel is None or channel.noise_std is not None:
            continue
        values = channel.values[np.isfinite(channel.values)]
        tail = values[-TAIL_SAMPLES:]
        scatter = float(tail[len(tail) // 2 :].std()) if len(tail) == TAIL_SAMPLES else 0.0
        if not 0.0 < float(tail.std()) <= STILL_RATIO * scatter:
            continue
        earlier = values[: len(values) - TAIL_SAMPLES]
        blocks = earlier[len(earlier) % BLOCK_SAMPLES :].reshape(-1, BLOCK_SAMPLES)
        near = np.abs(blocks.mean(1) - tail.mean()) <= NEAR * float(tail.std())
        still = int(np.argmin(near[::-1])) if not near.all() else len(blocks)
        yield values[len(values) - TAIL_SAMPLES - max(still - DOUBTED_BLOCKS, 0) * BLOCK_SAMPLES :]
