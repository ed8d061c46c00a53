"""Input selection: full scan or 16 rings."""

from __future__ import annotations

import numpy as np
import pytest

from slam.data.cloud import Frame, PointCloud
from slam.data.errors import InputError
from slam.data.sensor import Sensor, load_sensor
from slam.front_end import RingFrontEnd
from slam.settings import FrontEndSettings


@pytest.fixture
def frame() -> Frame:
    """A frame with two points per ring, top to bottom, and all fields."""
    rng, count = np.random.default_rng(0), 128
    cloud = PointCloud(
        xyz=rng.uniform(-20, 20, (count, 3)),
        intensity=rng.random(count),
        ring=np.repeat(np.arange(64), 2),
        time=rng.random(count),
    )
    return Frame(index=0, stamp=0.0, cloud=cloud)


def test_input_64_returns_the_scan_as_recorded(frame: Frame) -> None:
    assert RingFrontEnd(FrontEndSettings(input="64"))(frame, []) is frame.cloud


@pytest.mark.parametrize("phase", [0, 1, 2, 3])
def test_input_16_keeps_every_fourth_ring(frame: Frame, phase: int) -> None:
    cloud = RingFrontEnd(FrontEndSettings(input="16", phase=phase))(frame, [])
    assert cloud.ring is not None
    assert np.unique(cloud.ring).tolist() == list(range(phase, 64, 4))
    kept = np.isin(np.repeat(np.arange(64), 2), range(phase, 64, 4))
    for name in ("xyz", "intensity", "ring", "time", "sigma", "measured"):
        np.testing.assert_array_equal(getattr(cloud, name), getattr(frame.cloud, name)[kept], err_msg=name)


def test_input_16_does_not_change_the_frame(frame: Frame) -> None:
    before = frame.cloud.xyz.copy()
    RingFrontEnd(FrontEndSettings(input="16"))(frame, [])
    np.testing.assert_array_equal(frame.cloud.xyz, before)


def test_other_ring_patterns(frame: Frame) -> None:
    vlp16 = RingFrontEnd(FrontEndSettings(input="16", drop="vlp16"))(frame, [])
    assert vlp16.ring is not None
    assert len(np.unique(vlp16.ring)) == 9
    pooled = RingFrontEnd(FrontEndSettings(input="16", drop="average-pool"))(frame, [])
    assert pooled.ring is not None
    assert np.unique(pooled.ring).tolist() == list(range(16))


def test_input_16_without_rings_is_an_error(frame: Frame) -> None:
    ringless = Frame(0, 0.0, PointCloud(frame.cloud.xyz, frame.cloud.intensity))
    with pytest.raises(InputError, match="--sensor"):
        RingFrontEnd(FrontEndSettings(input="16"))(ringless, [])
    assert RingFrontEnd(FrontEndSettings(input="64"))(ringless, []) is ringless.cloud


def test_scans_of_a_16_ring_sensor_are_unchanged(frame: Frame) -> None:
    assert RingFrontEnd(FrontEndSettings(input="16"), load_sensor("vlp16"))(frame, []) is frame.cloud


def test_input_16_of_sensors_between_16_and_64_rings_is_an_error() -> None:
    sensor = Sensor("hdl32", np.deg2rad(np.linspace(10, -30, 32)), np.zeros(32))
    with pytest.raises(InputError, match="--input 64"):
        RingFrontEnd(FrontEndSettings(input="16"), sensor)
