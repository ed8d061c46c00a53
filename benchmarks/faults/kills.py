"""Kills at random moments: every run that is resumed must end with the bytes of one that was not killed."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.faults.process import digests, run
from slam.journal.journal import has_snapshot
from slam.session import UNFINISHED

KILLS_PER_RUN = 12  # on average, until a run is finished
MOST_KILLS = 20  # of a run: on a busy machine its end may take longer than any moment of a kill
FINALS_PER_RUN = 4


def campaign(drive: Path, folder: Path, kills: int, final: int, seed: int = 0) -> dict[str, Any]:
    """Kill runs over a drive.

    Args:
        drive: The data set.
        folder: An empty folder.
        kills: Number of kills at random moments of whole runs.
        final: Number of kills after the last frame, while loops are selected and the map is built.
        seed: Seed of the moments.

    Returns:
        Number of kills by place, number of runs that were finished, and of those with other bytes.
    """
    rng = np.random.default_rng(seed)
    whole = run(drive, folder / "whole")
    assert whole.how == "done", whole.message
    expected = digests(folder / "whole")
    places: dict[str, int] = {}
    faults: list[str] = []
    finished = 0
    while sum(places.values()) < kills:
        out = folder / f"run-{finished}"
        for _ in range(MOST_KILLS):
            ending = run(drive, out, kill_after=_moment(rng, whole.seconds), resume=True)
            if ending.how != "killed":
                break
            place = _place(out)
            places[place] = places.get(place, 0) + 1
            if place == LAST and not (folder / "last").exists():
                shutil.copytree(out, folder / "last")
        else:
            ending = run(drive, out, resume=True)
        faults += _faults(out, expected, ending.how, ending.message)
        finished += 1
        shutil.rmtree(out)
    ends = _final_kills(drive, folder, final, expected, rng, faults)
    return {
        "frames": _frames(folder / "whole"),
        "seconds_of_a_run": round(whole.seconds, 1),
        "kills": {**places, LAST: places.get(LAST, 0) + final},
        "runs": finished + ends,
        "faults": faults,
    }


LAST = "selection of loops, map and files"


def _final_kills(
    drive: Path, folder: Path, kills: int, expected: Mapping[str, str], rng: np.random.Generator, faults: list[str]
) -> int:
    """Kill runs that begin at their last snapshot, after the odometry; return the number of runs."""
    if not (folder / "last").exists():
        shutil.copytree(folder / "whole", folder / "last")  # a finished run begins there too
    out, done, runs = folder / "final", 0, 0
    shutil.copytree(folder / "last", out)
    seconds = run(drive, out, resume=True).seconds
    while done < kills:
        shutil.rmtree(out)
        shutil.copytree(folder / "last", out)
        for _ in range(FINALS_PER_RUN):
            done += run(drive, out, kill_after=rng.uniform(0, seconds), resume=True).how == "killed"
        ending = run(drive, out, resume=True)
        faults += _faults(out, expected, ending.how, ending.message)
        runs += 1
    return runs


def _moment(rng: np.random.Generator, seconds: float) -> float:
    """Seconds until a kill: between at once and a sixth of a whole run."""
    return float(rng.uniform(0, 2 * seconds / KILLS_PER_RUN))


def _place(out: Path) -> str:
    """Where a run was killed, by its files."""
    if (out / "run.json").is_file():
        return "evaluation"
    if (out / "odometry_tum.txt").is_file():
        return LAST
    return "registration" if has_snapshot(out / UNFINISHED) else "before the first snapshot"


def _faults(out: Path, expected: Mapping[str, str], how: str, message: str) -> list[str]:
    """What is wrong with a run that was resumed; nothing if it is done and has the expected bytes."""
    if how != "done":
        return [f"{how}: {message}"]
    found = digests(out)
    return [f"other bytes: {name}" for name in expected if found[name] != expected[name]]


def _frames(folder: Path) -> int:
    return len((folder / "odometry_tum.txt").read_text(encoding="utf-8").splitlines())
