"""The command as its users meet it: files, figures, exit codes, and one line for what is wrong."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from slam.cli import main
from slam.data.cloud import Array
from slam.data.point_files import read_points
from slam.data.pose_files import read_poses
from slam.session import read_report

Drive = Callable[..., Path]


class Result(NamedTuple):
    code: int
    out: str
    err: str


Command = Callable[..., Result]


@pytest.fixture
def lidarlift(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path) -> Command:
    """`lidarlift("run", path)`: the command in this process, for each start takes seconds. Exceptions are bugs."""
    monkeypatch.chdir(tmp_path)

    def command(*arguments: object) -> Result:
        monkeypatch.setattr(sys, "argv", ["lidarlift", *map(str, arguments)])
        capfd.readouterr()
        code = 0
        try:
            main()
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 1
        out, err = capfd.readouterr()
        assert "Traceback" not in out + err
        return Result(code, out, err)

    return command


def refused(result: Result, *words: str) -> None:
    """Exit code 1 and one line on stderr with the words."""
    assert result.code == 1
    assert result.err.startswith("Error: ")
    assert result.err.count("\n") == 1
    for word in words:
        assert word in result.err


def ate(text: str) -> float:
    """The aligned ATE's rmse in a printed table."""
    found = re.search(r"ATE, SE\(3\) Umeyama-aligned +\S+ +\d+ +m +(\S+)", text)
    assert found, text
    return float(found[1])


# ---- run


def test_run_writes_the_whole_folder(lidarlift: Command, street_drive: Drive, street_poses: Array) -> None:
    result = lidarlift("run", street_drive(), "--out", "here/run")
    assert result.code == 0, result.err
    folder = Path("here/run")
    report = read_report(folder)
    assert report["protocol"]["input"] == "64"
    assert report["counts"] == {"frames": 8, "registered": 8, "retried": 0, "failed": 0}
    for stage in ("load", "front_end", "odometry", "map"):
        assert report["timings_ms"][stage].keys() == {"median", "p95"}
    for name in ("trajectory", "odometry"):
        poses = read_poses(folder / f"{name}_kitti.txt")[1]
        np.testing.assert_array_equal(poses[0], np.eye(4))
        assert poses == pytest.approx(street_poses, abs=0.05)
        assert read_poses(folder / f"{name}_tum.txt")[1] == pytest.approx(poses, abs=1e-8)
    metrics = json.loads((folder / "metrics.json").read_text())
    for name in ("slam", "odometry"):
        assert metrics[name]["ate"]["aligned"]["rmse"] < 0.05
        assert "drift" in metrics[name]
    with (folder / "timings.csv").open() as file:
        assert len(list(csv.DictReader(file))) == 8
    assert len(read_points(folder / "map.pcd").xyz) == report["map_points"] > 10_000
    assert (folder / "trajectory.png").read_bytes().startswith(b"\x89PNG")
    assert not [file.name for file in folder.iterdir() if file.name.startswith(".")]
    assert ate(result.out) == pytest.approx(metrics["odometry"]["ate"]["aligned"]["rmse"], abs=5.1e-4)
    assert "8 frames" in result.out
    assert "here/run" in result.out


def test_frames_and_input(lidarlift: Command, street_drive: Drive) -> None:
    """Without --out the folder is named by the drive and the channels."""
    result = lidarlift("run", street_drive(), "--frames", "2:6", "--input", "16")
    assert result.code == 0, result.err
    folder = Path("runs/kitti-odometry-77-16")
    report = read_report(folder)
    assert report["protocol"]["frames"] == [2, 6, 1]
    assert report["protocol"]["input"] == "16"
    assert report["protocol"]["config"]["odometry"]["voxel_size"] == 0.5  # of the preset for 16
    poses = read_poses(folder / "trajectory_kitti.txt")[1]
    assert len(poses) == 4
    np.testing.assert_array_equal(poses[0], np.eye(4))


@pytest.mark.parametrize("frames", ["5", "a-b:", "1:2:3:4", "::0", "::-1"])
def test_frames_that_are_no_slice(lidarlift: Command, street_drive: Drive, frames: str) -> None:
    refused(lidarlift("run", street_drive(), "--frames", frames), f"--frames {frames}", "FROM:TO")
    assert not Path("runs").exists()


def test_frames_beyond_the_end(lidarlift: Command, street_drive: Drive) -> None:
    result = lidarlift("run", street_drive(), "--frames", "20:30")
    assert result.code == 1
    assert "Error: " in result.err
    assert "the drive has 8" in result.err
    assert not Path("runs").exists()


def test_a_single_frame(lidarlift: Command, street_drive: Drive) -> None:
    result = lidarlift("run", street_drive(), "--frames", "3:4", "--out", "one")
    assert result.code == 0, result.err
    np.testing.assert_array_equal(read_poses(Path("one/trajectory_kitti.txt"))[1], [np.eye(4)])
    assert not Path("one/metrics.json").exists()


