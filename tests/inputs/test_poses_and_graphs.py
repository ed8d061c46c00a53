"""Inputs that caused errors in similar tools or earlier versions: ground truth in runs, poses and pose graphs.

Each case states the result of earlier versions and the result now, which `play` checks.
"""

from __future__ import annotations

from pathlib import Path

import gtsam
import numpy as np
import pytest

from slam.data import se3
from slam.data.dataset import open_dataset
from slam.data.pose_files import kitti_text, read_poses, tum_text
from slam.graph.g2o import write_g2o
from slam.graph.pose_graph import Edge, PoseGraph
from slam.graph.solver import squared_distances
from slam.pipeline import Pipeline
from slam.run import Run
from tests.inputs.bench import (
    FINE,
    SCANS,
    T_CAMERA_LIDAR,
    Bench,
    Case,
    no_truth,
    rows,
    text,
)


def no_stamps(bench: Bench) -> None:
    (bench.folder / "times.txt").unlink()
    bench.poses(*text(rows(stamps=FINE[:SCANS])))
    no_truth("no time stamps", "no ground truth")(open_dataset(bench.folder))


def short_drive(bench: Bench, *lines: str) -> Run:
    """Run the street's scans as a folder of point files, with these lines as poses.txt."""
    folder = bench.folder / "short"
    folder.mkdir()
    for number in range(8):
        source = bench.street_scans[number]
        source.tofile(folder / f"{number:06d}.bin")
    (folder / "times.txt").write_text("".join(f"{0.1 * number}\n" for number in range(8)))
    (folder / "poses.txt").write_text("\n".join(lines) + "\n")
    return Pipeline().run(open_dataset(folder))


def odometry_tells(bench: Bench) -> None:
    stamps = 0.1 * np.arange(8)
    run = short_drive(bench, *text(rows("wxyz", stamps, bench.street_poses)))
    assert [problem.kind for problem in run.problems] == ["order of quaternions"]
    assert run.ground_truth is not None
    np.testing.assert_allclose(run.ground_truth, bench.street_poses, atol=1e-5)


def header_lies(bench: Bench) -> None:
    table = text(rows("wxyz", 0.1 * np.arange(8), bench.street_poses))
    run = short_drive(bench, "# stamp tx ty tz qx qy qz qw", *table)
    assert [problem.kind for problem in run.problems] == ["order of quaternions"]
    assert "by the odometry, its quaternions have w first" in run.problems[0].message
    assert run.ground_truth is not None
    np.testing.assert_allclose(run.ground_truth, bench.street_poses, atol=1e-5)


def nobody_tells(bench: Bench) -> None:
    """The body's x axis points up and it rotates about x: neither order agrees with the LiDAR's motion."""
    turn = se3.exp(np.array([0, -np.pi / 2, 0, 0, 0, 0])) @ se3.exp(np.array([1.0, 0, 0, 0, 0, 0]))
    run = short_drive(bench, *text(rows("xyzw", 0.1 * np.arange(8), bench.street_poses @ turn)))
    assert [problem.kind for problem in run.problems] == ["no ground truth"]
    assert "write quaternion" in run.problems[0].message
    assert run.ground_truth is None


def cameras_truth(bench: Bench) -> None:
    run = short_drive(
        bench, *text((T_CAMERA_LIDAR @ bench.street_poses @ se3.inverse(T_CAMERA_LIDAR))[:, :3].reshape(-1, 12))
    )
    assert [problem.kind for problem in run.problems] == ["no ground truth"]
    assert "as a camera does" in run.problems[0].message
    assert run.ground_truth is None


def zeros_in_a_run(bench: Bench) -> None:
    path = bench.street()
    poses = path.parent.parent / "poses" / "77.txt"
    lines = poses.read_text().splitlines()
    poses.write_text("\n".join([*lines[:3], " ".join(["0"] * 12), *lines[4:]]) + "\n")
    result = bench.lidarlift("run", path, "--frames", ":5", "--out", "r")
    assert result.code == 0, result.err
    assert len(read_poses(Path("r/ground_truth_tum.txt"))[1]) == 4
    assert "unknown pose" in result.err


def cameras_odometry(bench: Bench) -> None:
    path = bench.street()
    (bench.folder / "poses_of_camera.txt").write_text((path.parent.parent / "poses" / "77.txt").read_text())
    result = bench.lidarlift("run", path, "--odometry", bench.folder / "poses_of_camera.txt", "--out", "r")
    assert result.code == 0, result.err
    assert "converted by the calibration of KITTI's camera 0" in result.err
    np.testing.assert_allclose(read_poses(Path("r/odometry_kitti.txt"))[1], bench.street_poses, atol=1e-5)
    (path / "calib.txt").unlink()
    bench.lidarlift("run", path, "--odometry", bench.folder / "poses_of_camera.txt", "--out", "s").refused(
        "poses_of_camera.txt", "they are those of a camera", "give LiDAR poses"
    )


def truth_of_a_lidar(bench: Bench) -> None:
    path = bench.street()
    (path.parent.parent / "poses" / "77.txt").write_text(kitti_text(bench.street_poses))
    data = open_dataset(path)
    assert data.ground_truth is None
    assert "of camera 0, along z" in data.problems[-1].message


