"""The pipeline: from the scans of a sequence to poses and a map."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slam.config import load_config
from slam.data import se3
from slam.data.cloud import HISTORY, Array, Frame, History, PointCloud
from slam.data.dataset import Dataset, open_dataset
from slam.data.errors import InputError
from slam.pipeline import Pipeline
from slam.records import STAGES, FrameRecord
from slam.run import Run
from slam.source import sweep_duration

Drive = Callable[..., Path]
RealData = Callable[[str], Path]


def run(path: Path, *overrides: str, **values: str) -> Run:
    return Pipeline(load_config(None, overrides, **values)).run(open_dataset(path))


def distances(result: Run, truth: Array) -> Array:
    return np.linalg.norm(result.poses[:, :3, 3] - truth[:, :3, 3], axis=1)


def aligned_ate(result: Run) -> float:
    """Root mean square distance [m] after rigid alignment of the positions; an independent implementation."""
    truth = result.ground_truth
    assert truth is not None
    ours, theirs = result.poses[:, :3, 3], truth[:, :3, 3]
    a, b = ours - ours.mean(axis=0), theirs - theirs.mean(axis=0)
    U, _, Vt = np.linalg.svd(b.T @ a)
    R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return float(np.sqrt(np.mean(np.sum((a @ R.T - b) ** 2, axis=1))))


def test_a_sequence_is_tracked(street_drive: Drive, street_poses: Array) -> None:
    result = run(street_drive())
    assert result.counts() == {"frames": 8, "registered": 8, "retried": 0, "degenerate": 0, "failed": 0}
    np.testing.assert_array_equal(result.poses[0], np.eye(4))
    assert distances(result, street_poses).max() < 0.05
    assert np.rad2deg(se3.angle(se3.inverse(street_poses) @ result.poses)).max() < 0.3
    assert result.stamps == pytest.approx(0.1 * np.arange(8))
    assert result.ground_truth == pytest.approx(street_poses, abs=1e-9)
    assert [record.points for record in result.records] == [64 * 600] * 8
    assert all(record.milliseconds.keys() == set(STAGES) for record in result.records)
    assert not result.deskewed


def test_16_channels_are_tracked_with_a_quarter_of_the_points(street_drive: Drive, street_poses: Array) -> None:
    """The street has few features, and the ring pattern, which moves with the car, fits best without motion."""
    result = run(street_drive(), input="16")
    assert [record.points for record in result.records] == [16 * 600] * 8
    counts = result.counts()
    assert counts["registered"] + counts["retried"] == 8
    assert distances(result, street_poses).max() < 0.1


def test_the_map_points_are_on_the_street(street_drive: Drive) -> None:
    points = run(street_drive()).map
    assert len(points) > 10_000
    ground = points.xyz[(np.abs(points.xyz[:, 1]) < 5) & (points.xyz[:, 0] < 30) & (points.xyz[:, 0] > -20)]
    assert np.median(ground[:, 2]) == pytest.approx(-1.7, abs=0.03)


def test_runs_are_deterministic(street_drive: Drive) -> None:
    path = street_drive()
    one, two = run(path), run(path)
    np.testing.assert_array_equal(one.poses, two.poses)
    np.testing.assert_array_equal([r.covariance for r in one.records], [r.covariance for r in two.records])
    np.testing.assert_array_equal(one.map.xyz, two.map.xyz)
    np.testing.assert_array_equal(one.map.intensity, two.map.intensity)


def test_a_pipeline_can_run_twice(street_drive: Drive) -> None:
    pipeline, data = Pipeline(), open_dataset(street_drive())
    np.testing.assert_array_equal(pipeline.run(data).poses, pipeline.run(data).poses)


class HalvingFrontEnd:
    """Keeps every second point; records its arguments."""

    def __init__(self) -> None:
        self.given: list[PointCloud] = []
        self.histories: list[list[tuple[PointCloud, Array]]] = []

    def __call__(self, frame: Frame, history: History) -> PointCloud:
        self.histories.append(list(history))
        self.given.append(frame.cloud.select(np.arange(0, len(frame.cloud), 2)))
        return self.given[-1]


def test_another_front_end_receives_the_frames_and_the_history(street_drive: Drive, street_poses: Array) -> None:
    front_end = HalvingFrontEnd()
    result = Pipeline(make_front_end=lambda: front_end).run(open_dataset(street_drive()))
    assert [record.points for record in result.records] == [64 * 300] * 8
    assert distances(result, street_poses).max() < 0.05
    assert [len(history) for history in front_end.histories] == [min(i, HISTORY) for i in range(8)]
    for i, history in enumerate(front_end.histories):
        first = i - len(history)
        assert all(cloud is front_end.given[first + k] for k, (cloud, _) in enumerate(history))
        for k, (_, T_now_then) in enumerate(history):
            if i >= 2:  # the velocity is unknown before
                truth = se3.inverse(street_poses[i]) @ street_poses[first + k]
                assert np.linalg.norm(T_now_then[:3, 3] - truth[:3, 3]) < 0.1
                assert np.rad2deg(se3.angle(se3.inverse(truth) @ T_now_then)) < 0.5


def test_frames_are_a_slice_of_positions(street_drive: Drive, street_poses: Array) -> None:
    seen: list[FrameRecord] = []
    result = Pipeline().run(open_dataset(street_drive()), slice(2, 7, 2), on_frame=seen.append)
    assert [record.index for record in result.records] == [2, 4, 6]
    assert [record.index for record in seen] == [record.index for record in result.records]
    truth = se3.inverse(street_poses[2]) @ street_poses[[2, 4, 6]]
    assert distances(result, truth).max() < 0.05
    assert result.ground_truth is not None
    assert len(result.ground_truth) == 3


@pytest.mark.parametrize("frames", [slice(8, 20), slice(4, 4), slice(5, 2)])
def test_no_selected_frames_are_an_error(street_drive: Drive, frames: slice) -> None:
    with pytest.raises(InputError, match="no frames in that range; the sequence has 8"):
        Pipeline().run(open_dataset(street_drive()), frames)


def test_deskewing_requires_times(street_drive: Drive) -> None:
    with pytest.raises(InputError, match="the points have no times"):
        run(street_drive(), "front_end.deskew=true")


@pytest.mark.parametrize("deskew", [True, False, None])
def test_deskewing_can_be_switched_off(street_drive: Drive, deskew: bool | None) -> None:
    """Points have times if sensor.yaml does not state motion compensation, and deskewing changes the poses."""
    path = street_drive()
    (path / "sensor.yaml").write_text("model: hdl64\n")
    overrides = [] if deskew is None else [f"front_end.deskew={str(deskew).lower()}"]
    assert run(path, *overrides).deskewed is (deskew is not False)


def test_damaged_scans_are_counted_and_skipped(
    street_drive: Drive, street_scans: list[Array], street_poses: Array
) -> None:
    """NaN in scan 2, scan 4 truncated within a point, scan 6 empty."""
    holes = street_scans[2].copy()
    holes[::10, 1] = np.nan
    path = street_drive({2: holes, 4: street_scans[4].tobytes()[: 20_000 * 16 + 5], 6: b""})
    result = run(path)
    assert result.counts() == {
        "frames": 8,
        "registered": 7,
        "retried": 0,
        "degenerate": 0,
        "failed": 1,
        "non-finite_points": 1,
        "truncated_scan": 1,
        "ring_count": 1,
        "empty_scan": 1,
    }
    assert [record.status for record in result.records].index("failed") == 6
    assert distances(result, street_poses).max() < 0.1
    assert np.isfinite(result.map.xyz).all()
    # An empty scan keeps the prediction, with a large covariance.
    assert result.records[6].points == 0
    assert result.records[6].covariance[3, 3] > 1 > result.records[7].covariance[3, 3]


@pytest.mark.parametrize("channels", ["64", "16"])
def test_a_scan_of_nan_is_empty(street_drive: Drive, street_poses: Array, channels: str) -> None:
    result = run(street_drive({4: np.full((1000, 4), np.nan)}), input=channels)
    assert result.counts() | {"failed": 1, "empty_scan": 1} == result.counts()
    if channels == "64":
        assert distances(result, street_poses).max() < 0.1


def test_the_first_scan_may_be_empty(street_drive: Drive, street_poses: Array) -> None:
    result = run(street_drive({0: b""}))
    assert result.counts()["failed"] == 1
    np.testing.assert_array_equal(result.poses[0], np.eye(4))
    moved = se3.inverse(result.poses[1]) @ result.poses[2:]
    assert moved[:, :3, 3] == pytest.approx((se3.inverse(street_poses[1]) @ street_poses[2:])[:, :3, 3], abs=0.1)


def test_a_sequence_of_empty_scans_finishes(street_drive: Drive) -> None:
    result = run(street_drive(dict.fromkeys(range(8), b"")))
    assert result.counts()["failed"] == 8
    assert len(result.map) == 0


def test_a_scan_off_the_laser_lines_does_not_end_a_16_channel_run(street_drive: Drive) -> None:
    """One scan of noise, as from a wrong or damaged file: with 64 channels it is counted and the run goes on."""
    noise = np.random.default_rng(0).uniform(-30, 30, (20_000, 4))
    assert run(street_drive({4: noise}), input="16").counts()["ring_count"] == 1


@pytest.fixture
def own_folder(tmp_path: Path, street_scans: list[Array]) -> Path:
    """The street as a folder of .npy scans with point times; scan 3 cannot be read."""
    columns = np.dtype([(name, "f4") for name in ("x", "y", "z", "intensity", "time")])
    (tmp_path / "own").mkdir()
    for number, scan in enumerate(street_scans):
        points = np.zeros(len(scan), columns)
        for column, name in enumerate(("x", "y", "z", "intensity")):
            points[name] = scan[:, column]
        points["time"] = np.linspace(0, 0.1, len(scan))
        np.save(tmp_path / "own" / f"{number}.npy", points)
    (tmp_path / "own" / "3.npy").write_bytes(b"junk")
    return tmp_path / "own"


def test_a_scan_that_cannot_be_read_is_counted(own_folder: Path) -> None:
    result = run(own_folder)
    assert result.deskewed
    assert result.counts() | {"frames": 8, "failed": 1, "missing_scan": 1} == result.counts()


def test_required_deskewing_skips_a_scan_that_cannot_be_read(own_folder: Path) -> None:
    assert run(own_folder, "front_end.deskew=true").counts()["missing_scan"] == 1


def test_a_run_is_deskewed_if_a_later_scan_has_times(own_folder: Path) -> None:
    (own_folder / "0.npy").write_bytes(b"junk")
    assert run(own_folder).deskewed


def test_strict_stops_at_the_first_problem(street_drive: Drive, street_scans: list[Array]) -> None:
    path = street_drive({3: street_scans[3].tobytes()[:-7], 5: b""})
    seen: list[FrameRecord] = []
    with pytest.raises(InputError, match=r"000003\.bin: truncated"):
        Pipeline().run(open_dataset(path), strict=True, on_frame=seen.append)
    assert [record.index for record in seen] == [0, 1, 2]


def test_strict_accepts_an_undamaged_sequence(street_drive: Drive) -> None:
    data = open_dataset(street_drive())
    assert len(Pipeline().run(data, slice(3), strict=True).records) == 3


def test_strict_stops_at_a_problem_of_the_data_set(street_drive: Drive) -> None:
    path = street_drive()
    (path / "times.txt").unlink()
    with pytest.raises(InputError, match=r"times\.txt"):
        Pipeline().run(open_dataset(path), strict=True)


def without(path: Path, *numbers: int) -> Dataset:
    """The sequence without these scans."""
    for number in numbers:
        (path / "velodyne" / f"{number:06d}.bin").unlink()
    return open_dataset(path)


def test_missing_scans_do_not_change_the_sweep_duration(street_drive: Drive) -> None:
    """Three of the four remaining stamps are two sweeps after the previous one."""
    data = without(street_drive(), 1, 3, 5)
    assert np.diff(data.stamps) == pytest.approx([0.2, 0.2, 0.2, 0.1])
    assert sweep_duration(data) == pytest.approx(0.1)


def test_files_named_by_times_do_not_change_the_sweep_duration(tmp_path: Path) -> None:
    stamps = 1.4e9 + 0.1 * np.arange(5)
    for stamp in stamps:
        np.save(tmp_path / f"{stamp * 1e6:.0f}.npy", np.zeros((10, 4), np.float32))
    (tmp_path / "times.txt").write_text("".join(f"{stamp:.6f}\n" for stamp in stamps))
    assert sweep_duration(open_dataset(tmp_path)) == pytest.approx(0.1, abs=1e-5)


def test_missing_scans_are_reported_once(street_drive: Drive) -> None:
    """Reported from the numbering; the jump of the stamps is not reported as well."""
    data = without(street_drive(), *range(1, 7))
    assert data.stamps == pytest.approx([0.0, 0.7])
    assert [problem.kind for problem in Pipeline().run(data).problems] == ["gap in numbering"]


@pytest.fixture
def clock_set(street_drive: Drive) -> Path:
    """The clock is a minute ahead from scan 5 on."""
    path = street_drive()
    (path / "times.txt").write_text("".join(f"{0.1 * number + 60 * (number >= 5)}\n" for number in range(8)))
    return path


def test_a_clock_that_jumps_is_counted(clock_set: Path) -> None:
    result = run(clock_set)
    assert result.counts()["stamp_jump"] == 1
    assert result.problems[0].message.startswith("frame 5: its stamp, 60.500 s, is 60.100 s after that of frame 4")


def test_strict_stops_at_a_clock_that_jumps(clock_set: Path) -> None:
    seen: list[FrameRecord] = []
    with pytest.raises(InputError, match="frame 5: its stamp"):
        Pipeline().run(open_dataset(clock_set), strict=True, on_frame=seen.append)
    assert [record.index for record in seen] == [0, 1, 2, 3, 4]


def test_missing_scans_are_skipped(street_drive: Drive, street_poses: Array) -> None:
    result = Pipeline().run(without(street_drive(), 3, 4))
    assert result.counts()["gap_in_numbering"] == 1
    assert distances(result, street_poses[[0, 1, 2, 5, 6, 7]]).max() < 0.05


@pytest.mark.parametrize("preset", ["icp", "scan-to-scan"])
def test_presets_run(street_drive: Drive, street_poses: Array, preset: str) -> None:
    result = Pipeline(load_config(preset)).run(open_dataset(street_drive()))
    assert result.counts()["failed"] == 0
    assert distances(result, street_poses).max() < 0.5


# ---- real data


@pytest.mark.parametrize(("channels", "limit"), [("64", 0.04), ("16", 0.05)])
def test_a_real_sequence_is_tracked(real_data: RealData, channels: str, limit: float) -> None:
    result = run(real_data("kitti_odometry_04"), input=channels)
    assert result.counts() == {"frames": 51, "registered": 51, "retried": 0, "degenerate": 0, "failed": 0}
    assert aligned_ate(result) < limit


@pytest.mark.parametrize("pattern", ["every-4th", "vlp16", "average-pool"])
def test_sparse_rings_do_not_reduce_the_motion(real_data: RealData, pattern: str) -> None:
    """The ring pattern moves with the car and fits without motion at the start; here 1.2 m per frame."""
    config = load_config(None, [f"front_end.ring_selection={pattern}"], input="16")
    result = Pipeline(config).run(open_dataset(real_data("kitti_raw_0013")), slice(40))
    assert result.counts()["failed"] == 0
    truth = result.ground_truth
    assert truth is not None
    assert np.linalg.norm(result.poses[-1, :3, 3]) == pytest.approx(np.linalg.norm(truth[-1, :3, 3]), rel=0.02)


def test_nine_rings_start_at_speed(real_data: RealData) -> None:
    """Two scans of nine rings fit best without motion in cells of 4 m, and with the true motion in finer ones."""
    dataset = open_dataset(real_data("kitti_raw_0013"))
    pipeline = Pipeline(load_config(None, ["front_end.ring_selection=vlp16"], input="16"))
    travelled = []
    for start in range(0, 120, 20):
        result = pipeline.run(dataset, slice(start, start + 20))
        assert result.ground_truth is not None
        distance, true_distance = (
            np.linalg.norm(poses[-1, :3, 3] - poses[0, :3, 3]) for poses in (result.odometry_poses, result.ground_truth)
        )
        travelled.append(float(distance / true_distance))
    assert sum(abs(share - 1) < 0.03 for share in travelled) >= 5, travelled


def test_a_real_scan_with_39_rings(real_data: RealData, tmp_path: Path) -> None:
    """Every fourth of the remaining rings, by their indices."""
    source = real_data("kitti_odometry_04") / "sequences" / "04"
    folder = tmp_path / "sequences" / "04"
    (folder / "velodyne").mkdir(parents=True)
    for name in ("calib.txt", "times.txt"):
        shutil.copy(source / name, folder / name)
    for number in range(8):
        shutil.copy(source / "velodyne" / f"{number:06d}.bin", folder / "velodyne")
    whole = open_dataset(folder)[4].cloud
    assert whole.ring is not None
    first = np.flatnonzero(whole.ring == 39)[0]
    cut = folder / "velodyne" / "000004.bin"
    cut.write_bytes(cut.read_bytes()[: 16 * first])
    result = run(tmp_path, input="16")
    assert result.counts() | {"frames": 8, "registered": 8, "ring_count": 1} == result.counts()
    assert "39 rings where the sensor hdl64 has 64" in result.problems[0].message
    assert result.records[4].points == pytest.approx(np.sum(whole.ring[:first] % 4 == 0), rel=0.1)
    assert np.linalg.norm(np.diff(result.poses[:, :3, 3], axis=0), axis=1) == pytest.approx(1.35, abs=0.15)
