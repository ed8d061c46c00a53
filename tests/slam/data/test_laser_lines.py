from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import open3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slam.data.cloud import Array
from slam.data.dataset import open_dataset
from slam.data.errors import InputError
from slam.data.laser_lines import LaserLines, fit_dataset, fit_lines, sensor_text
from slam.data.sensor import load_sensor

HDL64 = load_sensor("hdl64")
ScanMaker = Callable[..., Array]


def points_on(elevation: Array, offset: Array, rho: Array) -> tuple[Array, Array, Array]:
    """ring, rho, z (R * N,) of lines (R,), each seen at `rho` (R, N)."""
    z = np.tan(elevation)[:, None] * rho + offset[:, None]
    return np.repeat(np.arange(len(elevation)), rho.shape[1]), rho.ravel(), z.ravel()


def errors(lines: LaserLines, elevation: Array = HDL64.elevation, offset: Array = HDL64.offset) -> tuple[float, float]:
    """The largest differences, degrees and millimetres."""
    return (
        float(np.rad2deg(np.abs(lines.elevation - elevation).max())),
        float(1e3 * np.abs(lines.offset - offset).max()),
    )


@given(
    elevation=st.lists(st.floats(-60, 60), min_size=2, max_size=8),
    offset=st.floats(-0.3, 0.3),
    seed=st.integers(0, 99),
)
def test_exact_points_give_exact_lines(elevation: list[float], offset: float, seed: int) -> None:
    angles = np.deg2rad(elevation)
    heights = offset + 0.01 * np.arange(len(angles))
    rho = np.random.default_rng(seed).uniform(3, 60, (len(angles), 50))
    lines = fit_lines(*points_on(angles, heights, rho), len(angles))
    assert lines.elevation == pytest.approx(angles, abs=1e-8)
    assert lines.offset == pytest.approx(heights, abs=1e-7)
    assert lines.points.tolist() == [50] * len(angles)


def test_the_fit_is_robust_to_noise_and_outliers() -> None:
    """A tenth of the points lie up to 2 m above their line."""
    rng = np.random.default_rng(0)
    ring, rho, z = points_on(HDL64.elevation, HDL64.offset, rng.uniform(3, 60, (64, 1000)))
    strays = rng.random(len(z)) < 0.1
    noisy = z + rng.normal(0, 0.001, len(z)) + strays * rng.uniform(0, 2, len(z))
    degrees, millimetres = errors(fit_lines(ring, rho, noisy, 64))
    assert degrees < 0.001
    assert millimetres < 0.6


def test_standard_errors_match_the_errors_of_the_fit() -> None:
    rng = np.random.default_rng(1)
    ring, rho, z = points_on(HDL64.elevation, HDL64.offset, rng.uniform(5, 30, (64, 400)))
    lines = fit_lines(ring, rho, z + rng.normal(0, 0.002, len(z)), 64)
    for made, told in (
        (lines.elevation - HDL64.elevation, lines.elevation_error),
        (lines.offset - HDL64.offset, lines.offset_error),
    ):
        assert np.sqrt(np.mean((made / told) ** 2)) == pytest.approx(1, abs=0.25)


def test_the_residual_is_the_angle_between_points_and_line() -> None:
    rng = np.random.default_rng(2)
    ring, rho, z = points_on(np.zeros(2), np.zeros(2), np.full((2, 4000), 10.0))
    residual = np.rad2deg(fit_lines(ring, rho, z + rng.normal(0, 0.01, len(z)), 2).residual)
    assert residual == pytest.approx(np.rad2deg(0.001), rel=0.1)


