"""Is a cycle deviant? T^2 on the principal components, noise-whitened SPE, and a scan over shapes.

A cycle's information vector y = h - G m, m the material's mean known to a covariance V, has covariance
G + G (V + C C') G when normal: sensor noise, the mean's own error and the components C. With
P = (G^-1 + V + C C')^-1 and u = P G^-1 y a shape s in friction is seen with the score s' u / sqrt(s' P s).
T^2 and SPE find what was not thought of; the scan over bumps, ripples, level and tilt comes close to the
oracle that knows the shape. Each gets a share w of the false alarms; together their p-value is the weighted
harmonic mean 1 / sum(w / p) (Wilson 2019, PNAS 116:1195), which for small ones is the averaged likelihood
ratio, the best that can be done without knowing which of them it will be.

The variation is itself learned from n cycles. What is tested against a covariance of k learned dimensions
varies 1 + 2 k / n times as much as it says (Reed, Mallett & Brennan 1974, IEEE Trans. AES 10:853), and the
share of a score that comes from it follows Student's t.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, fdtrc

from impactcell.compiled import compiled
from impactcell.records import Samples
from impactcell.tracking import linear, profile, scan, shapes
from impactcell.tracking import reference as references
from impactcell.tracking.reference import Reference
from impactcell.tracking.variation import MODES

COMPONENTS = 3  # principal components of T^2
SHARES = {"t_squared": 0.02, "spe": 0.02, "level": 0.08, "tilt": 0.08, "bump": 0.42, "ripple": 0.38}
LEAST_INFORMATION = 400.0  # directions known worse than 1 / sqrt of this in friction say nothing
INVISIBLE = 1e-9  # components smaller than this against the noise
SMALLEST = 1e-300  # p-value
LARGEST = 0.5  # shapes that even half of the friction would not show are not looked for


@dataclass(frozen=True, slots=True)
class Verdict:
    """How normal a cycle is.

    Attributes
    ----------
    p_value : float
        Of the whole test, all shares together.
    t_squared, spe : float
    spe_freedom : int
        Degrees of freedom of `spe`.
    kind : str
        Which part of the test says most.
    at_m : float
        Where the cycle deviates most.
    size, size_std : float
        Friction of the best shape.
    """

    p_value: float
    t_squared: float
    spe: float
    spe_freedom: int
    kind: str
    at_m: float
    size: float
    size_std: float


def judge(reference: Reference, slide: profile.Information, grid_m: Samples) -> Verdict:
    """Test one cycle against its material's reference."""
    cycles = float(reference.variation.cycles)
    n = min(slide.seen, references.judged(reference))
    G, y = references.unsure(reference, *references.deviating(reference, slide, n))
    C = reference.components[:n].copy()
    t_squared, spe, freedom = _squares(G, y, C, COMPONENTS)
    # variation beyond the modes, or noise that was declared too low, widens everything once it is certain
    count = max(reference.spe_count, 1)
    usual_spe = reference.spe_sum / count - 2.0 * math.sqrt(2.0 / (max(freedom, 1) * count))
    scale = max(1.0, usual_spe)
    found = {
        "t_squared": _hotelling(t_squared, int(cycles)),
        "spe": float(chdtrc(freedom, spe / scale)) if freedom > 0 else 1.0,
    }
    P, u = linear.varied(C, G, y)
    scale *= 1.0 + 2.0 * MODES / cycles
    least = 30.0 / (LARGEST * references.usual(reference.mean, n)) ** 2
    looked = shapes.shapes(float(grid_m[-1]), len(grid_m))
    best, centre = scan.scan(looked, P, u, C, slide.reached_m, least, scale, cycles)
    found.update({name: b[0] for name, b in best.items()})
    odds = {name: share / max(found[name], SMALLEST) for name, share in SHARES.items()}
    kind = max(odds, key=lambda name: odds[name])
    _, size, std = best.get(kind, best["bump"])
    at = float(grid_m[centre]) if centre >= 0 else math.nan
    return Verdict(1.0 / sum(odds.values()), t_squared, spe, freedom, kind, at, size, std)


@compiled
def _squares(G: Samples, y: Samples, C: Samples, leading: int) -> tuple[float, float, int]:
    """Hotelling's T^2, and the squared prediction error over the sensor noise with its freedom.

    Whitened by a Cholesky factor that takes the best known direction next and ends where nothing is known.
    """
    # the lesser components widen the noise that SPE is whitened by; T^2 is on the leading ones
    left, rest = linear.varied(C[:, leading:].copy(), G, y)
    image = left @ C[:, :leading].copy()
    n = len(rest)
    whitened, inside, freedom = np.zeros(n), np.zeros((n, leading)), 0
    for k in range(n):
        best = 0
        for i in range(n):
            if left[i, i] > left[best, best]:
                best = i
        if left[best, best] < LEAST_INFORMATION:
            break
        column = left[:, best] / math.sqrt(left[best, best])
        whitened[k] = rest[best] / column[best]
        inside[k] = image[best] / column[best]
        for i in range(n):
            rest[i] -= column[i] * whitened[k]
            for j in range(n):
                left[i, j] -= column[i] * column[j]
            for j in range(leading):
                image[i, j] -= column[i] * inside[k, j]
        freedom += 1
    whole = (whitened**2).sum()
    sizes = np.sqrt((inside**2).sum(axis=0))
    if freedom <= leading or sizes.min() < INVISIBLE:
        return 0.0, whole, freedom
    inside /= sizes
    gram, along = inside.T @ inside, inside.T @ whitened
    t_squared = (along * linear.solved(gram + (gram * sizes**2) @ gram, along)).sum()
    left_over = whole - (along * linear.solved(gram, along)).sum()
    return t_squared, max(left_over, 0.0), freedom - leading


def _hotelling(t_squared: float, cycles: int) -> float:
    """p-value of T^2 when the components were learned from `cycles` cycles."""
    n, k = cycles, COMPONENTS
    if n <= k + 1:
        return 1.0
    return float(fdtrc(k, n - k, t_squared * (n - k) / (k * (n - 1.0))))