@pytest.mark.parametrize(
    ("setting", "right"),
    [("odometry.voxelsize=1.0", "odometry.voxel_size"), ("odometri.max_range=50", "odometry"), ("map.voxel=1", "map.")],
)
def test_a_wrong_key_names_the_right_one(lidarlift: Command, street_drive: Drive, setting: str, right: str) -> None:
    key = setting.partition("=")[0]
    refused(lidarlift("run", street_drive(), "--set", setting), f"unknown setting '{key.split('.')[0]}", right)


@pytest.mark.parametrize(
    "setting",
    ["x=1", *(f"odometry.voxel_size{rest}" for rest in ("", "=", "=-1", "=wide", "=["))],
)
def test_a_wrong_value_is_one_line(lidarlift: Command, street_drive: Drive, setting: str) -> None:
    refused(lidarlift("run", street_drive(), "--set", setting))


def test_a_key_below_a_number_is_one_line(lidarlift: Command, street_drive: Drive) -> None:
    refused(lidarlift("run", street_drive(), "--set", "odometry.voxel_size.x=2"), "odometry.voxel_size")


def test_settings_reach_the_run(lidarlift: Command, street_drive: Drive) -> None:
    arguments = ("--set", "odometry.voxel_size=1.25", "--set", "map.voxel_size=0.5", "--frames", ":2", "--out", "r")
    assert lidarlift("run", street_drive(), *arguments).code == 0
    config = read_report(Path("r"))["protocol"]["config"]
    assert (config["odometry"]["voxel_size"], config["map"]["voxel_size"]) == (1.25, 0.5)


