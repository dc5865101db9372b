"""Many taps in one compiled call: their samples, or what comes out of them."""

import numpy as np

from impactcell.numerics.jit import IntArray
from impactcell.physics import memory_layout as at
from impactcell.physics.integrator import integrate_taps
from impactcell.physics.memory_layout import SampleArrays, TapArrays
from impactcell.records import Samples

MAX_DURATION_S = 600.0
"""Longest motion that is integrated: a part that moves for ten minutes is pushed, or slides downhill."""
NO_SAMPLES = np.empty(0)
"""In place of sample times, samples, events or drives that nobody asked for."""
NO_KINDS = np.empty(0, dtype=np.int64)
"""The same for the kinds of events."""


def undriven(parameters: Samples, laws: IntArray) -> TapArrays:
    """Taps that an actuator strikes, or that slide freely; `parameters` of shape (n, width)."""
    return TapArrays(parameters, laws, NO_SAMPLES, np.zeros(parameters.shape[0] + 1, dtype=np.int64))


def sample_taps(taps: TapArrays, sample_index: IntArray, times: Samples) -> Samples:
    """Integrate taps as far as they are sampled; after `MAX_DURATION_S` everything stays as it is.

    Parameters
    ----------
    taps : TapArrays
    sample_index : ndarray, shape (n, SAMPLE_INDEX_COUNT)
        Where in `times` the samples of each tap and channel begin and end.
    times : ndarray, shape (samples,)
        Ascending within each tap's channel.

    Returns
    -------
    ndarray, shape (samples,)
        Not finite from where a tap was given up for `MAX_STEPS` or `MAX_EVENTS`; 0 of no tap's.
    """
    samples = np.zeros(times.size)
    outputs = np.empty((taps.parameters.shape[0], at.OUTPUT_COUNT))
    asked = SampleArrays(sample_index.copy(), times, samples, NO_KINDS, NO_SAMPLES)
    integrate_taps(taps[:], asked[:], outputs, MAX_DURATION_S, at.TO_LAST_SAMPLE)
    return samples


def integrate_to_rest(taps: TapArrays, horizon_s: float) -> Samples:
    """Integrate taps for their outputs, shape (n, OUTPUT_COUNT), without any samples, up to `horizon_s`."""
    count = taps.parameters.shape[0]
    outputs = np.empty((count, at.OUTPUT_COUNT))
    nothing = np.zeros((count, at.SAMPLE_INDEX_COUNT), dtype=np.int64)
    asked = SampleArrays(nothing, NO_SAMPLES, NO_SAMPLES, NO_KINDS, NO_SAMPLES)
    integrate_taps(taps[:], asked[:], outputs, horizon_s, at.TO_REST)
    return outputs
