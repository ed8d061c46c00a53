import errno
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from slam.data import se3
from slam.data.beams import recover_rings
from slam.data.dataset import open_dataset
from slam.data.errors import InputError
from slam.simulation.simulation import Simulation, SimulationConfig


@pytest.fixture(scope="module")
def jam(tmp_path_factory: pytest.TempPathFactory) -> tuple[Simulation, Path]:
    """Three frames of the jam, with all the truth there is."""
    simulation, folder = Simulation(SimulationConfig(drive="jam", depth=True)), tmp_path_factory.mktemp("town") / "jam"
    simulation.write(folder, 3)
    return simulation, folder


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_the_ordinary_loader_reads_it(jam: tuple[Simulation, Path]) -> None:
    simulation, folder = jam
    data = open_dataset(folder)
    assert len(data) == 3
    assert data.problems == ()
    assert data.sensor is not None
    assert (data.sensor.vertical_correction, data.sensor.motion_compensated) == (0.0, True)
    for position in range(3):
        frame = data[position]
        assert frame.problems == ()
        assert frame.image is not None
        assert frame.image.shape == (375, 1242, 3)
        assert 80_000 < len(frame.cloud) < 128_000
        assert frame.cloud.ring is not None
        assert set(frame.cloud.ring) == set(range(64))
        assert frame.cloud.time is None
    assert data.ground_truth is not None
    truth = se3.inverse(simulation.rig.poses[0]) @ simulation.rig.poses[:3]
    np.testing.assert_allclose(data.ground_truth, truth, atol=1e-6)


def test_the_image_is_of_what_the_lidar_sees(jam: tuple[Simulation, Path]) -> None:
    simulation, folder = jam
    depth = cv2.imread(str(folder / "sequences/00/depth_2/000001.png"), cv2.IMREAD_UNCHANGED) / 256.0
    exact = np.fromfile(folder / "sequences/00/velodyne_exact/000001.bin", np.float32).reshape(-1, 4)
    assert recover_rings(exact[:, :3])[1] == 64
    calibration = simulation.rig.calibration
    points = exact[:, :3] @ calibration.T_camera_lidar[:3, :3].T + calibration.T_camera_lidar[:3, 3]
    points = points[points[:, 2] > 1]
    u, v = np.round((points @ calibration.K.T)[:, :2] / points[:, 2:]).astype(int).T
    inside = (u >= 0) & (u < 1242) & (v >= 0) & (v < 375)
    seen = depth[v[inside], u[inside]]
    error = np.abs(seen - points[inside, 2]) / points[inside, 2]
    assert inside.sum() > 10_000
    assert np.median(error) < 0.01
    assert (error < 0.05).mean() > 0.9  # the rest: seen past an edge by one of the two


def test_a_recorded_scan_is_the_exact_one_with_errors(jam: tuple[Simulation, Path]) -> None:
    _, folder = jam
    recorded, exact = (
        np.fromfile(folder / f"sequences/00/{name}/000000.bin", np.float32).reshape(-1, 4)
        for name in ("velodyne", "velodyne_exact")
    )
    assert len(recorded) < len(exact)
    ranges = [np.median(np.linalg.norm(scan[:, :3], axis=1)) for scan in (recorded, exact)]
    assert abs(ranges[0] - ranges[1]) < 1.0


def test_the_same_settings_give_the_same_bytes(jam: tuple[Simulation, Path], tmp_path: Path) -> None:
    _, folder = jam
    again = Simulation(SimulationConfig(drive="jam", depth=True))
    again.write(tmp_path / "again", 3)
    assert contents(tmp_path / "again") == contents(folder)


@pytest.mark.parametrize("drive", ["motorway", "bridge", "lorries", "traffic", "building"])
def test_the_same_seed_gives_the_same_scan_in_every_scene(drive: str) -> None:
    settings = SimulationConfig(drive, sensor="vlp16", distort=True, camera=False, seed=3)
    scans = [Simulation(each).rig.frame(7).scan for each in (settings, settings, replace(settings, seed=4))]
    assert scans[0].xyz.tobytes() == scans[1].xyz.tobytes()
    assert scans[0].xyz.tobytes() != scans[2].xyz.tobytes()


