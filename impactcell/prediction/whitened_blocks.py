"""The blocks of force and position of a tap, each channel without what its blocks share of their noise."""

import numpy as np

from impactcell.prediction.block_averaging import BlockMeans
from impactcell.prediction.whitening import Whitening, whitening
from impactcell.records import Samples


class WhitenedBlocks:
    """What turns blocks, and all that is laid beside them, into innovations; white noise stays as it is.

    Parameters
    ----------
    force, position : BlockMeans

    Attributes
    ----------
    std : ndarray, shape (n,)
        Standard deviations of the innovations, of force and then of position.
    """

    def __init__(self, force: BlockMeans, position: BlockMeans) -> None:
        self._filters = tuple(map(_filter_of, (force, position)))
        self._split = len(force.values)
        stds = [
            blocks.std if one is None else one.std
            for blocks, one in zip((force, position), self._filters, strict=True)
        ]
        self.std = np.concatenate(stds)

    def innovations(self, curves: Samples) -> Samples:
        """Give what is new in each block of curves, shape (n,) or (c, n)."""
        if self._filters == (None, None):
            return curves
        force, position = self.of_traces(curves[..., : self._split], curves[..., self._split :])
        return np.concatenate([force, position], axis=-1)

    def of_traces(self, force: Samples, position: Samples) -> tuple[Samples, Samples]:
        """Give the same of force and of position, each of as many curves, one after the other."""
        of_force, of_position = self._filters
        return (
            force if of_force is None else of_force.innovations(np.ascontiguousarray(force)),
            position if of_position is None else of_position.innovations(np.ascontiguousarray(position)),
        )

    def restored(self, innovations: Samples) -> Samples:
        """Give the curve that has these innovations, shape (n,)."""
        parts = innovations[: self._split], innovations[self._split :]
        pairs = zip(parts, self._filters, strict=True)
        return np.concatenate([part if one is None else one.restored(part) for part, one in pairs])


def _filter_of(blocks: BlockMeans) -> Whitening | None:
    if blocks.noise is None:
        return None
    factor = blocks.std * np.sqrt(blocks.scatter.count) / blocks.scatter.noise_std
    return whitening(blocks.noise, blocks.time_s, blocks.scatter.count, factor)
