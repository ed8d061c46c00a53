"""Runs that are killed at seeded moments and resumed: their files have the bytes of a run that was not killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable
from itertools import count
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

SAME = ("odometry_tum.txt", "trajectory_tum.txt", "trajectory_covariance.csv", "graph.g2o", "loops.csv", "map.pcd")
RANDOM, LAST = 3, ("select_loops", "write_points")  # kills anywhere; and when these functions begin


def test_killed_runs_end_with_the_same_bytes(street_drive: Callable[..., Path], tmp_path: Path) -> None:
    """A process of its own forks the runs, since this one has threads, and a start takes seconds."""
    command = [sys.executable, __file__, str(street_drive()), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    endings = json.loads(done.stdout.splitlines()[-1])
    assert len(endings) == RANDOM + len(LAST)
    assert all(how == [-signal.SIGKILL, 0] for how in endings.values()), (endings, done.stderr)
    whole = {name: (tmp_path / "whole" / name).read_bytes() for name in SAME}
    for moment in endings:
        assert {name: (tmp_path / moment / name).read_bytes() for name in SAME} == whole, moment


def main(drive: Path, folder: Path) -> None:
    """Run, then kill and resume runs, and print both exit codes of each."""
    import lidarlift
    from lidarlift import running
    from slam.journal import journal

    journal.SNAPSHOT_EVERY = 0.0  # after every frame
    running.report_run = lambda *_: None  # type: ignore[assignment]  # takes most of the time, after all that is compared
    calls = on_each_call(lambda _, __: None)
    lidarlift.run(drive, out=folder / "whole")
    sys.setprofile(None)
    threading.setprofile(None)
    moments = np.random.default_rng(0).integers(0, next(calls), RANDOM).tolist()
    endings = {}
    for moment in (*moments, *LAST):
        out = folder / str(moment)

        def killed(moment: Any = moment, out: Path = out) -> None:
            on_each_call(lambda number, name: moment in (number, name) and os.kill(os.getpid(), signal.SIGKILL))
            lidarlift.run(drive, out=out)

        def resumed(out: Path = out) -> None:
            lidarlift.run(drive, out=out, resume=True)

        endings[str(moment)] = [forked(killed), forked(resumed)]
    print(json.dumps(endings))


def on_each_call(action: Callable[[int, str], object]) -> count[int]:
    """Call `action` with number and name of each call of a function of slam, in all threads; return the counter."""
    calls = count()

    def watch(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and f"{os.sep}slam{os.sep}" in frame.f_code.co_filename:
            action(next(calls), frame.f_code.co_name)

    threading.setprofile(watch)
    sys.setprofile(watch)
    return calls


def forked(work: Callable[[], object]) -> int:
    """Do the work in a forked process; return its exit code, negative for a signal."""
    process = os.fork()
    if process == 0:
        try:
            work()
        except BaseException:
            traceback.print_exc()
            os._exit(1)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
