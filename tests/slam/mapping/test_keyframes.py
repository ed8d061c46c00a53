"""Which frames become keyframes, what they hold, and where it is kept."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.mapping.keyframes import COORDINATE_STEP, Keyframe, Keyframes
from slam.settings import KeyframeSettings


def cloud(*points: tuple[float, float, float], intensity: float = 0.5, colour: Array | None = None) -> PointCloud:
    xyz = np.array(points, float).reshape(-1, 3)
    return PointCloud(xyz, np.full(len(xyz), intensity), colour=colour)


def at(x: float, degrees: float = 0.0) -> Array:
    pose = se3.exp(np.array([0, 0, np.deg2rad(degrees), 0, 0, 0]))
    pose[0, 3] = x
    return pose


def drive(keyframes: Keyframes, poses: list[Array]) -> list[int]:
    """Frames at which keyframes begin, as they are given out."""
    done = [keyframes.add(cloud((10, 0, 0)), pose, index, 0.0) for index, pose in enumerate(poses)]
    return [keyframe.index for keyframe in (*done, keyframes.finish()) if keyframe]


def random_cloud(seed: int) -> PointCloud:
    rng = np.random.default_rng(seed)
    xyz = rng.uniform((10, -40, -1), (40, 40, 1), (500, 3))
    return PointCloud(xyz, rng.random(500), colour=rng.integers(1, 256, (500, 3)))


def same(a: Keyframe, b: Keyframe) -> bool:
    def fields(keyframe: Keyframe) -> tuple[bytes, ...]:
        cloud, view = keyframe.cloud, keyframe.view
        assert cloud.colour is not None
        arrays = (keyframe.pose, cloud.xyz, cloud.intensity, cloud.colour, view.nearest)
        return tuple(array.tobytes() for array in arrays)

    same = (a.index, a.travelled, a.view.first_row) == (b.index, b.travelled, b.view.first_row)
    return same and fields(a) == fields(b)


def test_a_keyframe_begins_after_a_distance() -> None:
    """Every 0.8 m, from the last keyframe on: 0, 2.4, 4.8."""
    assert drive(Keyframes(), [at(0.8 * frame) for frame in range(8)]) == [0, 3, 6]


def test_a_keyframe_begins_after_a_rotation() -> None:
    assert drive(Keyframes(), [at(0, 15 * frame) for frame in range(5)]) == [0, 2, 4]


def test_a_standing_sensor_has_one_keyframe() -> None:
    assert drive(Keyframes(), [at(0.0)] * 50) == [0]


def test_a_keyframe_is_complete_when_the_next_begins() -> None:
    keyframes = Keyframes()
    assert keyframes.add(cloud((10, 0, 0)), at(0), 7, 1.5) is None
    assert keyframes.add(cloud((10, 0, 0)), at(1), 8, 2.5) is None
    assert len(keyframes) == 0
    done = keyframes.add(cloud((10, 0, 0)), at(2.5), 9, 4.0)
    assert done is not None
    assert (done.index, done.travelled) == (7, 1.5)
    np.testing.assert_array_equal(done.pose, at(0))
    assert [keyframe.index for keyframe in keyframes] == [7]
    assert keyframes.finish() is not None
    assert keyframes.finish() is None
    assert [keyframe.index for keyframe in keyframes] == [7, 9]


def test_a_keyframe_gathers_the_scans_up_to_the_next() -> None:
    """The second scan is turned to the left, 1 m ahead, and sees the first one's point again."""
    keyframes = Keyframes()
    keyframes.add(cloud((10.04, 0.04, 0.02), intensity=0.2), at(0), 0, 0.0)
    keyframes.add(cloud((9.06, 0.08, 0.04), (3, 0, 0), intensity=0.4), at(1), 1, 1.0)
    keyframes.add(cloud((0, -5, 0), intensity=0.6), at(1, 15), 2, 1.0)
    keyframe = keyframes.finish()
    assert keyframe is not None
    aside = 5 * np.sin(np.deg2rad(15)) + 1, -5 * np.cos(np.deg2rad(15)), 0
    expected = np.array([(10.05, 0.06, 0.03), (4, 0, 0), aside])
    assert keyframe.cloud.xyz == pytest.approx(expected, abs=COORDINATE_STEP / 2 + 1e-5)
    assert keyframe.cloud.intensity == pytest.approx([0.3, 0.4, 0.6], abs=0.5 / 255 + 1e-6)
    assert keyframe.cloud.colour is None


def test_colours_are_kept_and_black_is_not_averaged_in() -> None:
    """Two scans coloured a point red and dark red, a third did not see it; no scan saw another point."""
    keyframes = Keyframes()
    for red in (200, 0, 100):
        keyframes.add(cloud((5, 0, 0), (9, 0, 0), colour=np.array([[red, 0, 0], [0, 0, 0]])), at(0), 0, 0.0)
    keyframe = keyframes.finish()
    assert keyframe is not None
    assert keyframe.cloud.colour is not None
    assert keyframe.cloud.colour.tolist() == [[150, 0, 0], [0, 0, 0]]


