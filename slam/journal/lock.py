"""One run at a time in a run folder."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from slam.data.errors import InputError

LOCK = ".lock"


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a run folder, and create the folder.

    The lock is the operating system's, on a file that names the process. It ends with the process, however that ends,
    so the file of a process that was killed locks nobody out. A folder that is empty in the end is removed again.

    Raises:
        InputError: Another run holds the lock, or the folder cannot be written.
    """
    path = folder / LOCK
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = _acquired(path)
    except OSError as error:
        fault = f"cannot be written ({error.strerror or error})"
        raise InputError(f"{folder}: {fault}; free space or choose another folder") from error
    try:
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(file)
        with suppress(OSError):  # it has files
            folder.rmdir()


def _acquired(path: Path) -> int:
    """The locked file. It is opened again if its last owner removed it between opening and locking."""
    import fcntl

    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = os.read(file, 200).decode("utf-8", "replace").strip() or "another process"
            os.close(file)
            raise InputError(
                f"{path.parent}: {owner} writes a run into this folder; wait for it, or choose another folder"
            ) from None
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(file), path.stat()):
                os.ftruncate(file, 0)
                os.write(file, f"process {os.getpid()} on {socket.gethostname()}\n".encode())
                return file
        os.close(file)
