"""Runs in processes of their own that can be killed, forked from one that has imported and compiled everything."""

from __future__ import annotations

import hashlib
import os
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import lidarlift
from lidarlift import running
from slam.data.errors import InputError
from slam.journal import journal

POLL = 0.01  # s
SNAPSHOT_EVERY = 0.3  # s; much more often than usual, so that many kills meet a snapshot
#: Files whose bytes must be those of a run that was not disturbed; run.json and timings.csv have run times.
COMPARED = (
    "odometry_tum.txt",
    "odometry_kitti.txt",
    "trajectory_tum.txt",
    "trajectory_kitti.txt",
    "trajectory_covariance.csv",
    "map.pcd",
    "loops.csv",
    "graph.g2o",
    "metrics.json",
)
ENDINGS = {0: "done", 1: "error in one line", 2: "exception"}


@dataclass(frozen=True)
class Ending:
    """End of a process.

    Attributes:
        how: 'done', 'error in one line' (an InputError), 'exception' (any other), 'killed' or 'hung'.
        message: The error, '' without one.
        seconds: Run time.
    """

    how: str
    message: str
    seconds: float


def run(
    drive: Path,
    out: Path,
    *,
    kill_after: float | None = None,
    limit: float = 600.0,
    file_size: int | None = None,
    **options: Any,
) -> Ending:
    """Run SLAM in a forked process.

    Args:
        drive: The data set.
        out: The run folder.
        kill_after: Seconds after which the process is killed by SIGKILL.
        limit: Seconds after which a process has hung.
        file_size: Bytes beyond which no file grows: writing fails as on a full disk.
        **options: Of `lidarlift.run`.
    """
    reading, writing = os.pipe()
    begin = time.monotonic()
    process = os.fork()
    if process == 0:
        os.close(reading)
        _child(lambda: lidarlift.run(drive, out=out, **options), writing, file_size)
    os.close(writing)
    how = _waited(process, begin, limit if kill_after is None else kill_after)
    seconds = time.monotonic() - begin
    if how == "late":
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)
        how = "hung" if kill_after is None else "killed"
    with os.fdopen(reading, encoding="utf-8", errors="replace") as pipe:
        return Ending(how, pipe.read() if how not in ("killed", "hung") else "", seconds)


def _no_report(*_: object) -> None:
    """In place of the report of a run: it takes most of a short run's time, and comes after all that is compared."""


def _child(work: Callable[[], object], pipe: int, file_size: int | None) -> None:
    """Do the work and end the process; the error goes into the pipe."""
    code, message = 0, ""
    try:
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        journal.SNAPSHOT_EVERY = SNAPSHOT_EVERY
        running.report_run = _no_report  # type: ignore[assignment]
        if file_size is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (file_size, file_size))
        work()
    except InputError as error:
        code, message = 1, str(error)
    except BaseException as error:
        code, message = 2, f"{type(error).__name__}: {error}"
    os.write(pipe, message[:4000].encode())
    os._exit(code)


def _waited(process: int, begin: float, limit: float) -> str:
    while time.monotonic() - begin < limit:
        ended, status = os.waitpid(process, os.WNOHANG)
        if ended:
            return ENDINGS.get(os.waitstatus_to_exitcode(status), "exception")
        time.sleep(POLL)
    return "late"


def digests(folder: Path) -> dict[str, str]:
    """Return a digest of each of the COMPARED files, '' for one that is missing."""
    files = {name: folder / name for name in COMPARED}
    return {
        name: hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else "" for name, path in files.items()
    }


def warmed_up(drive: Path) -> None:
    """Import and compile what runs need in this process, which forks them: as few threads as possible run here."""
    from slam.compilation import compile_kernels
    from slam.settings import Config

    compile_kernels(Config(), lambda: print("compiling kernels ...", file=sys.stderr))
    with tempfile.TemporaryDirectory() as folder:
        names = Path(folder) / "modules"

        def list_modules() -> None:
            lidarlift.run(drive, out=Path(folder) / "run", frames=slice(4))
            names.write_text("\n".join(sys.modules), encoding="utf-8")

        process = os.fork()
        if process == 0:
            _child(list_modules, os.open(os.devnull, os.O_WRONLY), None)
        os.waitpid(process, 0)
        for name in names.read_text(encoding="utf-8").splitlines():
            with suppress(Exception):  # parts of other packages that are no modules
                import_module(name)


def counted(endings: list[str]) -> Mapping[str, int]:
    """Count equal texts, in the order of their first occurrence."""
    return {ending: endings.count(ending) for ending in dict.fromkeys(endings)}