def test_processes_write_the_same_bytes(
    jam: tuple[Simulation, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulation, folder = jam
    monkeypatch.setattr("slam.simulation.simulation.FEW", 0)
    calls: list[int] = []
    simulation.write(tmp_path / "jam", 3, lambda: calls.append(0))
    assert len(calls) == 3
    assert contents(tmp_path / "jam") == contents(folder)


def test_errors_of_worker_processes_are_raised(
    jam: tuple[Simulation, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulation, _ = jam
    monkeypatch.setattr("slam.simulation.simulation.FEW", 0)
    (tmp_path / "jam").mkdir()
    (tmp_path / "jam" / "simulation.json").write_text(simulation._about())
    (tmp_path / "jam" / "sequences" / "00").mkdir(parents=True)
    (tmp_path / "jam" / "sequences" / "00" / "image_2").write_text("in the way")
    with pytest.raises(InputError, match=r"image_2/00000\d.png: cannot be written"):
        simulation.write(tmp_path / "jam", 3)


def test_a_frame_does_not_depend_on_those_before(jam: tuple[Simulation, Path]) -> None:
    simulation, folder = jam
    alone = Simulation(simulation.settings).rig.frame(2).scan
    before = np.fromfile(folder / "sequences/00/velodyne/000002.bin", np.float32).reshape(-1, 4)
    np.testing.assert_array_equal(np.column_stack([alone.xyz, alone.reflectance]), before)


def test_an_interrupted_simulation_is_resumed(jam: tuple[Simulation, Path], tmp_path: Path) -> None:
    simulation, folder = jam
    shutil.copytree(folder, tmp_path / "jam")
    (tmp_path / "jam/sequences/00/velodyne/000002.bin").unlink()
    kept = tmp_path / "jam/sequences/00/velodyne/000001.bin"
    before, calls = kept.stat().st_mtime_ns, []
    assert simulation.matches(tmp_path / "jam")
    simulation.write(tmp_path / "jam", 3, lambda: calls.append(0))
    assert len(calls) == 3
    assert kept.stat().st_mtime_ns == before
    assert contents(tmp_path / "jam") == contents(folder)


@pytest.mark.parametrize(
    "other", [SimulationConfig(drive="jam", seed=1, depth=True), SimulationConfig(drive="jam"), SimulationConfig()]
)
def test_a_folder_with_another_simulation_is_an_error(
    jam: tuple[Simulation, Path], tmp_path: Path, other: SimulationConfig
) -> None:
    _, folder = jam
    shutil.copy(folder / "simulation.json", tmp_path / "simulation.json")
    assert not Simulation(other).matches(tmp_path)
    with pytest.raises(InputError, match="has other content; choose a new folder"):
        Simulation(other).write(tmp_path, 1)


def test_a_folder_with_other_content_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match="has other content"):
        Simulation(SimulationConfig(drive="jam")).write(tmp_path, 1)
    assert contents(tmp_path) == {"thesis.tex": b"years of work"}


def test_a_folder_that_cannot_be_created_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written") as error:
        Simulation(SimulationConfig(drive="jam")).write(tmp_path / "file" / "town", 1)
    assert "\n" not in str(error.value)


def test_a_full_disk_leaves_no_incomplete_file(
    jam: tuple[Simulation, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulation, _ = jam
    write = Path.write_bytes

    def full(path: Path, content: bytes) -> int:
        if "000001" in path.name:
            write(path, content[: len(content) // 2])
            raise OSError(errno.ENOSPC, "No space left on device")
        return write(path, content)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match=r"000001\.\w+: cannot be written \(No space left on device\)"):
        simulation.write(tmp_path / "jam", 3)
    monkeypatch.undo()
    left = contents(tmp_path / "jam")
    assert not any("000001" in name for name in left)
    assert "sequences/00/velodyne/000000.bin" in left


def test_a_distorted_drive_is_deskewed_by_its_times(tmp_path: Path) -> None:
    simulation = Simulation(SimulationConfig(drive="jam", distort=True, sensor="vlp16"))
    simulation.write(tmp_path / "town", 2)
    data = open_dataset(tmp_path / "town")
    assert data.sensor is not None
    assert data.sensor.ring_count == 16
    frame = data[1]
    assert frame.cloud.time is not None
    assert frame.cloud.ring is not None
    assert set(frame.cloud.ring) <= set(range(16))
    assert frame.problems == ()


def test_without_a_camera_the_scans_are_the_same(jam: tuple[Simulation, Path], tmp_path: Path) -> None:
    _, folder = jam
    Simulation(SimulationConfig(drive="jam", camera=False)).write(tmp_path / "jam", 1)
    scan = Path("sequences/00/velodyne/000000.bin")
    assert (tmp_path / "jam" / scan).read_bytes() == (folder / scan).read_bytes()
    assert not (tmp_path / "jam/sequences/00/image_2").exists()
    assert open_dataset(tmp_path / "jam")[0].image is None
