"""Storage of byte blocks in memory up to a budget, and on disk beyond it."""

from __future__ import annotations

import tempfile
import threading
import weakref
from collections.abc import Callable
from typing import IO

from slam.data.errors import InputError


class Spill:
    """Stores blocks in order of insertion; the oldest are moved to disk first. Thread-safe.

    The file is unnamed: the operating system removes it when the program ends, even after a crash.

    Args:
        budget: Maximum size of the blocks in memory [bytes].
        stored: Returns a block by its number, if all blocks are stored elsewhere too; then there is no file.
        count: Number of blocks that are stored elsewhere at the beginning.
    """

    def __init__(self, budget: int, stored: Callable[[int], bytes] | None = None, count: int = 0) -> None:
        self._budget, self.in_memory, self.on_disk = budget, 0, 0  # bytes
        self._stored = stored
        # the block itself, its offset and size in the file, or None: stored elsewhere, or forgotten
        self._blocks: list[bytes | tuple[int, int] | None] = [None] * count
        self._moved = count  # number of blocks that are not in memory
        self._file: IO[bytes] | None = None
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._blocks)

    def append(self, block: bytes) -> None:
        """Append a block.

        Raises:
            InputError: The disk is full.
        """
        with self._lock:
            self._blocks.append(block)
            self.in_memory += len(block)
            while self.in_memory > self._budget:
                self._move_oldest()

    def read(self, number: int) -> bytes:
        """Return a block by its number, from 0.

        Raises:
            LookupError: It was forgotten.
        """
        with self._lock:
            block = self._blocks[number]
            if isinstance(block, bytes):
                return block
            if block is not None:
                assert self._file is not None
                self._file.seek(block[0])
                return self._file.read(block[1])
        if self._stored is None:
            raise LookupError(f"block {number} was forgotten")
        return self._stored(number)  # without the lock: it may wait for the disk, and keyframes are appended meanwhile

    def forget(self, number: int) -> None:
        """Free the memory of a block that is not read again; what is in the file stays there."""
        with self._lock:
            block, self._blocks[number] = self._blocks[number], None
            self.in_memory -= len(block) if isinstance(block, bytes) else 0

    def _move_oldest(self) -> None:
        block = self._blocks[self._moved]
        if isinstance(block, bytes):
            self._blocks[self._moved] = None if self._stored else self._written(block)
            self.in_memory -= len(block)
        self._moved += 1

    def _written(self, block: bytes) -> tuple[int, int]:
        """The offset and size of a block in the file, after writing it."""
        try:
            file = self._opened()
            file.seek(self.on_disk)
            file.write(block)
            file.flush()
        except OSError as error:
            raise InputError(
                f"{tempfile.gettempdir()}: cannot write keyframes ({error.strerror or error}); free some space, "
                "or set TMPDIR to a folder with more"
            ) from error
        self.on_disk += len(block)
        return self.on_disk - len(block), len(block)

    def _opened(self) -> IO[bytes]:
        if self._file is None:
            self._file = tempfile.TemporaryFile(prefix="lidarlift-")  # noqa: SIM115  # lives as long as this object
            weakref.finalize(self, self._file.close)
        return self._file