def test_points_out_of_range_are_left_out() -> None:
    keyframes = Keyframes(KeyframeSettings(min_range=2.5, max_range=60))
    keyframes.add(cloud((2, 0, 0), (3, 0, 0), (59, 0, 0), (61, 0, 0)), at(0), 0, 0.0)
    keyframe = keyframes.finish()
    assert keyframe is not None
    assert keyframe.cloud.xyz[:, 0] == pytest.approx([3, 59], abs=COORDINATE_STEP)


def test_points_with_a_large_sigma_are_left_out() -> None:
    """Neither of the scan that begins a keyframe nor of those that follow: nothing of them reaches the map."""
    keyframes = Keyframes(KeyframeSettings(max_sigma=0.3))
    for frame in range(2):
        scan = cloud((5, 0, 0), (9, frame, 0), (13, frame, 0))
        keyframes.add(replace(scan, sigma=np.array([0.02, 0.29, 0.31])), at(0), frame, 0.0)
    keyframe = keyframes.finish()
    assert keyframe is not None
    assert sorted(keyframe.cloud.xyz[:, 0]) == pytest.approx([5, 9, 9], abs=COORDINATE_STEP)


@pytest.mark.parametrize("memory_mb", [0.0, 0.1, 1000.0])
def test_keyframes_are_read_back_unchanged(memory_mb: float) -> None:
    """On disk, half on disk, in memory: the same bytes."""
    keyframes = Keyframes(KeyframeSettings(memory_mb=memory_mb))
    given = [keyframes.add(random_cloud(frame), at(3.0 * frame), frame, 3.0 * frame) for frame in range(6)]
    given = [*given[1:], keyframes.finish()]
    assert len(keyframes) == 6
    for before, after in zip(given, keyframes, strict=True):
        assert before is not None
        assert same(before, after)
    last = given[-1]
    assert last is not None
    assert same(last, keyframes[-1])
    with pytest.raises(IndexError):
        keyframes[6]


def test_the_oldest_keyframes_are_moved_to_disk_beyond_the_budget() -> None:
    keyframes = Keyframes(KeyframeSettings(memory_mb=0.1))
    for frame in range(12):
        keyframes.add(random_cloud(frame), at(3.0 * frame), frame, 0.0)
    held = keyframes.spill
    assert 0 < held.in_memory <= 100_000
    assert held.on_disk > 0


@pytest.mark.parametrize("memory_mb", [0.1, 1000.0])
def test_a_forgotten_keyframe_takes_no_memory_and_the_others_stay(memory_mb: float) -> None:
    keyframes = Keyframes(KeyframeSettings(memory_mb=memory_mb))
    given = []
    for frame in range(6):
        given.append(keyframes.add(random_cloud(frame), at(3.0 * frame), frame, 3.0 * frame))
        if frame >= 2:
            before = keyframes.spill.in_memory
            keyframes.forget(frame - 1)
            assert keyframes.spill.in_memory < before
    assert keyframes.spill.on_disk == 0
    assert [place.index for place in map(keyframes.place, range(5))] == list(range(5))
    with pytest.raises(LookupError, match="forgotten"):
        keyframes.spill.read(1)
    first = given[1]
    assert first is not None
    assert same(first, keyframes[0])


def test_a_point_takes_seven_bytes_and_three_more_with_colour() -> None:
    """Beside the range image of its scan: one row here."""
    grid = [(x, y, 0.0) for x in np.arange(5, 15, 0.25) for y in np.arange(5, 15, 0.25)]
    sizes = []
    for colour in (None, np.ones((len(grid), 3))):
        keyframes = Keyframes()
        keyframes.add(cloud(*grid, colour=colour), at(0), 0, 0.0)
        keyframes.finish()
        sizes.append(keyframes.spill.in_memory)
    assert sizes[0] == 12 + 7 * len(grid) + 2 * 720
    assert sizes[1] - sizes[0] == 3 * len(grid)


def test_the_temporary_folder_is_left_empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even while it runs: a program that is killed leaves nothing behind."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    keyframes = Keyframes(KeyframeSettings(memory_mb=0))
    for frame in range(3):
        keyframes.add(random_cloud(frame), at(3.0 * frame), frame, 0.0)
    assert keyframes.spill.on_disk > 0
    assert list(tmp_path.iterdir()) == []


def test_empty_scans_make_an_empty_keyframe() -> None:
    keyframes = Keyframes()
    keyframes.add(cloud(), at(0), 0, 0.0)
    keyframe = keyframes.finish()
    assert keyframe is not None
    assert len(keyframe.cloud) == 0
    assert keyframe.view.nearest.shape == (0, 720)


def test_without_scans_there_are_no_keyframes() -> None:
    keyframes = Keyframes()
    assert keyframes.finish() is None
    assert list(keyframes) == []
