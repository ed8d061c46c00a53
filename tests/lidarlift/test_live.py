"""SLAM on scans as they come."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import lidarlift
from slam.data.cloud import Array, PointCloud
from slam.data.sensor import load_sensor

Drive = Callable[..., Path]


def off(poses: Array, truth: Array) -> Array:
    """(N,) metres."""
    return np.linalg.norm(poses[:, :3, 3] - truth[:, :3, 3], axis=1)


def test_add_returns_the_pose_of_each_scan(street_scans: list[Array], street_poses: Array, tmp_path: Path) -> None:
    with lidarlift.Slam() as slam:
        for number, scan in enumerate(street_scans):
            step = slam.add(scan, 0.1 * number)
            assert step.status == "registered"
            assert np.linalg.norm(step.pose[:3, 3] - street_poses[number, :3, 3]) < 0.05
            assert np.linalg.eigvalsh(step.covariance)[0] >= 0
        assert off(slam.trajectory(), street_poses).max() < 0.05
        run = slam.finish()
    assert off(run.poses, street_poses).max() < 0.05
    assert len(run.map) > 10_000
    lidarlift.save_run(run, tmp_path / "live")
    assert '"dataset": "live"' in (tmp_path / "live" / "run.json").read_text()


def test_live_slam_equals_a_run_over_the_data_set(street_drive: Drive, street_scans: list[Array]) -> None:
    """The same scans from files and by hand, twice the same code: bit for bit."""
    recorded = lidarlift.run(street_drive(), overrides=["front_end.vertical_correction_deg=0"])
    with lidarlift.Slam(overrides=["front_end.vertical_correction_deg=0"]) as slam:
        for number, scan in enumerate(street_scans):
            slam.add(scan, float(f"{0.1 * number:e}"))
        live = slam.finish()
    np.testing.assert_array_equal(live.poses, recorded.poses)
    np.testing.assert_array_equal(live.map.xyz, recorded.map.xyz)


def test_rings_are_derived_from_the_laser_lines(street_scans: list[Array], street_poses: Array) -> None:
    with lidarlift.Slam(sensor="hdl64", input="enriched", enricher="ray-segment") as slam:
        steps = [slam.add(scan, 0.1 * number) for number, scan in enumerate(street_scans)]
        run = slam.finish()
    assert steps[0].points > 2 * 16 * 600
    assert off(run.poses, street_poses).max() < 0.2


def test_another_lidar_than_the_named_one_is_reported_once(street_scans: list[Array]) -> None:
    with lidarlift.Slam(sensor="os1-64") as slam:
        for number in range(3):
            slam.add(np.roll(street_scans[number], 1, axis=0), 0.1 * number)  # no longer ring by ring
        counts = slam.finish().counts()
    assert (counts["nominal_laser_lines"], counts["laser_lines"]) == (1, 1)


def test_structured_arrays_of_drivers_are_read(street_scans: list[Array]) -> None:
    scan = street_scans[0]
    fields = np.zeros(len(scan), [("x", "f4"), ("y", "f4"), ("z", "f4"), ("reflectivity", "u1"), ("ring", "u2")])
    for column, name in enumerate("xyz"):
        fields[name] = scan[:, column]
    fields["ring"] = np.repeat(np.arange(64), 600)
    with lidarlift.Slam(input="16") as slam:
        assert slam.add(fields, 0.0).points == 16 * 600


def test_point_clouds_are_used_unchanged(street_scans: list[Array]) -> None:
    cloud = PointCloud(street_scans[0][:, :3], np.zeros(len(street_scans[0])))
    with lidarlift.Slam() as slam:
        assert slam.add(cloud, 0.0).points == len(cloud)


def test_an_image_colours_the_map(street_scans: list[Array]) -> None:
    """A camera that looks ahead and sees nothing but red."""
    T = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])
    calibration = lidarlift.Calibration(np.array([[300.0, 0, 320], [0, 300, 240], [0, 0, 1]]), T)
    red = np.full((480, 640, 3), (255, 0, 0), np.uint8)
    with lidarlift.Slam(calibration=calibration) as slam:
        for number, scan in enumerate(street_scans[:3]):
            slam.add(scan, 0.1 * number, red)
        world = slam.finish().map
    assert world.colour is not None
    seen = world.colour.any(axis=1)
    assert 0.02 < seen.mean() < 0.9
    assert (world.colour[seen][:, 1:] < 10).all()


def test_invalid_points_are_an_error_in_one_line() -> None:
    with lidarlift.Slam() as slam, pytest.raises(lidarlift.InputError, match=r"scan 0: .* shape \(5, 7\)"):
        slam.add(np.zeros((5, 7)), 0.0)


def test_non_finite_points_are_removed_and_counted(street_scans: list[Array]) -> None:
    scan = street_scans[0].copy()
    scan[::10, 2] = np.nan
    with lidarlift.Slam() as slam:
        assert slam.add(scan, 0.0).points == int(np.isfinite(scan).all(axis=1).sum())
        assert slam.finish().counts()["non-finite_points"] == 1


def test_enrichment_without_a_sensor_is_an_error() -> None:
    with pytest.raises(lidarlift.InputError, match=r"live: no enrichment: .*laser lines"):
        lidarlift.Slam(input="enriched")


def test_input_64_of_a_16_ring_sensor_is_an_error() -> None:
    assert load_sensor("vlp16").ring_count == 16
    with pytest.raises(lidarlift.InputError, match="--input 64: the LiDAR has 16 rings; use --input full"):
        lidarlift.Slam("vlp16", input="64")


def test_adding_to_a_finished_run_is_an_error(street_scans: list[Array]) -> None:
    with lidarlift.Slam() as slam:
        slam.add(street_scans[0], 0.0)
        assert slam.finish() is slam.finish()
        with pytest.raises(ValueError, match="finished"):
            slam.add(street_scans[1], 0.1)


def test_a_non_positive_rotation_rate_is_an_error() -> None:
    with pytest.raises(lidarlift.InputError, match="sweeps_per_second"):
        lidarlift.Slam(sweeps_per_second=0)


def test_times_that_are_no_seconds_are_refused(street_scans: list[Array]) -> None:
    scan = street_scans[0]
    fractions = PointCloud(scan[:, :3], scan[:, 3], time=np.linspace(0, 1, len(scan)))
    with (
        lidarlift.Slam() as slam,
        pytest.raises(lidarlift.InputError, match=r"frame 0: .*span 1 s, .*not fractions of the sweep"),
    ):
        slam.add(fractions, 0.0)


def test_times_are_in_the_unit_that_the_first_scan_has_them_in(street_scans: list[Array]) -> None:
    scan = street_scans[0]
    fields = np.zeros(len(scan), [("x", "f4"), ("y", "f4"), ("z", "f4"), ("t", "u4")])
    for column, name in enumerate("xyz"):
        fields[name] = scan[:, column]
    fields["t"] = np.linspace(0, 1e8, len(scan))
    with lidarlift.Slam() as slam:
        slam.add(np.zeros((0, 3)), -0.1)
        slam.add(fields, 0.0)
        run = slam.finish()
    assert run.deskewed
    assert "field t, ns, relative, 0 to 100 ms" in run.times()