def sound_and_unsound(_: Bench) -> None:
    poses = np.array([np.eye(4), np.zeros((4, 4)), np.full((4, 4), np.nan), np.diag([1.0, 1, -1, 1])])
    lines = tum_text(np.arange(4.0), poses).splitlines()
    assert lines[0] == "0.000000000 0 0 0 0 0 0 1"
    assert [line.split()[1:] for line in lines[1:]] == [["nan"] * 7] * 3
    assert len(kitti_text(poses).splitlines()) == 4


def gtsam_reads(bench: Bench) -> None:
    rng, path = np.random.default_rng(5), bench.folder / "graph.g2o"
    poses = np.array([se3.exp(rng.normal(size=6) * [1, 1, 1, 50, 50, 5]) for _ in range(5)])
    edges = []
    for i, j in ((0, 1), (1, 2), (2, 3), (3, 4), (0, 4)):
        A, off = rng.normal(size=(6, 6)), se3.exp(0.1 * rng.normal(size=6))
        edges.append(Edge(i, j, se3.inverse(poses[i]) @ poses[j] @ off, A @ A.T + 0.1 * np.eye(6)))
    write_g2o(path, PoseGraph(poses, tuple(edges)))
    graph, values = gtsam.readG2o(str(path), is3D=True)
    assert (graph.size(), values.size()) == (5, 5)
    assert 2 * graph.error(values) == pytest.approx(squared_distances(edges, poses).sum(), rel=1e-9)


def world_frame(bench: Bench) -> None:
    """A street of houses, seen within 30 m, over 70 m, with the points in the world frame."""
    rng, parts = np.random.default_rng(0), []
    for x in np.arange(-40, 120, 10.0):
        for side in (-1, 1):
            wide, y = rng.uniform(4, 9), side * rng.uniform(8, 14)
            parts.append(np.column_stack([rng.uniform(x, x + wide, 400), np.full(400, y), rng.uniform(-1.7, 7, 400)]))
            parts.append(
                np.column_stack([np.full(200, x), y + side * rng.uniform(0, 5, 200), rng.uniform(-1.7, 7, 200)])
            )
    parts.append(np.column_stack([rng.uniform(-40, 120, 8_000), rng.uniform(-20, 20, 8_000), np.full(8_000, -1.7)]))
    world = np.concatenate(parts)
    for name in ("world", "own"):
        (bench.folder / name).mkdir()
        for number in range(24):
            here = np.array([3.0 * number, 0, 0])
            seen = world[np.linalg.norm(world - here, axis=1) < 30] - (here if name == "own" else 0)
            np.column_stack([seen, np.full(len(seen), 0.5)]).astype("f4").tofile(bench.folder / name / f"{number}.bin")
        (bench.folder / name / "times.txt").write_text("".join(f"{0.1 * number}\n" for number in range(24)))
        problems = [problem.kind for problem in Pipeline().run(open_dataset(bench.folder / name)).problems]
        assert problems == (["world frame"] if name == "world" else [])


CASES = [
    Case(
        "37",
        "scans that are already in the world frame",
        "no motion and a plausible map, without a message",
        "reported once per run",
        world_frame,
    ),
    Case(
        "41s",
        "w first, and too few poses for an estimate, in a run",
        "accepted without a message",
        "the odometry determines the order, and it is reported",
        odometry_tells,
    ),
    Case(
        "41u",
        "a header that states w last, and quaternions with w first",
        "refused",
        "the odometry contradicts the header, and it is reported",
        header_lies,
    ),
    Case(
        "41t",
        "poses of a body with other axes: neither order agrees with the odometry",
        "accepted without a message",
        "no ground truth; the key is named",
        nobody_tells,
    ),
    Case(
        "R12",
        "ground truth with stamps, scans without times.txt",
        "assigned row by row, 100 Hz poses to 10 Hz scans, without a message",
        "no ground truth, and reported",
        no_stamps,
    ),
    Case(
        "R11b",
        "a row of zeros in KITTI's odometry benchmark",
        "a traceback after the odometry",
        "the run completes; no ground truth for this scan, and reported",
        zeros_in_a_run,
    ),
    Case("R11c", "writing of invalid poses", "a traceback", "rows of NaN after their stamps", sound_and_unsound),
    Case(
        "R13",
        "--odometry with poses of camera 0",
        "a map three times too large, without a message",
        "converted by the calibration, and reported; refused without a calibration",
        cameras_odometry,
    ),
    Case(
        "R13b",
        "poses.txt with poses of a camera",
        "errors between different bodies, with a note",
        "no ground truth once the odometry shows it",
        cameras_truth,
    ),
    Case(
        "R13c",
        "the LiDAR's poses in place of KITTI's camera 0",
        "converted to wrong poses, without a message",
        "no ground truth, and reported",
        truth_of_a_lidar,
    ),
    Case("46", "graph.g2o read by GTSAM", "not tested", "the same chi-squared", gtsam_reads),
]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_poses_and_graphs(case: Case, bench: Bench) -> None:
    case.play(bench)
