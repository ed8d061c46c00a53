"""Enrichment of LiDARs with any rings: uneven, staggered, without some returns, in any order, few or one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from enrichment.enricher import Enricher
from enrichment.geometry.rays import RayGrid
from enrichment.geometry.sparse_scan import Method, SparseScan
from enrichment.interpolation.ray_segment import RaySegment
from enrichment.methods.joint import Joint
from enrichment.methods.registry import COMPLETIONS
from slam.data.cloud import Array, Frame, PointCloud
from slam.data.sensor import Sensor

GROUND, WALL = -1.7, 12.0  # m: a floor, and a round wall on it
COLUMNS = 60


@st.composite
def sensors(draw: st.DrawFn) -> Sensor:
    """LiDARs of 1 to 42 rings with unequal gaps, azimuth offsets, and lasers at different heights."""
    gaps = draw(st.lists(st.floats(0.1, 6.0), min_size=0, max_size=41))
    elevation = 25.0 - np.concatenate([[0.0], np.cumsum(gaps)])
    elevation = elevation[elevation > -80]
    count = len(elevation)
    offset = draw(st.lists(st.floats(-0.1, 0.1), min_size=count, max_size=count))
    azimuth = draw(st.lists(st.floats(-6, 6), min_size=count, max_size=count))
    return Sensor("any", np.deg2rad(elevation), np.array(offset), azimuth=np.deg2rad(azimuth))


def scan_of(sensor: Sensor, seen: Array) -> PointCloud:
    """The returns of the rings `seen` (R,) bool from floor and wall; none from above the wall."""
    ring = np.repeat(np.flatnonzero(seen), COLUMNS)
    turn = np.tile(np.arange(COLUMNS), int(seen.sum())) * 2 * np.pi / COLUMNS
    tangent, offset = np.tan(sensor.elevation[ring]), sensor.offset[ring]
    with np.errstate(divide="ignore"):
        rho = np.minimum(np.where(tangent < 0, (GROUND - offset) / tangent, np.inf), WALL)
    angle = turn + sensor.azimuth[ring]
    xyz = np.column_stack([rho * np.cos(angle), rho * np.sin(angle), tangent * rho + offset])
    return PointCloud(xyz, np.full(len(xyz), 0.5), ring=ring, time=turn / 60)


def enriched(sensor: Sensor, rings: Array, cloud: PointCloud, target: Sensor | None = None) -> PointCloud:
    enricher = Enricher(lambda frame, _: frame.cloud, RaySegment(), sensor, rings, target)
    return enricher(Frame(index=0, stamp=0.0, cloud=cloud), ())


@settings(max_examples=60, deadline=None)
@given(sensors(), st.data())
def test_points_are_added_between_the_measured_ones(sensor: Sensor, data: st.DataObject) -> None:
    count = sensor.ring_count
    seen = np.array(data.draw(st.lists(st.booleans(), min_size=count, max_size=count)))
    rings, cloud = np.arange(count), scan_of(sensor, seen)
    found = enriched(sensor, rings, cloud)
    np.testing.assert_array_equal(found.xyz[: len(cloud)], cloud.xyz)
    new = found.select(~found.measured)
    assert len(new) == len(found) - len(cloud)
    if seen.sum() < 2:
        assert len(new) == 0
        return
    rho, measured = np.hypot(*new.xyz[:, :2].T), np.hypot(*cloud.xyz[:, :2].T)
    assert (rho >= measured.min() - 1e-3).all()
    assert (rho <= measured.max() + 1e-3).all()
    assert np.isfinite(new.sigma).all()
    assert (new.sigma > 0).all()
    assert (new.xyz[:, 2] >= GROUND - 1e-3).all()


@settings(max_examples=20, deadline=None)
@given(sensors(), st.randoms(use_true_random=False))
def test_the_order_of_the_rings_does_not_matter(sensor: Sensor, random: object) -> None:
    rings = np.arange(sensor.ring_count)
    cloud = scan_of(sensor, np.ones(sensor.ring_count, bool))
    shuffled = rings.copy()
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    for order in (rings[::-1], shuffled):
        np.testing.assert_array_equal(enriched(sensor, order, cloud).xyz, enriched(sensor, rings, cloud).xyz)


@settings(max_examples=20, deadline=None)
@given(sensors(), st.integers(2, 6))
def test_dropped_rings_are_predicted_on_their_own_lines(sensor: Sensor, step: int) -> None:
    rings = np.arange(sensor.ring_count)
    cloud = scan_of(sensor, rings % step == 0)
    new = enriched(sensor, rings[::step], cloud, sensor)
    assert new.ring is not None
    added = new.select(~new.measured)
    assert added.ring is not None
    lines = np.tan(sensor.elevation)[added.ring] * np.hypot(*added.xyz[:, :2].T) + sensor.offset[added.ring]
    np.testing.assert_allclose(added.xyz[:, 2], lines, atol=2e-3)


@pytest.mark.parametrize("method", [RaySegment(), Joint(), *(COMPLETIONS.load(name)() for name in COMPLETIONS.names())])
@pytest.mark.parametrize("rings", [0, 1, 2])
def test_a_method_predicts_nothing_without_rays_between_rings(method: Method, rings: int) -> None:
    sensor = Sensor("two", np.deg2rad([2.0, -2.0]), np.zeros(2))
    used = np.arange(2)[:rings]
    cloud = scan_of(sensor, np.isin(np.arange(2), used))
    grid = RayGrid(sensor, 360)  # the rings themselves
    prediction = method(SparseScan(cloud, sensor, used, columns=360), grid)
    assert not prediction.trusted.any()
    assert not prediction.ranges.any()
    assert prediction.ranges.shape == prediction.sigma.shape == grid.shape