def test_a_ring_at_one_distance_takes_the_offset_of_its_neighbours() -> None:
    """Elevation and offset cannot be separated there: the line meets the points, the standard errors are large."""
    rng = np.random.default_rng(3)
    rho = rng.uniform(5, 30, (5, 500))
    rho[0], rho[3] = 20.0, 20.0
    elevation, offset = np.deg2rad([10, 5, 0, -5, -10]), np.array([0.105, 0.1, 0.1, 0.11, 0.12])
    lines = fit_lines(*points_on(elevation, offset, rho), 5)
    assert lines.offset == pytest.approx([0.1, 0.1, 0.1, 0.11, 0.12], abs=0.002)
    assert np.tan(lines.elevation) * 20 + lines.offset == pytest.approx(np.tan(elevation) * 20 + offset, abs=1e-6)
    assert (lines.offset_error[[0, 3]] > 0.01).all()
    assert (lines.offset_error[[1, 2, 4]] < 1e-4).all()
    assert (np.abs(lines.elevation - elevation) <= 2 * lines.elevation_error).all()


def numbered(scan: Array, ring: Array) -> Array:
    """Named columns x, y, z, ring."""
    kinds = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("ring", "u2")]
    return np.array(list(zip(*scan[:, :3].T, ring, strict=True)), kinds)


@pytest.fixture
def folder(tmp_path: Path, hdl64_scan: ScanMaker) -> Path:
    """Two scans, stored ring by ring, without a ring field and without a sensor."""
    for number in range(2):
        hdl64_scan().tofile(tmp_path / f"{number}.bin")
    return tmp_path


def fitted(path: Path, rings: int | None = None) -> tuple[LaserLines, list[str]]:
    data = open_dataset(path)
    lines, problems = fit_dataset(data, range(len(data)), rings)
    return lines, [problem.message for problem in problems]


def test_rings_are_counted_in_files_without_a_ring_field(folder: Path) -> None:
    lines, problems = fitted(folder)
    assert errors(lines) < (0.001, 0.1)
    assert lines.points.tolist() == [720] * 64
    assert problems == []


def test_scans_with_another_number_of_rings_are_left_out(folder: Path, hdl64_scan: ScanMaker) -> None:
    hdl64_scan(range(39)).tofile(folder / "2.bin")
    (folder / "3.bin").write_bytes(b"")
    lines, problems = fitted(folder)
    assert errors(lines) < (0.001, 0.1)
    assert len(problems) == 1
    assert "without 64 rings, left out (number of rings): 2 (39), 3 (0)" in problems[0]
    assert len(fitted(folder, rings=39)[0].points) == 39


@pytest.mark.parametrize("upwards", [False, True])
def test_a_ring_field_may_count_from_the_top_or_the_bottom(
    tmp_path: Path, hdl64_scan: ScanMaker, upwards: bool
) -> None:
    scan, ring = hdl64_scan(range(4, 64, 4)), np.repeat(np.arange(15), 360)
    order = np.random.default_rng(0).permutation(len(scan))
    np.save(tmp_path / "0.npy", numbered(scan, 14 - ring if upwards else ring)[order])
    lines, _ = fitted(tmp_path)
    assert errors(lines, HDL64.elevation[4::4], HDL64.offset[4::4]) < (0.001, 0.1)


def test_lines_are_fitted_to_point_clouds_with_a_ring_field(tmp_path: Path, hdl64_scan: ScanMaker) -> None:
    cloud = open3d.t.geometry.PointCloud(hdl64_scan()[:, :3].copy())
    cloud.point["ring"] = np.repeat(np.arange(64, dtype=np.int32), 360).reshape(-1, 1)
    open3d.t.io.write_point_cloud(str(tmp_path / "0.pcd"), cloud)
    assert errors(fitted(tmp_path)[0]) < (0.001, 0.1)


def test_a_known_sensor_does_not_bias_the_fit(folder: Path) -> None:
    """If rings were taken from the lines of a wrong sensor.yaml, its errors would remain."""
    wrong = np.column_stack([np.rad2deg(HDL64.elevation) + 0.3, HDL64.offset])
    (folder / "sensor.yaml").write_text(f"beams: {wrong.tolist()}\n")
    assert errors(fitted(folder)[0]) < (0.001, 0.1)


