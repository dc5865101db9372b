"""Is a cycle deviant? T^2 on the principal components, noise-whitened SPE, and a scan over shapes.

A cycle's information vector y = h - G m, m the material's mean known to a covariance V, has covariance
G + G (V + C C') G when normal: sensor noise, the mean's own error and the components C. With
P = (G^-1 + V + C C')^-1 and u = P G^-1 y a shape s in friction is seen with the score s' u / sqrt(s' P s).
T^2 and SPE find what was not thought of; the scan over bumps, ripples, level and tilt comes close to the
oracle that knows the shape. Each gets a share of the false alarms.

The variation is itself learned from n cycles. What is tested against a covariance of k learned dimensions
varies 1 + 2 k / n times as much as it says (Reed, Mallett & Brennan 1974, IEEE Trans. AES 10:853), and the
share of a score that comes from it follows Student's t.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, fdtrc

from impactcell.records import Samples
from impactcell.tracking import linear, profile, shapes
from impactcell.tracking import reference as references
from impactcell.tracking.reference import Reference
from impactcell.tracking.variation import MODES

COMPONENTS = 3  # principal components of T^2
SHARES = {"t_squared": 0.02, "spe": 0.02, "level": 0.11, "tilt": 0.13, "bump": 0.42, "ripple": 0.3}
LEAST_INFORMATION = 400.0  # directions known worse than 1 / sqrt of this in friction say nothing
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


def judge(reference: Reference, slide: profile.Information, grid_m: Samples, usual: float) -> Verdict:
    """Test one cycle against its material's reference.

    Parameters
    ----------
    usual : float
        Usual friction, which scales what is worth looking for.
    """
    C, cycles = reference.components, float(reference.variation.cycles)
    G, y = references.within(reference, slide.matrix, slide.vector - slide.matrix @ reference.mean)
    n = min(slide.seen, references.reach(reference))
    G, y = _with_mean_error(G, y, references.precision(reference))
    G, y, C = G[:n, :n], y[:n], C[:n]
    # the lesser components widen the noise that SPE is whitened by; T^2 is on the leading ones
    lesser = references.without_variation(C[:, COMPONENTS:], G, y)
    t_squared, spe, freedom = _squares(*lesser, C[:, :COMPONENTS])
    # variation beyond the modes, or noise that was declared too low, widens everything once it is certain
    count = max(reference.spe_count, 1)
    usual_spe = reference.spe_sum / count - 2.0 * math.sqrt(2.0 / (max(freedom, 1) * count))
    scale = max(1.0, usual_spe)
    found = {
        "t_squared": _hotelling(t_squared, int(cycles)),
        "spe": float(chdtrc(freedom, spe / scale)) if freedom > 0 else 1.0,
    }
    P, u = references.without_variation(C, G, y)
    scale *= 1.0 + 2.0 * MODES / cycles
    looked = shapes.shapes(float(grid_m[-1]), len(grid_m))
    best, row = shapes.scan(looked, P, u, C, slide.reached_m, 30.0 / (LARGEST * usual) ** 2, scale, cycles)
    found.update({name: b[0] for name, b in best.items()})
    kind = min(found, key=lambda name: found[name] / SHARES[name])
    p_value = min(1.0, found[kind] / SHARES[kind])
    _, size, std = best.get(kind, best["bump"])
    at = float(grid_m[row % len(grid_m)]) if row >= 0 else math.nan
    return Verdict(p_value, t_squared, spe, freedom, kind, at, size, std)


def _with_mean_error(G: Samples, y: Samples, precision: Samples) -> tuple[Samples, Samples]:
    """Information (G^-1 + V)^-1 and its vector, V the inverse of `precision`."""
    lost = G @ linear.solved(G + precision, np.column_stack([G, y]))
    return G - lost[:, :-1], y - lost[:, -1]


def _squares(P: Samples, y: Samples, C: Samples) -> tuple[float, float, int]:
    """Hotelling's T^2, and the squared prediction error over the sensor noise with its freedom."""
    values, vectors = linear.eigen(P)
    seen = slice(int(values.searchsorted(LEAST_INFORMATION)), None)
    root, axes = np.sqrt(values[seen]), vectors[:, seen].T
    whitened = (axes @ y) / root
    inside = (axes @ C) * root[:, np.newaxis]
    sizes = np.sqrt((inside**2).sum(axis=0))
    whole, freedom = float(whitened @ whitened), len(root) - COMPONENTS
    if freedom <= 0 or sizes.min() < 1e-9:
        return 0.0, whole, len(root)
    inside /= sizes
    gram, along = inside.T @ inside, inside.T @ whitened
    t_squared = float(along @ linear.solved(gram + (gram * sizes**2) @ gram, along))
    return t_squared, max(whole - float(along @ linear.solved(gram, along)), 0.0), freedom


def _hotelling(t_squared: float, cycles: int) -> float:
    """p-value of T^2 when the components were learned from `cycles` cycles."""
    n, k = cycles, COMPONENTS
    if n <= k + 1:
        return 1.0
    return float(fdtrc(k, n - k, t_squared * (n - k) / (k * (n - 1.0))))
