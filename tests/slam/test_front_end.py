"""Input selection: full scan or 16 rings."""

from __future__ import annotations

from typing import Any

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
    vlp16 = RingFrontEnd(FrontEndSettings(input="16", ring_selection="vlp16"))(frame, [])
    assert vlp16.ring is not None
    assert len(np.unique(vlp16.ring)) == 9
    pooled = RingFrontEnd(FrontEndSettings(input="16", ring_selection="average-pool"))(frame, [])
    assert pooled.ring is not None
    assert np.unique(pooled.ring).tolist() == list(range(16))


def test_input_16_without_rings_is_an_error(frame: Frame) -> None:
    ringless = Frame(0, 0.0, PointCloud(frame.cloud.xyz, frame.cloud.intensity))
    with pytest.raises(InputError, match="--sensor"):
        RingFrontEnd(FrontEndSettings(input="16"))(ringless, [])
    assert RingFrontEnd(FrontEndSettings(input="64"))(ringless, []) is ringless.cloud


def test_scans_of_a_16_ring_sensor_are_unchanged(frame: Frame) -> None:
    assert RingFrontEnd(FrontEndSettings(input="16"), load_sensor("vlp16"))(frame, []) is frame.cloud


def cloud_of(rings: int, seen: int | None = None) -> PointCloud:
    """A point a ring, of the rings that are `seen`."""
    seen = seen or rings
    return PointCloud(np.ones((seen, 3)), np.ones(seen), ring=np.arange(rings)[-seen:])


@pytest.mark.parametrize(
    ("rings", "kept"),
    [
        (16, list(range(16))),
        (32, list(range(0, 32, 2))),
        (40, [0, 2, 5, 7, 10, 12, 15, 17, 20, 22, 25, 27, 30, 32, 35, 37]),
        (64, list(range(0, 64, 4))),
        (128, list(range(0, 128, 8))),
    ],
)
@pytest.mark.parametrize("known", ["by sensor", "counted", "by the first scan"])
def test_16_of_any_number_of_rings(rings: int, kept: list[int], known: str) -> None:
    settings, sensor = FrontEndSettings(input="16"), Sensor("s", np.linspace(0.3, -0.3, rings), np.zeros(rings))
    front_end = {
        "by sensor": RingFrontEnd(settings, sensor),
        "counted": RingFrontEnd(settings, rings=rings),
        "by the first scan": RingFrontEnd(settings),
    }[known]
    for cloud in (cloud_of(rings), cloud_of(rings, seen=3)):
        given = front_end(Frame(0, 0.0, cloud), [])
        assert given.ring is not None
        assert given.ring.tolist() == [ring for ring in kept if ring in cloud.ring]
    assert len(RingFrontEnd(FrontEndSettings(input="full"), sensor)(Frame(0, 0.0, cloud_of(rings)), [])) == rings


@pytest.mark.parametrize(
    ("rings", "wanted", "kept"),
    [(64, 32, range(0, 64, 2)), (128, 32, range(0, 128, 4)), (32, 8, range(0, 32, 4)), (32, 32, range(32))],
)
def test_any_number_of_rings(rings: int, wanted: int, kept: range) -> None:
    for settings in (FrontEndSettings(input=str(wanted)), FrontEndSettings(input="enriched", enriched_rings=wanted)):
        given = RingFrontEnd(settings, rings=rings)(Frame(0, 0.0, cloud_of(rings)), [])
        assert given.ring is not None
        assert given.ring.tolist() == list(kept)


@pytest.mark.parametrize(
    ("rings", "setting", "fault"),
    [
        (32, {"phase": 2}, "0 to 1 exist for 16 of 32 rings"),
        (128, {"ring_selection": "vlp16"}, "selects 16 of 64 rings, not 16 of 128"),
        (40, {"ring_selection": "average-pool"}, "selects 16 of 64 rings, not 16 of 40"),
    ],
)
def test_patterns_of_other_numbers_of_rings_are_refused_at_once(
    rings: int, setting: dict[str, Any], fault: str
) -> None:
    with pytest.raises(InputError, match=fault):
        RingFrontEnd(FrontEndSettings(input="16", **setting), rings=rings)
    RingFrontEnd(FrontEndSettings(input="full", **setting), rings=rings)
