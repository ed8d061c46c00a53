"""The session of a live run: after a crash nothing is lost that was there a second before."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import lidarlift
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.journal import journal as journals
from slam.recovery import recovered, session_of
from slam.run import Run

SAME = ("trajectory_tum.txt", "trajectory_covariance.csv", "graph.g2o", "loops.csv", "map.pcd")


class CrashError(Exception):
    """Of the user's program."""


def live(scans: list[Array], out: Path, crash_at: int | None = None, **options: bool) -> Run:
    """Feed the scans that are not yet in the session."""
    with lidarlift.Slam(out=out, **options) as slam:
        for number in range(slam.scans, len(scans)):
            if number == crash_at:
                raise CrashError
            slam.add(scans[number], 0.1 * number)
        return slam.finish()


def test_finish_writes_the_run_folder_with_the_session(street_scans: list[Array], tmp_path: Path) -> None:
    run = live(street_scans[:6], tmp_path / "run")
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert {*SAME, "run.json", "session"} <= names
    assert not names & {"unfinished", ".lock"}
    path = session_of(tmp_path / "run")
    assert path is not None
    np.testing.assert_array_equal(recovered(path).poses, run.odometry_poses)


def test_a_session_that_is_continued_has_the_same_files(
    street_scans: list[Array], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Equal bytes: two runs of the same code."""
    monkeypatch.setattr(journals, "SNAPSHOT_EVERY", 0.0)
    live(street_scans, tmp_path / "whole")
    for crash_at in (3, 5, 7):
        with pytest.raises(CrashError):
            live(street_scans, tmp_path / "run", crash_at, resume=True)
    live(street_scans, tmp_path / "run", resume=True)
    for name in SAME:
        assert (tmp_path / "run" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name


def test_an_unfinished_run_is_not_overwritten(street_scans: list[Array], tmp_path: Path) -> None:
    with pytest.raises(CrashError):
        live(street_scans, tmp_path, crash_at=4)
    with pytest.raises(InputError, match=r"unfinished run of 4 scans; continue it with resume=True"):
        live(street_scans, tmp_path)
    with pytest.raises(InputError, match=r"unfinished run of 4 scans; it ended before its first snapshot"):
        live(street_scans, tmp_path, resume=True)
    assert not (tmp_path / ".lock").exists()


def test_another_sensor_cannot_continue(
    street_scans: list[Array], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journals, "SNAPSHOT_EVERY", 0.0)
    with pytest.raises(CrashError):
        live(street_scans, tmp_path, crash_at=4)
    with pytest.raises(InputError, match=r"cannot be resumed, for input.sensor was None"):
        lidarlift.Slam("hdl64", out=tmp_path, resume=True)


def test_a_folder_in_use_is_refused_and_an_empty_session_removed(tmp_path: Path) -> None:
    with lidarlift.Slam(out=tmp_path / "run"), pytest.raises(InputError, match="writes a run into this folder"):
        lidarlift.Slam(out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_resume_needs_a_folder() -> None:
    with pytest.raises(ValueError, match="give both"):
        lidarlift.Slam(resume=True)


FEED = """
import sys, time, numpy, lidarlift
slam = lidarlift.Slam(out=sys.argv[2])
for number, scan in enumerate(numpy.load(sys.argv[1])):
    slam.add(scan, 0.1 * number)
print("fed", flush=True)
time.sleep(600)
"""


def test_a_killed_program_leaves_all_scans(street_scans: list[Array], tmp_path: Path) -> None:
    """SIGKILL, and no `with`."""
    np.save(tmp_path / "scans.npy", np.array(street_scans))
    arguments = [sys.executable, "-c", FEED, str(tmp_path / "scans.npy"), str(tmp_path / "run")]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "fed\n"
        time.sleep(1.0)  # what the documentation promises
        os.kill(program.pid, signal.SIGKILL)
    path = session_of(tmp_path / "run")
    assert path is not None
    found = recovered(path)
    assert len(found.poses) == len(street_scans)
    assert len(found.map()) > 1000
