"""Storage of byte blocks in memory up to a budget, and on disk beyond it."""

from __future__ import annotations

import tempfile
import threading
import weakref
from typing import IO

from slam.data.errors import InputError


class Spill:
    """Stores blocks in order of insertion; the oldest are moved to disk first. Thread-safe.

    The file is unnamed: the operating system removes it when the program ends, even after a crash.

    Args:
        budget: Maximum size of the blocks in memory [bytes].
    """

    def __init__(self, budget: int) -> None:
        self._budget, self.in_memory, self.on_disk = budget, 0, 0  # bytes
        self._blocks: list[bytes | tuple[int, int]] = []  # the block itself, or its offset and size in the file
        self._moved = 0  # number of blocks on disk
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
        """Return a block by its number, from 0."""
        with self._lock:
            block = self._blocks[number]
            if isinstance(block, bytes):
                return block
            assert self._file is not None
            self._file.seek(block[0])
            return self._file.read(block[1])

    def _move_oldest(self) -> None:
        block = self._blocks[self._moved]
        assert isinstance(block, bytes)
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
        self._blocks[self._moved] = self.on_disk, len(block)
        self.on_disk += len(block)
        self.in_memory -= len(block)
        self._moved += 1

    def _opened(self) -> IO[bytes]:
        if self._file is None:
            self._file = tempfile.TemporaryFile(prefix="lidarlift-")  # noqa: SIM115  # lives as long as this object
            weakref.finalize(self, self._file.close)
        return self._file
