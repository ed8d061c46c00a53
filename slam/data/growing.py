"""Rows of numbers that grow with a run."""

from __future__ import annotations

import mmap
from math import prod

import numpy as np

from slam.data.cloud import Array

BLOCK = 1024  # rows that are allocated at once


class Growing:
    """An array that grows row by row, in blocks that are never moved. Any thread can read it at any time.

    Thousands of small objects that live as long as the run would be scattered over the heap, between the large arrays
    of single scans; the gaps between them fit ever fewer of these, and the process grows by more than the objects. For
    the same reason the blocks are not on the heap, but pages of their own.

    Args:
        shape: Shape of a row; () for single numbers.
    """

    def __init__(self, *shape: int) -> None:
        self.shape = shape
        self._blocks: list[Array] = []
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, row: Array | float) -> None:
        """Append a row."""
        if self._count == BLOCK * len(self._blocks):
            private = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS  # not shared with processes that are forked
            pages = mmap.mmap(-1, 8 * BLOCK * prod(self.shape), flags=private)
            self._blocks.append(np.frombuffer(pages).reshape(BLOCK, *self.shape))
        self._blocks[-1][self._count % BLOCK] = row
        self._count += 1  # the row is complete

    def __getitem__(self, number: int) -> Array:
        """Return a row, a copy."""
        block, row = divmod(range(self._count)[number], BLOCK)
        return np.array(self._blocks[block][row])

    def __setitem__(self, number: int, row: Array | float) -> None:
        block, at = divmod(range(self._count)[number], BLOCK)
        self._blocks[block][at] = row

    def array(self, columns: slice | int = slice(None)) -> Array:
        """Return all rows (N, ...), a copy, or of rows that are vectors some columns."""
        count, blocks = self._count, self._blocks
        parts = [block[: max(count - BLOCK * k, 0)] for k, block in enumerate(blocks)]
        rows = [part[:, columns] if self.shape else part for part in parts]
        return np.concatenate(rows) if rows else np.zeros((0, *self.shape))[..., columns]
