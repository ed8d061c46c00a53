from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slam.data.cloud import PointCloud
from slam.data.errors import InputError
from slam.data.ring_patterns import VLP16_RINGS, drop_rings
from slam.data.sensor import load_sensor


def a_cloud(seed: int, count: int) -> PointCloud:
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-50, 50, (count, 3))
    return PointCloud(xyz, rng.random(count), rng.integers(0, 64, count), rng.random(count))


@given(seed=st.integers(0, 99), count=st.integers(0, 300), phase=st.integers(0, 3))
def test_what_is_kept_is_kept_verbatim(seed: int, count: int, phase: int) -> None:
    cloud = a_cloud(seed, count)
    for pattern, wanted in (("every-4th", range(phase, 64, 4)), ("vlp16", VLP16_RINGS)):
        thin = drop_rings(cloud, pattern, phase)
        rows = np.flatnonzero(np.isin(cloud.ring, wanted))
        for name in ("xyz", "intensity", "ring", "time", "sigma", "measured"):
            assert np.array_equal(getattr(thin, name), getattr(cloud, name)[rows])


def test_the_four_phases_share_out_the_cloud() -> None:
    cloud = a_cloud(1, 500)
    assert sum(len(drop_rings(cloud, "every-4th", phase)) for phase in range(4)) == 500


def test_average_pooling_takes_the_mean_range_of_four_rings_onto_their_mean_line() -> None:
    # Four returns in one azimuth column, at 10, 20, 30 and 40 m along the lasers 0-3.
    sensor, reach, azimuth = load_sensor("hdl64"), np.array([10, 20, 30, 40]), np.deg2rad(0.05)
    rho = reach * np.cos(sensor.elevation[:4])
    z = reach * np.sin(sensor.elevation[:4]) + sensor.offset[:4]
    cloud = PointCloud(
        np.column_stack([rho * np.cos(azimuth), rho * np.sin(azimuth), z]), np.array([0, 0, 1, 1]), np.arange(4)
    )
    pooled = drop_rings(cloud, "average-pool")
    assert len(pooled) == 1
    assert pooled.ring is not None
    assert pooled.ring[0] == 0
    assert pooled.intensity[0] == pytest.approx(0.5)
    line, height = sensor.elevation[:4].mean(), sensor.offset[:4].mean()
    x, y, z0 = pooled.xyz[0].astype(float)
    assert np.rad2deg(np.arctan2(y, x)) == pytest.approx(0.09, abs=1e-4)  # the middle of the column
    assert z0 == pytest.approx(np.tan(line) * np.hypot(x, y) + height, abs=1e-5)
    assert np.hypot(np.hypot(x, y), z0 - height) == pytest.approx(25, abs=1e-4)


def test_average_pooling_leaves_sixteen_rings_of_a_scan(hdl64_scan: Callable) -> None:
    scan = hdl64_scan(columns=400)
    cloud = PointCloud(scan[:, :3], scan[:, 3], np.repeat(np.arange(64), 400), np.full(len(scan), 0.25))
    pooled = drop_rings(cloud, "average-pool")
    assert pooled.ring is not None
    assert pooled.time is not None
    assert np.unique(pooled.ring).tolist() == list(range(16))
    assert len(pooled) == 16 * 400
    assert np.allclose(pooled.time, 0.25)


def test_an_empty_cloud_stays_empty() -> None:
    cloud = PointCloud(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    for pattern in ("every-4th", "vlp16", "average-pool"):
        assert len(drop_rings(cloud, pattern)) == 0


def test_what_cannot_be_is_refused_with_a_remedy() -> None:
    cloud = a_cloud(0, 10)
    with pytest.raises(InputError, match="--sensor"):
        drop_rings(PointCloud(cloud.xyz, cloud.intensity))
    with pytest.raises(InputError, match="did you mean 'every-4th'"):
        drop_rings(cloud, "every4th")
    with pytest.raises(InputError, match="0 to 3"):
        drop_rings(cloud, "every-4th", 4)
    with pytest.raises(InputError, match="vlp16 has 16 rings"):
        drop_rings(cloud, "average-pool", sensor=load_sensor("vlp16"))
