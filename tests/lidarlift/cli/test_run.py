"""`lidarlift run`: files, figures, and errors of one line."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import pytest

from lidarlift.folders import default_folder
from slam.data.cloud import Array, PointCloud
from slam.data.dataset import Dataset
from slam.data.errors import InputError
from slam.data.point_files import read_points
from slam.data.pose_files import read_poses
from slam.graph.back_end import BackEnd
from slam.odometry import Odometry, OdometryStep
from slam.session import read_report

ODOMETRY = [
    "ground_truth_tum.txt",
    "odometry_kitti.txt",
    "odometry_tum.txt",
    "timings.csv",
    "unfinished",
]  # written before loops
STUCK = """
import signal, sys, time
from lidarlift.cli import main
from slam.graph.back_end import BackEnd

def settle(self):
    print("optimising", flush=True)
    time.sleep(600)

BackEnd.settle = settle
signal.signal(signal.SIGINT, signal.default_int_handler)  # shells ignore it for background processes
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # nohup ignores it
main()
"""

Drive = Callable[..., Path]
Command = Callable[..., Any]


def test_run_writes_the_run_folder(lidarlift: Command, street_drive: Drive, street_poses: Array) -> None:
    result = lidarlift("run", street_drive(), "--out", "here/run")
    assert result.code == 0, result.err
    folder = Path("here/run")
    report = read_report(folder)
    assert report["protocol"]["input"] == "64"
    assert report["counts"] == {"frames": 8, "registered": 8, "retried": 0, "degenerate": 0, "failed": 0}
    for stage in ("load", "front_end", "odometry", "map"):
        assert report["timings_ms"][stage].keys() == {"median", "p95"}
    for name in ("trajectory", "odometry"):
        poses = read_poses(folder / f"{name}_kitti.txt")[1]
        np.testing.assert_allclose(poses[0], np.eye(4), atol=1e-9)
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
    assert result.ate == pytest.approx(metrics["odometry"]["ate"]["aligned"]["rmse"], abs=5.1e-4)
    assert "8 frames" in result.out
    assert "here/run" in result.out


def test_frames_and_input(lidarlift: Command, street_drive: Drive) -> None:
    """Without --out the folder is named by the sequence and the input."""
    result = lidarlift("run", street_drive(), "--frames", "2:6", "--input", "16")
    assert result.code == 0, result.err
    folder = Path("runs/kitti-77-16")
    report = read_report(folder)
    assert report["protocol"]["frames"] == [2, 6, 1]
    assert report["protocol"]["input"] == "16"
    poses = read_poses(folder / "trajectory_kitti.txt")[1]
    assert len(poses) == 4
    np.testing.assert_array_equal(poses[0], np.eye(4))


@pytest.mark.parametrize("frames", ["5", "a-b:", "1:2:3:4", "::0", "::-1"])
def test_invalid_frames_are_an_error(lidarlift: Command, street_drive: Drive, frames: str) -> None:
    lidarlift("run", street_drive(), "--frames", frames).refused(f"--frames {frames}", "FROM:TO")
    assert not Path("runs").exists()


def test_frames_beyond_the_end_are_an_error(lidarlift: Command, street_drive: Drive) -> None:
    result = lidarlift("run", street_drive(), "--frames", "20:30")
    assert result.code == 1
    assert "Error: " in result.err
    assert "the sequence has 8" in result.err
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
def test_an_unknown_key_names_the_most_similar_one(
    lidarlift: Command, street_drive: Drive, setting: str, right: str
) -> None:
    key = setting.partition("=")[0]
    lidarlift("run", street_drive(), "--set", setting).refused(f"unknown setting '{key.split('.')[0]}", right)


@pytest.mark.parametrize(
    "setting",
    ["x=1", *(f"odometry.voxel_size{rest}" for rest in ("", "=", "=-1", "=wide", "=["))],
)
def test_an_invalid_value_is_an_error_of_one_line(lidarlift: Command, street_drive: Drive, setting: str) -> None:
    lidarlift("run", street_drive(), "--set", setting).refused()


def test_a_key_below_a_number_is_an_error_of_one_line(lidarlift: Command, street_drive: Drive) -> None:
    lidarlift("run", street_drive(), "--set", "odometry.voxel_size.x=2").refused("odometry.voxel_size")


def test_settings_are_applied(lidarlift: Command, street_drive: Drive) -> None:
    arguments = ("--set", "odometry.voxel_size=1.25", "--set", "map.voxel_size=0.5", "--frames", ":2", "--out", "r")
    assert lidarlift("run", street_drive(), *arguments).code == 0
    config = read_report(Path("r"))["protocol"]["config"]
    assert (config["odometry"]["voxel_size"], config["map"]["voxel_size"]) == (1.25, 0.5)


def test_an_empty_folder_is_an_error(lidarlift: Command, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    lidarlift("run", "empty").refused("no sequence found; looked for KITTI odometry")


def test_a_missing_folder_is_an_error(lidarlift: Command) -> None:
    lidarlift("run", "nowhere").refused("nowhere", "no such folder")


def test_a_sequence_without_scans_is_an_error(lidarlift: Command, street_drive: Drive) -> None:
    path = street_drive()
    for scan in (path / "velodyne").iterdir():
        scan.unlink()
    lidarlift("run", path).refused("velodyne", "no scans")


def test_without_calibration_there_is_no_ground_truth(lidarlift: Command, street_drive: Drive) -> None:
    path = street_drive()
    (path / "calib.txt").unlink()
    result = lidarlift("run", path, "--out", "r")
    assert result.code == 0, result.err
    assert "Note: no calibration: " in result.err
    assert "No ground truth" in result.out
    assert not Path("r/metrics.json").exists()
    assert read_report(Path("r"))["counts"]["no_calibration"] == 1
    lidarlift("export", "r", "out.txt", "--format", "kitti", "--frame", "camera").refused("--frame lidar")


def test_fewer_poses_than_scans(lidarlift: Command, street_drive: Drive) -> None:
    path = street_drive()
    poses = path.parent.parent / "poses" / "77.txt"
    poses.write_text("".join(poses.read_text().splitlines(keepends=True)[:5]))
    result = lidarlift("run", path, "--out", "r")
    assert result.code == 0, result.err
    assert "Note: poses shorter than scans" in result.err
    metrics = json.loads(Path("r/metrics.json").read_text())
    assert metrics["odometry"]["frames"] == 5
    assert "5 of 8 frames have a reference" in result.out


def test_degenerate_frames_are_reported_in_one_line(
    lidarlift: Command, street_drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    register = Odometry.register

    def in_a_tunnel(odometry: Odometry, cloud: PointCloud, stamp: float) -> OdometryStep:
        step = register(odometry, cloud, stamp)
        return replace(step, status="degenerate", unobserved=np.eye(6)[3:4]) if stamp > 0.45 else step

    monkeypatch.setattr(Odometry, "register", in_a_tunnel)
    result = lidarlift("run", street_drive(), "--out", "r")
    assert result.code == 0, result.err
    (line,) = [line for line in result.out.splitlines() if "degenerate" in line]
    assert line == (
        "3 of 8 frames degenerate: the scan did not constrain the pose along the direction of travel; "
        "the prediction was kept there"
    )


def test_damage_is_reported_once_per_kind(lidarlift: Command, street_drive: Drive) -> None:
    result = lidarlift("run", street_drive({3: b"", 5: b""}), "--out", "r")
    assert result.code == 0, result.err
    assert result.err.count("Note: ") == 1
    assert "000003.bin" in result.err
    assert "(and 1 more, see run.json)" in result.err
    assert "2 failed" in result.out
    assert len(read_report(Path("r"))["problems"]) == 2


def test_stamps_that_jump_are_reported_once_and_strict_stops(lidarlift: Command, street_drive: Drive) -> None:
    path = street_drive()
    (path / "times.txt").write_text("".join(f"{number}\n" for number in (0, 0.1, 0.2, 3, 3.1, 3.2, 9, 9.1)))
    result = lidarlift("run", path, "--out", "r")
    assert result.code == 0, result.err
    assert result.err.count("Note: ") == 1
    assert "Note: stamp jump: frame 3: " in result.err
    assert read_report(Path("r"))["counts"]["stamp_jump"] == 2
    stopped = lidarlift("run", path, "--strict", "--out", "s")
    assert stopped.code == 1
    assert "Error: frame 3: its stamp" in stopped.err


def test_strict_stops_and_writes_nothing(lidarlift: Command, street_drive: Drive) -> None:
    result = lidarlift("run", street_drive({3: b""}), "--strict", "--out", "r")
    assert result.code == 1
    assert "Error: " in result.err
    assert "000003.bin" in result.err
    assert not Path("r").exists()


def names(folder: Path) -> list[str]:
    return sorted(file.name for file in folder.iterdir())


def test_a_run_stopped_in_the_odometry_keeps_the_earlier_run(lidarlift: Command, finished: Path) -> None:
    before = {file: file.read_bytes() for file in Path("r").rglob("*") if file.is_file()}
    (finished / "velodyne" / "000005.bin").write_bytes(b"")
    assert lidarlift("run", finished, "--strict", "--out", "r").code == 1
    assert {file: file.read_bytes() for file in Path("r").rglob("*") if file.is_file()} == before


def test_a_run_stopped_in_the_optimisation_keeps_its_odometry(
    lidarlift: Command, finished: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The files of the earlier run, of other frames, are removed; the next run completes the folder."""
    folder, whole = Path("r"), names(Path("r"))

    def fails(_: BackEnd) -> None:
        raise InputError("out of luck")

    with monkeypatch.context() as patched:
        patched.setattr(BackEnd, "settle", fails)
        lidarlift("run", finished, "--frames", ":5", "--out", "r")
    assert names(folder) == ODOMETRY
    assert len(read_poses(folder / "odometry_tum.txt")[1]) == len(read_poses(folder / "odometry_kitti.txt")[1]) == 5
    with pytest.raises(InputError):
        read_report(folder)
    assert lidarlift("run", finished, "--out", "r").code == 0
    assert names(folder) == whole
    assert read_report(folder)["counts"]["frames"] == 8


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_a_process_stopped_in_the_optimisation_keeps_its_odometry(
    street_drive: Drive, tmp_path: Path, stop: signal.Signals
) -> None:
    arguments = ["run", str(street_drive()), "--frames", ":3", "--out", str(tmp_path / "r")]
    command = [sys.executable, "-c", STUCK, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "optimising\n"
            process.send_signal(stop)
            _, err = process.communicate(timeout=60)
        finally:
            process.kill()
    assert names(tmp_path / "r") == sorted([*ODOMETRY, *([".lock"] if stop is signal.SIGKILL else [])])
    assert len(read_poses(tmp_path / "r" / "odometry_tum.txt")[1]) == 3
    if stop is not signal.SIGKILL:
        assert process.returncode == 128 + stop
        assert err.splitlines()[-1].startswith("Stopped")
        assert "Traceback" not in err


def test_messages_are_printed_without_markup(lidarlift: Command) -> None:
    lidarlift("run", "drives:b:4").refused("drives:b:4: no such folder")


def test_an_enricher_requires_enriched_input(lidarlift: Command, street_drive: Drive) -> None:
    lidarlift("run", street_drive(), "--enricher", "joint", "--out", "r").refused(
        "--enricher joint", "--input enriched"
    )


def test_stamp_and_field_of_times_can_be_set_and_are_reported(
    lidarlift: Command, tmp_path: Path, street_scans: list[Array]
) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    for number, scan in enumerate(street_scans[:3]):
        fields = np.zeros(len(scan), [("x", "f4"), ("y", "f4"), ("z", "f4"), ("t", "u4"), ("dt", "f4")])
        for column, name in enumerate("xyz"):
            fields[name] = scan[:, column]
        fields["t"] = fields["dt"] = np.linspace(0, 1e5, len(scan))
        np.save(folder / f"{number}.npy", fields)
    (folder / "times.txt").write_text("5000\n5000.1\n5000.2\n")
    result = lidarlift("run", folder, "--stamp", "end", "--point-time", "dt:us", "--out", "out")
    assert result.code == 0, result.err
    told = "point times: field dt, us, relative, -100 to 0 ms of a 100 ms sweep, in 3 of 3 scans; stamp = end"
    assert told in result.out
    assert read_report(Path("out"))["protocol"]["point_times"] == told
    assert read_report(Path("out"))["protocol"]["stamps"] == "times.txt, s"
    lidarlift("run", folder, "--point-time", "when", "--out", "out").refused("no field 'when'", "there are t, dt")


def test_a_data_set_without_fields_refuses_a_field_name(lidarlift: Command, street_drive: Drive) -> None:
    lidarlift("run", street_drive(), "--point-time", "t", "--out", "out").refused("--point-time is not for this kind")


@pytest.mark.parametrize("name", ["figures", "session", "unfinished"])
def test_links_in_the_run_folder_are_not_followed(
    lidarlift: Command, street_drive: Drive, tmp_path: Path, name: str
) -> None:
    (tmp_path / "r").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "r" / name).symlink_to(tmp_path / "elsewhere")
    lidarlift("run", street_drive(), "--frames", ":2", "--out", "r").refused(f"r/{name}: is a link")
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_the_name_of_a_data_set_is_no_path() -> None:
    class Named(NamedTuple):
        name: str

    for name, folder in {
        "../../etc/x": "etc-x-16",
        "KITTI odometry 04": "kitti-odometry-04-16",
        "..": "run-16",
    }.items():
        assert default_folder(cast(Dataset, Named(name)), "16") == Path("runs") / folder


def test_a_second_run_into_the_folder_is_refused(street_drive: Drive, tmp_path: Path, lidarlift: Command) -> None:
    arguments = ["run", str(street_drive()), "--frames", ":3", "--out", str(tmp_path / "r")]
    command = [sys.executable, "-c", STUCK, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "optimising\n"
            lidarlift(*arguments).refused(f"process {process.pid} on ", "writes a run into this folder")
        finally:
            process.kill()
    assert lidarlift(*arguments, "--resume").code == 0  # the lock of a process that was killed is free
