"""`lidarlift compare` of finished runs and of trajectories of other systems."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lidarlift as package
from slam.data import se3
from slam.data.cloud import Array
from slam.data.pose_files import kitti_text, tum_text

Command = Callable[..., Any]
TR = np.array([[0, -1, 0, 0.1], [0, 0, -1, 0.2], [1, 0, 0, 0.3], [0, 0, 0, 1.0]])


@pytest.fixture
def tracks(street_poses: Array, tmp_path: Path) -> dict[str, Path]:
    """The street's truth of other systems: KISS-ICP's of camera 0 without stamps, and one with stamps, 1 % too long."""
    camera, longer = TR @ street_poses @ se3.inverse(TR), street_poses.copy()
    longer[:, :3, 3] *= 1.01
    texts = {"kiss_poses_kitti.txt": kitti_text(camera), "glim.txt": tum_text(0.1 * np.arange(8), longer)}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    return {name.partition(".")[0]: tmp_path / name for name in texts}


@pytest.mark.report
def test_runs_and_other_systems_are_compared(
    lidarlift: Command, street_drive: Callable[..., Path], tracks: dict[str, Path]
) -> None:
    drive = street_drive()
    assert lidarlift("run", drive, "--input", "16", "--out", "r").code == 0
    result = lidarlift("compare", "r", f"KISS={tracks['kiss_poses_kitti']}", tracks["glim"], "--out", "c")
    assert result.code == 0, result.err
    assert {"compare.json", "compare.md", "report.html", "figures"} <= {path.name for path in Path("c").iterdir()}
    content = json.loads(Path("c/compare.json").read_text())
    assert list(content["inputs"]) == ["r", "KISS", "glim"]
    assert content["reference"] == "ground truth"
    assert "KISS" in Path("c/report.html").read_text()
    assert content["inputs"]["r"]["loops"] == 0
    assert content["inputs"]["KISS"]["loops"] is None
    assert content["inputs"]["KISS"]["ate_m"] < 1e-5
    assert content["inputs"]["glim"]["ate_m"] == pytest.approx(0.0316, abs=0.003)
    assert content["distances_m"]["KISS"]["glim"] == pytest.approx(content["inputs"]["glim"]["ate_m"], abs=1e-4)
    note = "KISS: poses of camera 0, transformed into the LiDAR frame by the calibration of r"
    assert note in content["notes"]
    assert note in result.out
    assert "| glim |" in Path("c/compare.md").read_text()


def test_a_data_set_is_a_reference(
    lidarlift: Command, street_drive: Callable[..., Path], tracks: dict[str, Path]
) -> None:
    root = street_drive().parents[1]
    result = lidarlift("compare", tracks["glim"], "--reference", root, "--sequence", "77", "--out", "c")
    assert result.code == 0, result.err
    content = json.loads(Path("c/compare.json").read_text())
    assert content["reference"] == "ground truth of kitti 77"
    assert content["inputs"]["glim"]["ate_m"] == pytest.approx(0.0316, abs=0.003)
    assert content["distances_m"] == {"glim": {}}


def test_without_a_reference_distances_are_compared(lidarlift: Command, tracks: dict[str, Path]) -> None:
    calib = tracks["glim"].with_name("calib.txt")
    calib.write_text("Tr: " + " ".join(map(str, TR[:3].ravel())) + "\n")
    result = lidarlift("compare", *tracks.values(), "--calib", calib)
    assert result.code == 0, result.err
    content = json.loads(Path("runs/kiss_poses_kitti-glim-compared/compare.json").read_text())
    assert content["reference"] is None
    assert content["distances_m"]["glim"]["kiss_poses_kitti"] == pytest.approx(0.0316, abs=0.003)
    assert "transformed into the LiDAR frame by calib.txt" in result.out
    comparison = package.compare_trajectories(list(tracks.values()), calib=calib)
    assert comparison.distances_m == content["distances_m"]


def test_mistakes_are_one_line(
    lidarlift: Command, street_drive: Callable[..., Path], street_poses: Array, tracks: dict[str, Path]
) -> None:
    kiss, glim = tracks["kiss_poses_kitti"], tracks["glim"]
    short, late = glim.with_name("short.txt"), glim.with_name("late.txt")
    short.write_text(kitti_text(street_poses[:5]))
    late.write_text(tum_text(100 + 0.1 * np.arange(8), street_poses))
    lidarlift("compare", kiss, glim).refused("moves forward along x", "--calib calib.txt")
    lidarlift("compare", short, "--reference", glim).refused("short", "5 poses against 8", "without stamps")
    lidarlift("compare", late, "--reference", glim).refused("late", "0 pairs of poses", "same clock")
    lidarlift("compare", glim, late).refused("glim and late", "0 pairs of poses")
    lidarlift("compare", glim).refused("glim.txt", "a single trajectory", "--reference")
    lidarlift("compare", glim, late, "--frames", "0:3").refused("--frames", "data set")
    lidarlift("compare", glim, late, "--sequence", "04").refused("--sequence 04", "data set as --reference")
    lidarlift("compare", glim, short, "--reference", glim, "--calib", "x").refused("x", "cannot be read")
    drive = street_drive()
    lidarlift("compare", glim, drive).refused("77", "a data set is compared alone")
    lidarlift("compare", drive, "--calib", "x").refused("--calib x", "77 is a data set")
    lidarlift("compare", glim, "nothing.txt").refused("nothing.txt", "no such file")


def test_a_comparison_does_not_enter_a_run_folder(lidarlift: Command, tracks: dict[str, Path]) -> None:
    Path("r").mkdir()
    Path("r/run.json").write_text("{}")
    lidarlift("compare", *tracks.values(), "--out", "r").refused("r: is a run folder")


def test_runs_of_different_sequences_are_an_error(lidarlift: Command, street_drive: Callable[..., Path]) -> None:
    drive = street_drive()
    for name in ("a", "b"):
        assert lidarlift("run", drive, "--input", "16", "--frames", "0:3", "--out", name).code == 0
    report = json.loads(Path("b/run.json").read_text())
    report["protocol"]["dataset"] = "another"
    Path("b/run.json").write_text(json.dumps(report))
    lidarlift("compare", "a", "b").refused("different sequences", "a is of kitti 77, b is of another")
