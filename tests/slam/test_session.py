"""The files of a run folder."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slam.config import load_config
from slam.data import se3
from slam.data.cloud import Array, Frame, PointCloud
from slam.data.covariance_file import read_covariances
from slam.data.dataset import open_dataset
from slam.data.errors import InputError
from slam.data.point_files import read_points
from slam.data.pose_files import read_poses
from slam.odometry import OdometryStep
from slam.pipeline import Pipeline
from slam.records import STAGES
from slam.run import Run
from slam.session import read_report, save_odometry, save_run
from slam.slam import Slam

Drive = Callable[..., Path]


def run(path: Path, frames: slice = slice(None)) -> Run:
    return Pipeline(load_config()).run(open_dataset(path), frames)


def test_the_run_folder_is_complete(street_drive: Drive, street_poses: Array, tmp_path: Path) -> None:
    result = run(street_drive())
    folder = save_run(result, tmp_path / "deep" / "run")
    assert sorted(file.name for file in folder.iterdir()) == [
        "graph.g2o",
        "ground_truth_tum.txt",
        "loops.csv",
        "map.pcd",
        "map.png",
        "odometry_kitti.txt",
        "odometry_tum.txt",
        "run.json",
        "timings.csv",
        "trajectory_covariance.csv",
        "trajectory_kitti.txt",
        "trajectory_tum.txt",
    ]
    for name in ("trajectory", "odometry"):
        assert read_poses(folder / f"{name}_kitti.txt")[1] == pytest.approx(result.poses, abs=1e-8)
        stamps, poses = read_poses(folder / f"{name}_tum.txt")
        assert stamps == pytest.approx(result.stamps)
        assert poses == pytest.approx(result.poses, abs=1e-8)
    assert read_poses(folder / "ground_truth_tum.txt")[1] == pytest.approx(street_poses, abs=1e-8)
    assert len(read_points(folder / "map.pcd").xyz) == len(result.map)


def test_the_covariance_of_every_pose_is_written(street_drive: Drive, tmp_path: Path) -> None:
    result = run(street_drive({5: b""}), slice(2, 8))
    folder = save_run(result, tmp_path / "run")
    lines = (folder / "trajectory_covariance.csv").read_text().splitlines()
    assert lines[0].startswith("frame,stamp_s,roll_roll,roll_pitch,roll_yaw,roll_x,")
    assert [line.split(",")[0] for line in lines[1:]] == ["2", "3", "4", "5", "6", "7"]
    stamps, covariances = read_covariances(folder / "trajectory_covariance.csv")
    assert stamps == pytest.approx(result.stamps)
    assert (covariances[0] == 0).all()
    sigma = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    assert 1.9 < sigma[3, 3] < 2.1  # frame 5, whose scan is empty, is a prediction
    assert (sigma[[1, 2, 4, 5], 3] < 0.02).all()  # before and after, scans meet the map
    assert "the LiDAR's axes" in read_report(folder)["protocol"]["covariances"]


def test_run_json_has_the_protocol(street_drive: Drive, tmp_path: Path) -> None:
    path = street_drive({5: b""})
    result = run(path, slice(2, 8))
    report = read_report(save_run(result, tmp_path / "run"))
    protocol = report["protocol"]
    assert protocol["dataset"] == "kitti 77"
    assert Path(protocol["path"]) == path
    assert protocol["sensor"] == "hdl64"
    assert protocol["frames"] == [2, 8, 1]
    assert protocol["input"] == "64"
    assert protocol["deskew"] is False
    assert protocol["vertical_correction_deg"] == 0
    assert protocol["versions"]["numpy"] == np.__version__
    assert len({"open3d", "open3d-cpu"} & protocol["versions"].keys()) == 1
    assert protocol["config"] == load_config().model_dump(mode="json")
    statuses = {"registered": 5, "retried": 0, "degenerate": 0, "failed": 1}
    assert report["counts"] == {"frames": 6, **statuses, "empty_scan": 1}
    assert report["notes"] == []
    assert "000005.bin" in report["problems"][0]
    assert report["timings_ms"].keys() == {*STAGES, "map", "loops", "back_end"}
    for stage in report["timings_ms"].values():
        assert 0 <= stage["median"] <= stage["p95"]
    assert report["path_length_m"] == pytest.approx(7.0, abs=0.1)
    assert report["map_points"] == len(result.map)
    assert report["peak_memory_mb"] > 10
    assert np.array(report["T_camera0_lidar"]).shape == (4, 4)


def test_timings_have_a_row_per_frame(street_drive: Drive, tmp_path: Path) -> None:
    folder = save_run(run(street_drive(), slice(1, 5)), tmp_path / "run")
    with (folder / "timings.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["frame"] for row in rows] == ["1", "2", "3", "4"]
    known = ("frame", "stamp_s", "status", "unobserved_along", "unobserved_about", "inlier_ratio", "points")
    assert rows[0].keys() == {*known, *(f"{stage}_ms" for stage in STAGES)}
    assert all(row["unobserved_along"] == row["unobserved_about"] == "" for row in rows)
    assert all(row["status"] == "registered" and int(row["points"]) > 10_000 for row in rows)
    assert all(float(row[f"{stage}_ms"]) >= 0 for row in rows for stage in STAGES)


class Tunnel:
    """Odometry with a motion of 1.4 m per scan, which is unobservable in the last three scans."""

    sizes = None

    def __init__(self) -> None:
        self._next = 0

    def predict(self, stamp: float) -> Array:
        return se3.exp(np.array([0, 0, 0, 1.4 * self._next, 0, 0]))

    def settle(self) -> tuple[OdometryStep, ...]:
        return ()

    def register(self, cloud: PointCloud, stamp: float) -> OdometryStep:
        pose, self._next = self.predict(stamp), self._next + 1
        if self._next <= 5:
            return OdometryStep(pose, 1e-6 * np.eye(6), "registered", None, cloud)
        unobserved = np.array([[0, 0, 0, -1.0, 0, 0], [0, 0, 0.6, 0, 0.8, 0]])[: 1 + (self._next == 8)]
        return OdometryStep(pose, np.eye(6), "degenerate", None, cloud, unobserved=unobserved)


def test_degenerate_frames_are_reported(street_scans: list[Array], tmp_path: Path) -> None:
    with Slam(odometry=Tunnel()) as slam:
        for number, scan in enumerate(street_scans):
            record = slam.add(Frame(number, 0.1 * number, PointCloud(scan[:, :3], scan[:, 3])))
        result = slam.finish()
    assert record.status == "degenerate"
    assert record.unobserved.shape == (2, 6)
    folder = save_run(result, tmp_path / "run")
    with (folder / "timings.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["status"] for row in rows] == ["registered"] * 5 + ["degenerate"] * 3
    told = [(row["unobserved_along"], row["unobserved_about"]) for row in rows]
    assert told[4:] == [
        ("", ""),
        ("1.000 0.000 0.000", ""),
        ("1.000 0.000 0.000", ""),
        ("1.000 0.000 0.000; 0.000 1.000 0.000", "0.000 0.000 1.000"),
    ]
    report = read_report(folder)
    assert report["counts"] == {"frames": 8, "registered": 5, "retried": 0, "degenerate": 3, "failed": 0}
    assert report["notes"] == result.notes()
    (note,) = result.notes()
    assert note == (
        "3 of 8 frames degenerate: the scan did not constrain the pose along the direction of travel in 3, "
        "about z (heading) in 1, along y (sideways) in 1; the prediction was kept there"
    )


def test_ground_truth_of_some_frames(street_drive: Drive, tmp_path: Path) -> None:
    path = street_drive()
    poses = path.parent.parent / "poses" / "77.txt"
    poses.write_text("".join(poses.read_text().splitlines(keepends=True)[:5]))
    result = run(path)
    assert result.counts()["poses_shorter_than_scans"] == 1
    stamps, truth = read_poses(save_run(result, tmp_path / "run") / "ground_truth_tum.txt")
    assert len(truth) == 5
    assert stamps == pytest.approx(0.1 * np.arange(5))


def test_the_ground_truth_of_an_earlier_run_is_removed(street_drive: Drive, tmp_path: Path) -> None:
    path, folder = street_drive(), tmp_path / "run"
    save_run(run(path, slice(3)), folder)
    (folder / "metrics.json").write_text("{}")
    (path.parent.parent / "poses" / "77.txt").unlink()
    save_run(run(path, slice(3)), folder)
    assert not (folder / "ground_truth_tum.txt").exists()
    assert not (folder / "metrics.json").exists()


def test_run_json_is_strict_json_even_if_all_frames_failed(street_drive: Drive, tmp_path: Path) -> None:
    def refuse(name: str) -> None:
        raise AssertionError(name)

    folder = save_run(run(street_drive(dict.fromkeys(range(8), b""))), tmp_path / "run")
    report = json.loads((folder / "run.json").read_text(), parse_constant=refuse)
    assert report["map_points"] == 0
    assert report["counts"]["failed"] == 8


def test_saving_the_odometry_removes_later_results(street_drive: Drive, tmp_path: Path) -> None:
    """The folder has files of one run only: an earlier map and report are removed when new poses are written."""
    result, folder = run(street_drive(), slice(3)), tmp_path / "run"
    save_run(result, folder)
    (folder / "metrics.json").write_text("{}")
    save_odometry(result, folder)
    assert sorted(file.name for file in folder.iterdir()) == [
        "ground_truth_tum.txt",
        "odometry_kitti.txt",
        "odometry_tum.txt",
        "timings.csv",
    ]
    assert read_poses(folder / "odometry_tum.txt")[1] == pytest.approx(result.odometry_poses, abs=1e-8)


def test_the_map_of_an_earlier_run_is_removed(street_drive: Drive, tmp_path: Path) -> None:
    path, folder = street_drive(), tmp_path / "run"
    save_run(run(path, slice(1)), folder)
    for scan in (path / "velodyne").iterdir():
        scan.write_bytes(b"")
    save_run(run(path, slice(1)), folder)
    assert not (folder / "map.pcd").exists()


def test_a_folder_that_cannot_be_written_is_an_error(street_drive: Drive, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("mine")
    with pytest.raises(InputError, match="cannot be written"):
        save_run(run(street_drive(), slice(1)), tmp_path / "taken")
    assert (tmp_path / "taken").read_text() == "mine"


@pytest.mark.parametrize("content", [None, "{", "\xff"])
def test_a_folder_without_a_run_is_an_error(tmp_path: Path, content: str | None) -> None:
    if content is not None:
        (tmp_path / "run.json").write_text(content, encoding="latin-1")
    with pytest.raises(InputError, match="give a folder written by `lidarlift run`"):
        read_report(tmp_path)
