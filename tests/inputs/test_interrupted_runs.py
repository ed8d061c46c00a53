"""Inputs that caused errors in similar tools or earlier versions: interrupted runs and output.

Each case states the result of earlier versions and the result now, which `play` checks.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slam.data.dataset import open_dataset
from slam.data.point_files import read_points
from slam.data.pose_files import read_poses
from tests.inputs.bench import (
    Bench,
    Case,
)

STOPPED = """
import signal, sys, time
from lidarlift.cli import main
from slam.tracking import Tracker

track = Tracker.__call__

def slow(self, frame):
    if frame.index == 4:
        print("there", flush=True)
        time.sleep(600)
    return track(self, frame)

Tracker.__call__ = slow
signal.signal(signal.SIGINT, signal.default_int_handler)  # shells have what they start in the background ignore it
main()
"""


def stopped_by_an_exception(bench: Bench) -> None:
    path = bench.street()
    data = open_dataset(path)

    class Broken:
        def __getattr__(self, name: str) -> Any:
            return getattr(data, name)

        def __len__(self) -> int:
            return len(data)

        def __getitem__(self, position: int) -> Any:
            if position == 5:
                raise MemoryError("a header that lies")
            return data[position]

    import lidarlift

    lidarlift.run(data, frames=slice(2), out=bench.folder / "earlier")
    before = (bench.folder / "earlier" / "trajectory_tum.txt").read_bytes()
    for name, kept in (("r", "r"), ("earlier", "earlier-stopped")):
        with pytest.raises(MemoryError):
            lidarlift.run(Broken(), out=bench.folder / name)
        assert len(read_poses(bench.folder / kept / "odometry_tum.txt")[1]) == 5
        assert len(read_poses(bench.folder / kept / "ground_truth_tum.txt")[1]) == 5
        assert not (bench.folder / kept / "run.json").exists()
    assert (bench.folder / "earlier" / "trajectory_tum.txt").read_bytes() == before


def stopped_by_hand(bench: Bench) -> None:
    folder = bench.folder / "r"
    command = [sys.executable, "-c", STOPPED, "run", str(bench.street()), "--out", str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "there\n"
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=60)
        finally:
            process.kill()
    assert process.returncode == 130
    assert "Traceback" not in err
    assert "stopped after 4 frames" in err
    assert len(read_poses(folder / "odometry_tum.txt")[1]) == 4


def onto_the_input(bench: Bench) -> None:
    path = bench.street()
    (bench.folder / "link").symlink_to(path)
    before = sorted(path.rglob("*"))
    for out in (path, path / "velodyne", path / "velodyne" / "more", bench.folder / "link", path / ".." / path.name):
        for command in (("run",), ("enrich", "--enricher", "ray-segment")):
            result = bench.lidarlift(*command, path, "--frames", ":1", "--out", out)
            result.refused(str(out), "choose another folder")
    bench.lidarlift("compare", path, "--frames", ":1", "--out", path).refused(str(path), "choose another folder")
    assert sorted(path.rglob("*")) == before
    own = bench.folder / "000000.bin"
    content = own.read_bytes()
    bench.lidarlift("enrich", bench.folder, "--sensor", "vlp16", "--out", bench.folder).refused("must not change")
    assert own.read_bytes() == content
    result = bench.lidarlift("enrich", path, "--enricher", "ray-segment", "--frames", ":1", "--out", path / "enriched")
    assert result.code == 0, result.err


def enriched_times(bench: Bench) -> None:
    path = bench.street()
    (path / "sensor.yaml").write_text("model: hdl64\n")  # as the sensor swept them: with times
    for suffix in ("pcd", "ply"):
        options = ("--enricher", "ray-segment", "--format", suffix, "--frames", ":1")
        assert bench.lidarlift("enrich", path, "--out", "e", *options).code == 0
        points = read_points(Path(f"e/000000.{suffix}"))
        cloud = open_dataset(path)[0].cloud
        assert cloud.time is not None
        times = points.times["time"]
        assert len(times) == len(points.xyz) > 2 * (len(cloud) // 4)
        assert times.min() == pytest.approx(cloud.time.min(), abs=0.01)
        assert times.max() == pytest.approx(cloud.time.max(), abs=0.01)


def off_the_lines(bench: Bench) -> None:
    noise = np.random.default_rng(0).normal(0, 20, (5000, 4)).astype("f4")
    path = bench.street({1: noise})
    result = bench.lidarlift("enrich", path, "--out", "e", "--frames", ":3", "--enricher", "ray-segment")
    assert result.code == 0, result.err
    assert sorted(file.name for file in Path("e").iterdir()) == ["000000.pcd", "000002.pcd"]
    assert "1 scans were empty, damaged or not on the laser lines" in result.out


def first_scan_of_few_points(bench: Bench) -> None:
    import lidarlift

    path, sizes = bench.street(), []
    whole = bench.street_scans[0]
    for first in (whole, whole[:: len(whole) // 40]):
        first.tofile(path / "velodyne" / "000000.bin")
        clouds = [cloud for _, cloud in lidarlift.enrich(path, enricher="ray-segment", frames=slice(3))]
        sizes.append(len(clouds[2]))
    assert sizes[1] == sizes[0]


CASES = [
    Case(
        "R5",
        "an exception during a run",
        "all poses were lost",
        "odometry, ground truth and timings are saved; a finished run in the folder is kept",
        stopped_by_an_exception,
    ),
    Case(
        "R5b",
        "Ctrl-C during a run",
        "all poses were lost",
        "poses are saved; the message names the folder",
        stopped_by_hand,
    ),
    Case(
        "R8",
        "output into the input folder",
        "scans overwritten, a map read as a scan",
        "refused, for any name of the folder",
        onto_the_input,
    ),
    Case("R17", "point times of enriched scans", "dropped", "written in the column time", enriched_times),
    Case(
        "R17b",
        "enrichment of a scan off the laser lines",
        "an AssertionError",
        "no file, and counted",
        off_the_lines,
    ),
    Case(
        "R18",
        "a first scan of forty points",
        "a coarse grid for all later scans",
        "no effect on the later scans",
        first_scan_of_few_points,
    ),
]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_interrupted_runs(case: Case, bench: Bench) -> None:
    case.play(bench)
