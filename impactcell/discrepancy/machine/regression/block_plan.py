"""Which rows make a block, which blocks fit a model, and which are held out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactcell.discrepancy.machine.records.held_out_stretch import between_gaps
from impactcell.discrepancy.machine.records.uniform_records import UniformRecord
from impactcell.discrepancy.machine.regression.block_sums import (
    BLOCKS_OF_RECORD,
    PIECES_PER_BLOCK,
    Blocks,
    blocks_of,
)
from impactcell.discrepancy.machine.regression.weak_form import IndexArray, Rows

RECORDS_FOR_FOLDS = 4
"""Training records from which on a fold of the cross-validation is a record [1]."""
FOLDS = 5
"""Folds of blocks in a row where there are fewer records [1]."""


@dataclass(frozen=True, slots=True)
class BlockPlan:
    """How rows are divided.

    Attributes
    ----------
    block_s : float
    held : set of int or None
        Places of the records that are held out; None for the last third of each.
    pieces_each : float
        Independent pieces that a block counts for.
    """

    block_s: float
    held: set[int] | None
    pieces_each: float = PIECES_PER_BLOCK

    def number(self, rows: Rows) -> IndexArray:
        """Block of each row, shape (n,)."""
        inside = np.floor(rows.time_s / self.block_s).astype(np.int64)
        return BLOCKS_OF_RECORD * rows.record.astype(np.int64) + inside

    def part(self, rows: Rows) -> IndexArray:
        """Part of each row: what is fitted of each record has one number, what is held out another; (n,)."""
        number = self.number(rows)
        _, held = self._fitted_and_held(number)
        return 2 * rows.record.astype(np.int64) + np.isin(number, held)

    def rows_of(self, rows: Rows, blocks: Blocks) -> np.ndarray:
        """Whether each row is in one of some blocks, shape (n,)."""
        return np.isin(self.number(rows), blocks.number)

    def blocks(self, rows: Rows) -> tuple[Blocks, Blocks]:
        """Training and held-out blocks."""
        number = self.number(rows)
        fitted, held = self._fitted_and_held(number)
        records = sorted({block // BLOCKS_OF_RECORD for block in fitted})
        if len(records) >= RECORDS_FOR_FOLDS:
            fold = {block: records.index(block // BLOCKS_OF_RECORD) for block in fitted}
        else:
            fold = {block: place * FOLDS // len(fitted) for place, block in enumerate(fitted)}
        parts = fold, dict.fromkeys(held, 0)
        training, held_out = (blocks_of(rows, number, part, self.pieces_each) for part in parts)
        return training, held_out

    def held_spans(
        self, rows: Rows, records: Sequence[UniformRecord]
    ) -> tuple[tuple[int, float, float], ...]:
        """Record, begin and end of each stretch of held-out blocks between the gaps of records."""
        every = self._held_of([int(block) for block in np.unique(self.number(rows))])
        spans = []
        for place, record in enumerate(records):
            held = [block for block in every if block // BLOCKS_OF_RECORD == place]
            if held:
                begin = (held[0] % BLOCKS_OF_RECORD) * self.block_s if self.held is None else 0.0
                pieces = between_gaps(record, begin, float(record.time_s[-1]), 0.5 * self.block_s)
                spans += [(place, *piece) for piece in pieces]
        return tuple(spans)

    def _fitted_and_held(self, number: IndexArray) -> tuple[list[int], list[int]]:
        """Whole blocks that fit, and those that are held out."""
        sizes = {
            int(block): int(count)
            for block, count in zip(*np.unique(number, return_counts=True), strict=True)
        }
        usual = float(np.median([*sizes.values()]))
        whole = [block for block, count in sizes.items() if count >= 0.5 * usual]
        held = set(self._held_of(whole))
        return [block for block in whole if block not in held], [block for block in whole if block in held]

    def _held_of(self, whole: Sequence[int]) -> list[int]:
        """Which of the blocks, in their order, are held out: those of whole records, or the last of each."""
        members: dict[int, list[int]] = {}
        for block in whole:
            members.setdefault(block // BLOCKS_OF_RECORD, []).append(block)
        if self.held is not None:
            return [block for record in members if record in self.held for block in members[record]]
        return [block for blocks in members.values() for block in blocks[len(blocks) - len(blocks) // 3 :]]
