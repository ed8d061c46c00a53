"""From a sparse scan to a cloud on virtual beams."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from enrichment.calibration import SINGLE_GAP, Calibrated, relative_errors
from enrichment.enricher import Enricher, denser
from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.interpolation.ray_segment import RaySegment
from slam.data.cloud import Frame, PointCloud
from slam.data.sensor import load_sensor

Scan = Callable[..., SparseScan]


def enricher(scan: SparseScan, coverage: float = 1.0) -> Enricher:
    return Enricher(lambda frame, _: frame.cloud, RaySegment(), scan.lines, scan.rings, scan.lines, coverage)


def frame(cloud: PointCloud) -> Frame:
    return Frame(index=0, stamp=0.0, cloud=cloud)


def test_measured_points_come_first_and_unchanged(sparse: Scan) -> None:
    scan = sparse()
    cloud = enricher(scan)(frame(scan.cloud), ())
    count = len(scan.cloud)
    assert len(cloud) > 3 * count
    assert cloud.measured[:count].all()
    assert not cloud.measured[count:].any()
    assert cloud.time is not None
    assert scan.cloud.time is not None
    for name in ("xyz", "intensity", "ring", "time", "sigma"):
        np.testing.assert_array_equal(getattr(cloud, name)[:count], getattr(scan.cloud, name), err_msg=name)


def test_predicted_points_lie_on_the_planes_with_time_and_sigma(sparse: Scan) -> None:
    scan = sparse()
    cloud = enricher(scan)(frame(scan.cloud), ())
    new = cloud.select(~cloud.measured)
    assert new.ring is not None
    assert new.time is not None
    off = np.minimum(np.abs(new.xyz[:, 2] + 1.7), np.abs(new.xyz[:, 0] - 15.0))
    assert np.mean(off < 0.01) > 0.9
    assert (new.ring % 4 != 0).all()
    np.testing.assert_allclose(new.time, 0.1 * np.arctan2(new.xyz[:, 1], new.xyz[:, 0]) / (2 * np.pi), atol=2e-4)
    assert new.sigma.min() >= 0.01
    assert (new.intensity >= 0).all()
    assert (new.intensity <= 1).all()


def test_coverage_keeps_the_smallest_sigmas(sparse: Scan) -> None:
    scan = sparse()
    everything, half = (enricher(scan, share)(frame(scan.cloud), ()) for share in (1.0, 0.5))
    new, kept = everything.select(~everything.measured), half.select(~half.measured)
    assert len(kept) == pytest.approx(len(new) / 2, rel=0.05)
    relative = [np.max(cloud.sigma / np.linalg.norm(cloud.xyz, axis=1)) for cloud in (kept, new)]
    assert relative[0] < relative[1]


@pytest.mark.parametrize("cloud", [PointCloud(np.zeros((0, 3)), np.zeros(0)), PointCloud(np.ones((5, 3)), np.zeros(5))])
def test_scans_without_rings_are_passed_through(sparse: Scan, cloud: PointCloud) -> None:
    assert enricher(sparse())(frame(cloud), ()) is cloud


def test_a_sensor_of_sixteen_rings_gets_three_beams_between_each_two(street: Callable[..., PointCloud]) -> None:
    sensor = load_sensor("vlp16")
    target = denser(sensor, np.arange(16))
    assert target.ring_count == 61
    np.testing.assert_allclose(target.elevation[::4], sensor.elevation)
    np.testing.assert_allclose(np.rad2deg(target.elevation[:5]), [15, 14.5, 14, 13.5, 13])

    cloud = street(sensor, RayGrid(sensor).azimuth)
    made = Enricher(lambda frame, _: frame.cloud, RaySegment(), sensor, np.arange(16))(frame(cloud), ())
    assert made.ring is not None
    assert cloud.ring is not None
    np.testing.assert_array_equal(made.ring[: len(cloud)], cloud.ring * 4)
    new = made.select(~made.measured)
    assert len(new) > len(cloud)
    assert np.mean(np.minimum(np.abs(new.xyz[:, 2] + 1.7), np.abs(new.xyz[:, 0] - 15.0)) < 0.01) > 0.9


class Wrong:
    """Three times as far off as it says, at random."""

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        truth = RaySegment()(scan, grid)
        noise = np.random.default_rng(0).normal(0, 0.3, grid.shape).astype(np.float32)
        return Prediction(truth.ranges + noise, np.full(grid.shape, 0.1, np.float32), truth.ranges > 0)


def test_sigma_is_scaled_to_the_errors_at_held_out_rings(sparse: Scan, grid: RayGrid) -> None:
    scan = sparse()
    held = scan.rings[[8, 11]]
    assert np.quantile(relative_errors(Wrong(), scan, held), 0.68) == pytest.approx(3.0, rel=0.05)
    methods = Calibrated(Wrong()), Calibrated(Wrong())
    sigmas = [float(methods[0](scan, grid).sigma[0, 0]) for _ in range(12)]
    assert sigmas[-1] == pytest.approx(0.1 * 2.0 * SINGLE_GAP)  # a validation says 2 at most
    assert sigmas[1] == pytest.approx(sigmas[0])  # not every scan is validated on
    assert float(methods[1](scan, grid).sigma[0, 0]) == pytest.approx(sigmas[0])


def test_methods_receive_past_scans_of_the_same_rings(street: Callable[..., PointCloud]) -> None:
    sensor, seen = load_sensor("vlp16"), []

    class Watching(RaySegment):
        def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
            seen.append(scan)
            return super().__call__(scan, grid)

    cloud = street(sensor, RayGrid(sensor).azimuth)
    made = Enricher(lambda frame, _: frame.cloud, Watching(), sensor, np.arange(16))
    first = made(frame(cloud), ())
    T_now_then = np.diag([1.0, 1, 1, 1])
    made(frame(cloud), [(first, T_now_then)])
    ((then, placed),) = seen[-1].past
    assert placed is T_now_then
    np.testing.assert_array_equal(then.ring, cloud.ring)
    np.testing.assert_array_equal(then.xyz, cloud.xyz)
