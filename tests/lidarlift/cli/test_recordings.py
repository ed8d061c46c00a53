"""`lidarlift run` on a recording."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.data.recordings.writer import recording_writer
from slam.session import read_report

Command = Callable[..., Any]
FIELDS = np.dtype([(name, "<f4") for name in ("x", "y", "z", "intensity")])


@pytest.fixture
def recording(tmp_path: Path, street_poses: Array, street_scans: list[Array]) -> Path:
    """The street drive, ten scans a second from the fifth second on, its true poses and another robot's odometry."""
    with recording_writer(tmp_path / "street", "mcap") as writer:
        for number, (pose, scan) in enumerate(zip(street_poses, street_scans, strict=True)):
            time = 5 * 10**9 + number * 10**8
            points = np.ascontiguousarray(scan, np.float32).view(FIELDS)[:, 0]
            writer.write("/points", time, writer.cloud(time, "lidar", points))
            writer.write("/gt/odom", time, writer.odometry(time, "map", "lidar", pose))
    return tmp_path / "street.mcap"


def test_it_says_which_topics_it_used(lidarlift: Command, recording: Path) -> None:
    done = lidarlift("run", recording, "--sensor", "hdl64", "--out", "r")
    assert done.code == 0
    assert "topics: points /points, truth /gt/odom" in done.out
    assert done.ate < 0.1
    protocol = read_report(Path("r"))["protocol"]
    assert protocol["topics"] == {"points": "/points", "truth": "/gt/odom"}
    assert protocol["stamps"] == "/points, headers"
    assert protocol["dataset"] == "street"


def test_a_part_of_it(lidarlift: Command, recording: Path) -> None:
    assert lidarlift("run", recording, "--start", "0.25s", "--duration", "0.3s", "--out", "r").code == 0
    stamps = np.loadtxt("r/trajectory_tum.txt")[:, 0]
    np.testing.assert_allclose(stamps, [5.3, 5.4, 5.5])


def test_every_command_that_opens_a_recording_takes_its_options(lidarlift: Command, recording: Path) -> None:
    commands = (
        ("run",),
        ("compare",),
        ("info",),
        ("enrich", "--out", "e"),
        ("study", "sparsity"),
        ("study", "edges"),
        ("depth-benchmark",),
        ("fit-lasers",),
    )
    for command in commands:
        lidarlift(*command, recording, "--topic", "/point").refused("--topic /point: no such topic")
        lidarlift(*command, recording, "--start", "3h").refused("no scans there")
        lidarlift(*command, recording, "--stamp", "middle", "--truth-topic", "/no").refused("--truth-topic /no")


def test_a_part_is_inspected_and_enriched(lidarlift: Command, recording: Path) -> None:
    part = ("--start", "0.25s", "--duration", "0.3s", "--sensor", "hdl64")
    done = lidarlift("info", recording, *part)
    assert "3, numbers 3 to 5" in done.out
    assert "--sensor hdl64 --start 0.25 --duration 0.3" in " ".join(done.out.split())
    assert lidarlift("enrich", recording, *part, "--enricher", "ray-segment", "--out", "e").code == 0
    assert sorted(file.name for file in Path("e").iterdir()) == [f"{number:06d}.pcd" for number in (3, 4, 5)]


def test_the_truth_of_a_recording_is_a_reference(lidarlift: Command, recording: Path) -> None:
    assert lidarlift("run", recording, "--sensor", "hdl64", "--out", "r").code == 0
    expected = json.loads(Path("r/metrics.json").read_text())["slam"]["ate"]["aligned"]["rmse"]
    done = lidarlift("evaluate", "r/trajectory_tum.txt", recording, "--truth-topic", "/gt/odom")
    assert done.ate == pytest.approx(expected, abs=5.1e-4)
    lidarlift("evaluate", "r/trajectory_tum.txt", recording, "--truth-topic", "/gt").refused("--truth-topic /gt")
    refused = lidarlift("evaluate", "r/trajectory_tum.txt", "r/ground_truth_tum.txt", "--truth-topic", "/gt")
    refused.refused("--truth-topic is for a data set as reference; leave it out")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--start", "later"), ("--start later: write a time, as in 120s, 2m or 1.5h",)),
        (("--start", "3h"), ("no scans there", "0.7 s after its start")),
        (("--topic", "/point"), ("--topic /point: no such topic; did you mean '/points'?",)),
        (("--image-topic", "/points"), ("--image-topic /points: holds sensor_msgs/msg/PointCloud2, not images",)),
        (("--truth-topic", "nothing"), ("--truth-topic nothing: no such topic",)),
    ],
)
def test_what_is_not_there_is_one_line(
    lidarlift: Command, recording: Path, options: tuple[str, ...], words: tuple[str, ...]
) -> None:
    lidarlift("run", recording, *options).refused(*words)


def test_gnss_is_a_ground_truth_of_positions(
    lidarlift: Command, tmp_path: Path, street_poses: Array, street_scans: list[Array]
) -> None:
    """Rotation, RPE and drift are not compared, and that is said; the world of the fixes is turned."""
    with recording_writer(tmp_path / "street", "mcap") as writer:
        for number, (pose, scan) in enumerate(zip(street_poses, street_scans, strict=True)):
            time = 5 * 10**9 + number * 10**8
            points = np.ascontiguousarray(scan, np.float32).view(FIELDS)[:, 0]
            writer.write("/points", time, writer.cloud(time, "lidar", points))
            fix = writer.make(
                "sensor_msgs/msg/NavSatFix",
                header=writer.header(time, "gps"),
                status=writer.make("sensor_msgs/msg/NavSatStatus", status=0, service=1),
                latitude=float(np.rad2deg(pose[0, 3] / 6335439.0)),  # the radius of the meridian at the equator
                longitude=float(np.rad2deg(-pose[1, 3] / 6378137.0)),
                altitude=float(pose[2, 3]),
                position_covariance=np.zeros(9),
                position_covariance_type=0,
            )
            writer.write("/fix", time, fix)
    done = lidarlift("run", tmp_path / "street.mcap", "--sensor", "hdl64", "--out", "r")
    assert done.code == 0, done.err
    assert "topics: points /points, truth /fix" in done.out
    assert "positions only" in done.out
    metrics = json.loads(Path("r/metrics.json").read_text())["slam"]
    assert metrics["ate"]["aligned"]["rmse"] < 0.1
    assert metrics["ate"]["origin"]["rmse"] is metrics["rpe"]["frame_rotation"]["rmse"] is None
    assert metrics["drift"]["translation_percent"] is None
    assert any("rotation is not compared" in text for text in read_report(Path("r"))["problems"])
    assert "positions only (rotation is not compared)" in " ".join(
        lidarlift("info", tmp_path / "street.mcap").out.split()
    )
    assert lidarlift("compare", "r", "KISS=r/odometry_tum.txt", "--out", "c").code == 0
