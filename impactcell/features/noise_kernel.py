"""What of a channel's noise neighbouring samples share: fitted to the spectra of pieces of a record at rest.

The covariance is white noise and a few parts of `SharedPart`: noise of first order and tones. They are taken
in one after the other, each that which raises the likelihood of the periodograms most (Whittle 1953), as long
as that is no chance. A piece is short against hum: the periodogram's expectation is that of the piece with
its ends cut off, not of the endless record, so that leakage is no fault. Pieces that are shorter than a
period tell well what differs from sample to sample, but of what the noise moves by over their length a part:
of 15 ms of 50 Hz 0.6.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import fminbound, nnls

from impactcell.records import CorrelatedNoise, Samples, SharedPart

MOST_PARTS = 4
"""Parts that are taken in at most."""
LEAST_GAIN = 12.0
"""Gain of the logarithm of the likelihood from which on a part is no chance: of one it is once in 1e6, and
there are some 200 candidates."""
LEAST_DECAY_STEPS, DECAY_RATIO, LONGEST_DECAY = 0.7, 1.35, 3.0
"""Decays tried: from so many sampling steps, each so much longer, to so many lengths of a piece."""
HIGHEST_TONE_HZ, TONES_PER_LENGTH, MOST_TONES = 450.0, 3.0, 300
"""Tones are tried up to this frequency, mains and their harmonics, so many in the resolution of the longest
piece, and no more: closer ones are one to a tap."""
MOST_SAMPLES = 60_000
"""Samples that are looked at, of pieces all over the campaign: by them a part is known to some per cent."""
NEAREST = 6
"""Candidates that are fitted, of those whose slope promises most."""
ROUNDS = 12
"""Rounds of weighted least squares, each with the weights of the spectrum before."""
FADING = (10.0, 3.0, 1.0)
"""Lengths of a piece over which a tone may be forgotten: mains stay in step, what a machine hums does not."""
IN_STEP_GAIN = 3.0
"""Gain of the logarithm of the likelihood from which on a tone is followed for ever: 20 times as likely.
Pieces of less than two periods tell the frequency to some hertz and gain 0 to 1.6 by it, one of four periods
gains 4 or more. Followed at a frequency that is off, 50 Hz of 2 N left residuals of 3 times the noise in two
of eight campaigns."""
NEAR, MOST_STEPS = 0.01, 16
"""How near a decay or a frequency is refined, as a share of the distance of two candidates, and in how many
steps at most."""
SETTLED = 1e-3
"""Fall of the cost, minus the logarithm of the likelihood, below which a fit has come to its end."""
FLOOR, TINY = 1e-9, 1e-300
"""Least share of the variance that is white, and least variance: a spectrum may not vanish."""


def correlated_noise(pieces: Sequence[Samples], step_s: float) -> CorrelatedNoise:
    """Give white noise and what neighbouring samples share, from pieces of equal steps, each about a level.

    Examples
    --------
    >>> times, rng = 1e-4 * np.arange(1000), np.random.default_rng(1)
    >>> hum = [np.sin(100.0 * math.pi * times + phase) for phase in range(9)]
    >>> noise = correlated_noise([one + rng.normal(0.0, 0.1, 1000) for one in hum], 1e-4)
    >>> f"{noise.white_std:.2f}, {noise.parts[0].std:.2f} at {noise.parts[0].frequency_hz:.0f} Hz"
    '0.10, 0.70 at 50 Hz'
    """
    rest = _Rest(_spread_over(pieces), step_s)
    candidates = _candidates(step_s, rest.longest_s)
    spectra = rest.spectra(candidates)
    parts: list[SharedPart] = []
    fitted = rest.fit(parts)
    while len(parts) < MOST_PARTS:
        promising = rest.promising(fitted, spectra)
        tried = [(rest.fit([*parts, candidates[index]]), candidates[index]) for index in promising]
        best, part = min(tried, key=lambda one: one[0].cost)
        if not fitted.cost - best.cost > LEAST_GAIN:
            break
        parts.append(_refined(part, rest, parts))
        fitted = rest.fit(parts)
    white, *shared = np.sqrt(fitted.variances).tolist()
    seen = tuple(replace(part, std=std) for part, std in zip(parts, shared, strict=True) if std > 0.0)
    return CorrelatedNoise(white, seen, step_s)


def _refined(part: SharedPart, rest: "_Rest", others: Sequence[SharedPart]) -> SharedPart:
    """Give the part near a candidate that costs least: of another decay, a tone of another frequency."""

    def cost(**changed: float) -> float:
        return rest.fit([*others, replace(part, **changed)]).cost

    if not part.frequency_hz:
        low, high = part.decay_s / DECAY_RATIO, part.decay_s * DECAY_RATIO
        decay_s = fminbound(
            lambda decay_s: cost(decay_s=decay_s), low, high, xtol=NEAR * low, maxfun=MOST_STEPS
        )
        return replace(part, decay_s=float(decay_s))
    apart, middle = 0.5 / rest.longest_s, part.frequency_hz
    frequency_hz = fminbound(
        lambda frequency_hz: cost(frequency_hz=frequency_hz),
        middle - apart,
        middle + apart,
        xtol=NEAR * apart,
        maxfun=MOST_STEPS,
    )
    tone = replace(part, frequency_hz=float(frequency_hz))

    def cost_of(decay_s: float) -> float:
        return rest.fit([*others, replace(tone, decay_s=decay_s)]).cost

    fading = min((lengths * rest.longest_s for lengths in FADING), key=cost_of)
    is_in_step = cost_of(fading) - cost_of(math.inf) > IN_STEP_GAIN
    return tone if is_in_step else replace(tone, decay_s=fading)


@dataclass(frozen=True, slots=True)
class _Fitted:
    """Variances of white noise and the parts, their spectrum, and minus the logarithm of the likelihood."""

    variances: Samples
    spectrum: Samples
    cost: float


class _Rest:
    """Periodograms of pieces of a record, one after the other, and what a covariance makes of them.

    Attributes
    ----------
    longest_s : float
        Length of the longest piece.
    """

    def __init__(self, pieces: Sequence[Samples], step_s: float) -> None:
        self._counts, self._step_s = [len(piece) for piece in pieces], step_s
        self.longest_s = max(self._counts) * step_s
        self._periodogram = np.concatenate([_periodogram(piece) for piece in pieces])
        self._known: dict[SharedPart, Samples] = {}

    def spectra(self, parts: Sequence[SharedPart]) -> Samples:
        """Give the expectation of the periodograms of each part of variance 1, shape (parts, frequencies)."""
        lags = np.arange(float(max(self._counts)))
        correlation = np.array([part.correlation(lags * self._step_s) for part in parts])
        of_length: dict[int, Samples] = {}
        for count in set(self._counts):
            tapered = correlation[:, :count] * (1.0 - lags[:count] / count)
            of_length[count] = 2.0 * np.fft.rfft(tapered).real[:, _inside(count)] - 1.0
        whole = np.concatenate([of_length[count] for count in self._counts], axis=1)
        floored: Samples = np.maximum(whole, FLOOR)
        return floored

    def promising(self, fitted: _Fitted, spectra: Samples) -> list[int]:
        """Give the candidates by which the likelihood would gain most, to second order, by each alone."""
        slope = spectra @ ((self._periodogram - fitted.spectrum) / fitted.spectrum**2)
        curvature = (spectra / fitted.spectrum) ** 2 @ np.ones(spectra.shape[1])
        gain = np.where(slope > 0.0, slope**2 / curvature, 0.0)
        return [int(index) for index in np.argsort(gain)[::-1][:NEAREST]]

    def fit(self, parts: Sequence[SharedPart]) -> _Fitted:
        """Fit the variances of white noise and of parts.

        The likelihood's Fisher scoring is least squares with weights 1 over the spectrum; a step that is too
        long is halved.
        """
        for part in parts:
            if part not in self._known:
                self._known[part] = self.spectra([part])[0]
        spectra = np.vstack([np.ones_like(self._periodogram), *(self._known[part] for part in parts)])
        total = max(float(self._periodogram.mean()), TINY)
        fitted = self._at(np.full(len(spectra), total / len(spectra)), spectra)
        for _ in range(ROUNDS):
            weighted = spectra / fitted.spectrum
            factor = np.linalg.cholesky(weighted @ weighted.T + FLOOR * np.eye(len(spectra)))
            aim, _ = nnls(factor.T, np.linalg.solve(factor, weighted @ (self._periodogram / fitted.spectrum)))
            aim[0] = max(aim[0], FLOOR * total)
            tried = (
                self._at(fitted.variances + 0.5**k * (aim - fitted.variances), spectra) for k in range(ROUNDS)
            )
            moved = next((one for one in tried if one.cost <= fitted.cost), fitted)
            is_settled, fitted = fitted.cost - moved.cost < SETTLED, moved
            if is_settled:
                break
        return fitted

    def _at(self, variances: Samples, spectra: Samples) -> _Fitted:
        """Cost of variances: each ordinate is exponential about its expectation."""
        spectrum = variances @ spectra
        cost = float(np.sum(np.log(spectrum) + self._periodogram / spectrum))
        return _Fitted(variances, spectrum, cost)


def _spread_over(pieces: Sequence[Samples]) -> list[Samples]:
    """Give all pieces, or of many samples some of them, from first to last."""
    share = max(math.ceil(sum(map(len, pieces)) / MOST_SAMPLES), 1)
    return list(pieces[::share])


def _candidates(step_s: float, longest_s: float) -> list[SharedPart]:
    count = 1 + int(math.log(LONGEST_DECAY * longest_s / (LEAST_DECAY_STEPS * step_s), DECAY_RATIO))
    decays = LEAST_DECAY_STEPS * step_s * DECAY_RATIO ** np.arange(count)
    highest = min(HIGHEST_TONE_HZ, 0.25 / step_s)
    spacing = max(1.0 / (TONES_PER_LENGTH * longest_s), highest / MOST_TONES)
    tones = np.arange(1.0 / longest_s, highest, spacing)
    slow = [SharedPart(1.0, float(decay)) for decay in decays]
    return slow + [SharedPart(1.0, math.inf, float(frequency)) for frequency in tones]


def _periodogram(piece: Samples) -> Samples:
    """Square of the Fourier transform over the length: of white noise its variance, at each frequency."""
    squares: Samples = np.abs(np.fft.rfft(piece - piece.mean())[_inside(len(piece))]) ** 2 / len(piece)
    return squares


def _inside(count: int) -> slice:
    """Frequencies above 0, which the level has, and below the highest, whose square is of another law."""
    return slice(1, (count + 1) // 2)