def test_a_sensor_file_is_read_back_as_written(folder: Path) -> None:
    path = folder / "new.yaml"
    path.write_text(sensor_text(fitted(folder)[0], "mine: the second", np.deg2rad(0.2)))
    sensor = load_sensor(path)
    assert (sensor.name, sensor.motion_compensated) == ("mine: the second", False)
    assert sensor.vertical_correction == pytest.approx(np.deg2rad(0.2))
    assert sensor.elevation == pytest.approx(HDL64.elevation, abs=1e-5)
    assert sensor.offset == pytest.approx(HDL64.offset, abs=1e-4)


@pytest.mark.parametrize("rings", [None, 64])
@pytest.mark.parametrize("order", ["shuffled", "clockwise", "by azimuth", "from the rear"])
def test_points_in_another_order_are_refused(
    tmp_path: Path, hdl64_scan: ScanMaker, order: str, rings: int | None
) -> None:
    scan, ring = hdl64_scan(), np.repeat(np.arange(64), 360)
    azimuth = np.arctan2(scan[:, 1], scan[:, 0])
    orders = {
        "shuffled": np.random.default_rng(0).permutation(len(scan)),
        "clockwise": np.arange(len(scan))[::-1],
        "by azimuth": np.argsort(azimuth, kind="stable"),
        "from the rear": np.lexsort((azimuth, ring)),
    }
    scan[orders[order]].tofile(tmp_path / "0.bin")
    with pytest.raises(InputError, match="without a ring field"):
        fitted(tmp_path, rings)


def test_points_off_their_lines_are_refused(tmp_path: Path, hdl64_scan: ScanMaker) -> None:
    """Motion compensation moves points; here by up to 0.3 m up and down around the sensor."""
    scan = hdl64_scan()
    scan[:, 2] += 0.3 * np.sin(np.arctan2(scan[:, 1], scan[:, 0]))
    np.save(tmp_path / "0.npy", numbered(scan, np.repeat(np.arange(64), 360)))
    with pytest.raises(InputError, match=r"points lie 0\.\d+ deg off .* be raw"):
        fitted(tmp_path)


def test_scans_declared_as_motion_compensated_are_refused(folder: Path) -> None:
    (folder / "sensor.yaml").write_text("model: hdl64\nmotion_compensated: true\n")
    with pytest.raises(InputError, match="motion-compensated scans"):
        fitted(folder)


@pytest.mark.parametrize(
    ("swap", "rings", "message"),
    [
        ({5: 40, 40: 5}, None, "neither rise nor fall"),
        ({}, 66, "fewer than 100 points of ring 64, 65 of 0-65"),
        ({}, 32, r"the scans have 64 rings where 32 are expected \(--rings\)"),
        ({63: 2000}, None, "rings 0 to 2000, but 0 to 1023"),
    ],
)
def test_invalid_ring_numbers_are_refused(
    tmp_path: Path, hdl64_scan: ScanMaker, swap: dict[int, int], rings: int | None, message: str
) -> None:
    names = np.array([swap.get(ring, ring) for ring in range(64)])
    np.save(tmp_path / "0.npy", numbered(hdl64_scan(), np.repeat(names, 360)))
    with pytest.raises(InputError, match=message):
        fitted(tmp_path, rings)


@pytest.mark.parametrize(("name", "start"), [("kitti_raw_0013", 0), ("kitti_raw_0005", 2)])
def test_real_sequences_give_the_shipped_table(real_data: Callable[[str], Path], name: str, start: int) -> None:
    """Tolerances are 0.1 mm and 0.0001 deg; the points' coordinates are rounded to 1 mm."""
    data = open_dataset(real_data(name))
    lines, problems = fit_dataset(data, range(start, len(data), 20))
    assert errors(lines) < (0.002, 0.3)
    assert (np.rad2deg(lines.elevation_error) < 0.001).all()
    assert (lines.offset_error < 0.0002).all()
    assert (np.rad2deg(lines.residual) < 0.006).all()
    assert [problem.message.rpartition(": ")[2] for problem in problems] == ["42 (65)"] * (name == "kitti_raw_0005")