def test_an_empty_folder(lidarlift: Command, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    refused(lidarlift("run", "empty"), "no drive found; looked for KITTI odometry")


def test_no_such_folder(lidarlift: Command) -> None:
    refused(lidarlift("run", "nowhere"), "nowhere", "no such folder")


def test_a_drive_without_scans(lidarlift: Command, street_drive: Drive) -> None:
    path = street_drive()
    for scan in (path / "velodyne").iterdir():
        scan.unlink()
    refused(lidarlift("run", path), "velodyne", "no scans")


def test_without_calib_it_runs_without_truth(lidarlift: Command, street_drive: Drive) -> None:
    path = street_drive()
    (path / "calib.txt").unlink()
    result = lidarlift("run", path, "--out", "r")
    assert result.code == 0, result.err
    assert "Note: no calibration: " in result.err
    assert "No ground truth" in result.out
    assert not Path("r/metrics.json").exists()
    assert read_report(Path("r"))["counts"]["no_calibration"] == 1
    refused(lidarlift("export", "r", "out.txt", "--format", "kitti", "--frame", "camera"), "--frame lidar")


def test_poses_shorter_than_scans(lidarlift: Command, street_drive: Drive) -> None:
    path = street_drive()
    poses = path.parent.parent / "poses" / "77.txt"
    poses.write_text("".join(poses.read_text().splitlines(keepends=True)[:5]))
    result = lidarlift("run", path, "--out", "r")
    assert result.code == 0, result.err
    assert "Note: poses shorter than scans" in result.err
    metrics = json.loads(Path("r/metrics.json").read_text())
    assert metrics["odometry"]["frames"] == 5
    assert "5 of 8 frames have a reference" in result.out


def test_damage_is_noted_once_a_kind(lidarlift: Command, street_drive: Drive) -> None:
    result = lidarlift("run", street_drive({3: b"", 5: b""}), "--out", "r")
    assert result.code == 0, result.err
    assert result.err.count("Note: ") == 1
    assert "000003.bin" in result.err
    assert "(and 1 more, see run.json)" in result.err
    assert "2 failed" in result.out
    assert len(read_report(Path("r"))["problems"]) == 2


def test_strict_stops_and_writes_nothing(lidarlift: Command, street_drive: Drive) -> None:
    result = lidarlift("run", street_drive({3: b""}), "--strict", "--out", "r")
    assert result.code == 1
    assert "Error: " in result.err
    assert "000003.bin" in result.err
    assert not Path("r").exists()


def test_messages_are_printed_as_they_are(lidarlift: Command) -> None:
    refused(lidarlift("run", "drives:b:4"), "drives:b:4: no such folder")


# ---- export and evaluate


@pytest.fixture
def finished(lidarlift: Command, street_drive: Drive) -> Path:
    """A sequence whose run is in ./r."""
    path = street_drive()
    assert lidarlift("run", path, "--out", "r").code == 0
    return path


def test_camera_poses_evaluate_to_the_same_ate(lidarlift: Command, finished: Path) -> None:
    """Rigidly joined bodies: a constant lever arm, so nearly the same figure; with --calib the same body, the same."""
    truth = finished.parent.parent / "poses" / "77.txt"
    expected = json.loads(Path("r/metrics.json").read_text())["slam"]["ate"]["aligned"]["rmse"]
    assert lidarlift("export", "r", "camera.txt", "--format", "kitti", "--frame", "camera").code == 0
    exported = read_poses(Path("camera.txt"))[1]
    assert exported == pytest.approx(read_poses(truth)[1], abs=0.05)
    np.testing.assert_allclose(exported[0], np.eye(4), atol=1e-9)
    result = lidarlift("evaluate", "camera.txt", truth)
    assert result.code == 0, result.err
    assert ate(result.out) == pytest.approx(expected, abs=1.5e-3)
    result = lidarlift("evaluate", "r/trajectory_kitti.txt", truth, "--calib", finished / "calib.txt")
    assert result.code == 0, result.err
    assert ate(result.out) == pytest.approx(expected, abs=5.1e-4)


def test_lidar_against_camera_is_refused(lidarlift: Command, finished: Path) -> None:
    truth = finished.parent.parent / "poses" / "77.txt"
    refused(lidarlift("evaluate", "r/trajectory_kitti.txt", truth), "--calib")
    refused(lidarlift("evaluate", "r/trajectory_kitti.txt", truth, "--calib", "nowhere.txt"), "nowhere.txt")


@pytest.mark.usefixtures("finished")
@pytest.mark.parametrize("kind", ["kitti", "tum"])
def test_trajectories_are_exported(lidarlift: Command, kind: str) -> None:
    assert lidarlift("export", "r", "new/out.txt", "--format", kind).code == 0
    stamps, poses = read_poses(Path("new/out.txt"))
    assert poses == pytest.approx(read_poses(Path("r/trajectory_tum.txt"))[1], abs=1e-8)
    assert (stamps is None) == (kind == "kitti")


@pytest.mark.usefixtures("finished")
def test_maps_are_exported(lidarlift: Command) -> None:
    """By the suffix; camera 0 has z ahead where the LiDAR has x."""
    assert lidarlift("export", "r", "map.ply").code == 0
    assert lidarlift("export", "r", "camera.pcd", "--frame", "camera").code == 0
    own, ply, camera = (read_points(Path(name)) for name in ("r/map.pcd", "map.ply", "camera.pcd"))
    np.testing.assert_array_equal(ply.xyz, own.xyz)
    np.testing.assert_array_equal(ply.intensity, own.intensity)
    x, y, z = own.xyz.T
    assert camera.xyz == pytest.approx(np.column_stack([-y + 0.1, -z + 0.2, x + 0.3]), abs=1e-4)


@pytest.mark.usefixtures("finished")
def test_export_asks_what_to_write(lidarlift: Command) -> None:
    refused(lidarlift("export", "r", "out.txt"), "--format kitti, tum, pcd or ply")


@pytest.mark.parametrize(
    "arguments", [("o.txt", "--format", "kitti"), ("o.ply",), ("o.txt", "--format", "tum", "--frame", "camera")]
)
def test_export_of_what_is_no_run(lidarlift: Command, tmp_path: Path, arguments: tuple[str, ...]) -> None:
    (tmp_path / "empty").mkdir()
    refused(lidarlift("export", "empty", *arguments), "empty")
    assert not Path(arguments[0]).exists()


@pytest.mark.parametrize("content", ["{}", "3"])
def test_a_run_json_of_something_else(lidarlift: Command, tmp_path: Path, content: str) -> None:
    (tmp_path / "trajectory_tum.txt").write_text("0 0 0 0 0 0 0 1\n")
    (tmp_path / "run.json").write_text(content)
    refused(lidarlift("export", tmp_path, "o.txt", "--format", "kitti", "--frame", "camera"), "run.json")


@pytest.mark.parametrize(
    "arguments",
    [("walk",), ("run",), ("run", "x", "--input", "32"), ("run", "x", "--no-such"), ("export", "r"), ("evaluate", "a")],
)
def test_usage_errors_exit_with_2(lidarlift: Command, arguments: tuple[str, ...]) -> None:
    result = lidarlift(*arguments)
    assert result.code == 2
    assert "Usage" in result.err


@pytest.mark.parametrize("command", [(), ("run",), ("evaluate",), ("export",)])
def test_help_has_an_example(lidarlift: Command, command: tuple[str, ...]) -> None:
    result = lidarlift(*command, "--help")
    assert result.code == 0
    assert "lidarlift" in result.out
    assert "Example" in result.out


def test_the_installed_command(street_drive: Drive, tmp_path: Path) -> None:
    """In a process of its own: no traceback and no warnings on stderr, colours and bars only on terminals."""
    command = [sys.executable, "-m", "slam.cli", "run", str(street_drive({3: b""})), "--out", str(tmp_path / "r")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert "Warning" not in done.stderr
    assert "\x1b" not in done.stdout + done.stderr
    assert "Note: empty scan" in done.stderr
    assert (tmp_path / "r" / "run.json").exists()
