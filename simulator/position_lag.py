"""What a first-order lag of the position channel makes of a motion, by quadrature."""

import numpy as np
from numpy.typing import NDArray

from simulator.plant_integrator import Piece

Samples = NDArray[np.float64]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)
SHORTEST_S = 1e-6
"""Longest interval of the quadrature for lags far shorter, which leave less than a nanometre [s]."""


def lag_behind(pieces: tuple[Piece, ...], lag_s: float, time_s: Samples) -> Samples:
    """How far along the shot the lag is behind at each time up to the end of the last piece, shape (n,).

    w = integral from 0 to t of exp(-(t - s) / tau) x'(s) ds, by Gauss-Legendre on intervals of 2 tau at most
    that end at every time asked for and at every event.
    """
    ends = [
        np.linspace(one.start_s, one.stop_s, 2 + int((one.stop_s - one.start_s) / max(2 * lag_s, SHORTEST_S)))
        for one in pieces
    ]
    last = pieces[-1].stop_s if pieces else 0.0
    asked = np.clip(time_s, 0.0, last)
    grid = np.unique(np.concatenate([*ends, asked, [0.0]]))
    middle, half = 0.5 * (grid[1:] + grid[:-1]), 0.5 * np.diff(grid)
    owner = np.searchsorted([one.start_s for one in pieces], middle, side="right") - 1
    added = np.zeros(len(middle))
    for place, piece in enumerate(pieces):
        chosen = owner == place
        times = middle[chosen, None] + half[chosen, None] * NODES
        speed = np.asarray(piece.states(times.ravel()))[1].reshape(times.shape)
        decay = np.exp((times - grid[1:][chosen, None]) / lag_s)
        added[chosen] = half[chosen] * ((speed * decay) @ WEIGHTS)
    behind = [0.0]
    for kept, more in zip(np.exp(-2.0 * half / lag_s).tolist(), added.tolist(), strict=True):
        behind.append(behind[-1] * kept + more)
    return np.array(behind)[np.searchsorted(grid, asked)] * np.exp(-np.maximum(time_s - last, 0.0) / lag_s)
