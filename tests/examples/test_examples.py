"""The scripts and the notebook of examples/ run as they stand there, on small simulated sequences."""

from __future__ import annotations

import json
import re
import runpy
import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
import pytest

from eval.body_frame import read_camera0_calibration
from slam.data.cloud import Array
from slam.data.pose_files import kitti_text
from slam.simulation.simulation import Simulation, SimulationConfig

EXAMPLES = Path(__file__).parents[2] / "examples"
FRAMES = 12
Script = Callable[..., str]


@pytest.fixture(scope="module")
def vlp16(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of .pcd scans of a VLP-16 with stamps, images and true poses."""
    folder = tmp_path_factory.mktemp("vlp16") / "scans"
    settings = SimulationConfig(drive="straight", sensor="vlp16", format="folder", distort=True)
    Simulation(settings).write(folder, FRAMES)
    return folder


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Script:
    """`script("live.py", "my_scans", ...)` runs an example in an empty folder; returns what it printed."""

    def run(name: str, *arguments: str | Path) -> str:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return capsys.readouterr().out

    return run


def test_a_kitti_sequence(script: Script, street_drive: Callable[..., Path], tmp_path: Path) -> None:
    kitti = street_drive().parents[1]
    printed = script("run_kitti.py", kitti, "--sequence", "77", "--input", "16", "--out", "runs/77")
    assert float(re.findall(r"ATE ([\d.]+) m", printed)[0]) < 0.1
    assert (tmp_path / "runs/77/map.pcd").is_file()


def test_one_scan_enriched(script: Script, vlp16: Path, tmp_path: Path) -> None:
    printed = script("enrich_a_scan.py", vlp16, "--scan", "3", "--out", "scan.png")
    measured, predicted = map(int, re.findall(r"(\d+) points measured, (\d+) predicted", printed)[0])
    assert predicted > measured > 1000
    assert (tmp_path / "scan.png").read_bytes().startswith(b"\x89PNG")


def test_a_lidar_of_ones_own(script: Script, vlp16: Path, tmp_path: Path) -> None:
    printed = script("own_sensor.py", vlp16 / "scans", "--rings", "16", "--lowest", "-15", "--highest", "15")
    points = json.loads(re.findall(r"top first: (\[.*\])", printed)[0])
    assert len(points) == 16
    assert min(points[8:]) > 100  # rings that look down meet the road
    assert f"'frames': {FRAMES}" in printed
    assert (tmp_path / "own-lidar.yaml").is_file()


def test_scans_one_by_one(script: Script, vlp16: Path, tmp_path: Path) -> None:
    printed = script("live.py", vlp16, "--sensor", "vlp16", "--out", "runs/live")
    assert printed.count("registered") + printed.count("retried") == FRAMES
    assert (tmp_path / "runs/live/trajectory_tum.txt").is_file()


@pytest.mark.parametrize("frame", ["lidar", "camera"])
def test_a_trajectory_of_another_system(
    frame: str, script: Script, street_drive: Callable[..., Path], street_poses: Array, tmp_path: Path
) -> None:
    """One pose is off by 0.3 m; against KITTI's ground truth, whose poses are those of camera 0."""
    sequence, off = street_drive(), street_poses.copy()
    off[4, 2, 3] += 0.3
    truth, calib = sequence.parents[1] / "poses" / "77.txt", sequence / "calib.txt"
    T_camera_lidar = read_camera0_calibration(calib)
    if frame == "camera":
        off = T_camera_lidar @ off @ np.linalg.inv(T_camera_lidar)
    (tmp_path / "other.txt").write_text(kitti_text(off))
    more = ["--calib", calib] if frame == "lidar" else []
    printed = script("evaluate_trajectory.py", "other.txt", truth, *more, "--out", "error.png")
    ate = float(re.findall(r"ATE ([\d.]+) m", printed)[0])
    assert 0.5 * 0.3 / np.sqrt(len(off)) < ate < 1.01 * 0.3 / np.sqrt(len(off))
    assert (tmp_path / "error.png").read_bytes().startswith(b"\x89PNG")


def test_the_package_with_a_method_is_that_of_the_page() -> None:
    page = (EXAMPLES.parent / "docs/adding-a-method.md").read_text()
    for name in ("lidarlift_halfway.py", "pyproject.toml"):
        assert (EXAMPLES / "add_a_method" / name).read_text() in page


def test_the_notebook(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its cells, one after the other, without Jupyter; it is committed without outputs."""
    notebook = json.loads((EXAMPLES / "tour.ipynb").read_text())
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(Path(sys.executable).parent), prepend=":")
    matplotlib.use("Agg")
    names: dict[str, object] = {}
    for cell in cells:
        exec("".join(cell["source"]).replace("FRAMES = 60", f"FRAMES = {FRAMES}"), names)
    errors = [float(error) for error in re.findall(r"ATE ([\d.]+) m", capsys.readouterr().out)]
    assert len(errors) == 2
    assert max(errors) < 1


def test_the_node_is_python() -> None:
    """ROS 2 is not installed by pip, so that no more can be tested."""
    compile((EXAMPLES / "ros2_node.py").read_text(), "ros2_node.py", "exec")
