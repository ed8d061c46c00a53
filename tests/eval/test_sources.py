"""What a user may name as a trajectory, and how trajectories of different systems are brought together."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from eval.compare import compare_rows
from eval.runs import Row, Track, track_row
from eval.sources import Named, Source, in_lidar_frame, labelled, read_source, source_of
from eval.tables import format_comparison
from slam.data import se3
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.pose_files import kitti_text, tum_text
from slam.data.recordings.writer import recording_writer

T_CAMERA_LIDAR = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.2], [1, 0, 0, -0.3], [0, 0, 0, 1.0]])


def bend(count: int = 40) -> Array:
    """A LiDAR on a bend, a metre a pose."""
    return np.array([se3.exp(k * np.array([0, 0, 0.02, 1.0, 0, 0])) for k in range(count)])


def stamps(count: int = 40) -> Array:
    return 100 + 0.1 * np.arange(count)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A recording with Odometry of the car's body, whose LiDAR is fixed 1 m above and 2 m ahead of it, and a Path."""
    T_body_lidar = se3.exp(np.array([0, 0, 0, 2.0, 0, 1.0]))
    with recording_writer(tmp_path / "drive", "bag") as writer:
        writer.write("/tf_static", 1, writer.transforms({("base_link", "lidar"): T_body_lidar}))
        points = np.zeros(3, [("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
        writer.write("/points", 1, writer.cloud(10**9, "lidar", points))
        for time, pose in zip((1e9 * stamps()).astype(int).tolist(), bend(), strict=True):
            body = pose @ se3.inverse(T_body_lidar)
            writer.write("/odom", time, writer.odometry(time, "map", "base_link", body))
    return tmp_path / "drive.bag"


def test_a_topic_has_the_lidars_poses(recording: Path) -> None:
    found = read_source(source_of(f"{recording}:/odom"))
    assert found.row.track.stamps == pytest.approx(stamps(), abs=1e-6)
    assert found.row.track.poses == pytest.approx(bend(), abs=1e-9)
    assert found.notes == ()
    alone = read_source(source_of(str(recording)))  # the only topic with poses
    assert alone.row.track.poses == pytest.approx(bend(), abs=1e-9)


@pytest.mark.parametrize(
    ("topic", "complaint"), [("/odon", "no such topic.*/odom"), ("/points", "holds .*PointCloud2, not poses")]
)
def test_another_topic_is_an_error(recording: Path, topic: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        read_source(source_of(f"{recording}:{topic}"))


def test_one_of_several_topics_has_to_be_named(tmp_path: Path) -> None:
    with recording_writer(tmp_path / "two", "mcap") as writer:
        for time in (1, 2):
            writer.write("/a", time, writer.odometry(time, "map", "", np.eye(4)))
            writer.write("/b", time, writer.stamped_pose(time, "map", np.eye(4)))
    with pytest.raises(InputError, match=r"name one: .*two\.mcap:/a or .*:/b"):
        read_source(source_of(str(tmp_path / "two.mcap")))


def test_files_of_other_systems(tmp_path: Path) -> None:
    """KITTI has no stamps; EuRoC's table has nanoseconds, and w first, as its header says."""
    (tmp_path / "kiss.txt").write_text(kitti_text(bend()))
    rows = [line.split() for line in tum_text(stamps(), bend()).splitlines()]
    lines = [f"{float(row[0]) * 1e9:.0f},{','.join([*row[1:4], row[7], *row[4:7]])}" for row in rows]
    header = "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w [],q_x [],q_y [],q_z []"
    (tmp_path / "vins.csv").write_text("\n".join([header, *lines]))
    kiss, vins = (read_source(source_of(str(tmp_path / name))).row.track for name in ("kiss.txt", "vins.csv"))
    assert kiss.stamps is None
    assert kiss.poses == pytest.approx(bend(), abs=1e-6)
    assert vins.stamps == pytest.approx(stamps())
    assert vins.poses == pytest.approx(bend(), abs=1e-6)


def test_labels(run_folder: Callable[..., Path], tmp_path: Path) -> None:
    (tmp_path / "x" / "16").mkdir(parents=True)
    (tmp_path / "x" / "16" / "glim.txt").write_text("")
    names = [str(run_folder("16", 101.0)), f"GLIM={tmp_path / 'x/16/glim.txt'}", str(tmp_path / "x" / "16")]
    labels = [source.label for source in labelled([source_of(name) for name in names])]
    assert labels == [f"{tmp_path.name}/16", "GLIM", "x/16"]
    assert [source.label for source in labelled([Source(Path("a.bag"), "/odom")])] == ["odom"]
    with pytest.raises(InputError, match="two trajectories have this name; name them LABEL=PATH"):
        labelled([Source(Path("a"), label="A"), Source(Path("b"), label="A")])


def test_a_file_without_a_trajectory_is_an_error(run_folder: Callable[..., Path], tmp_path: Path) -> None:
    run_folder("16", 101.0)
    (tmp_path / "stopped").mkdir()
    (tmp_path / "stopped" / "odometry_tum.txt").write_text("")
    (tmp_path / "empty").mkdir()
    (tmp_path / "points.bin").write_bytes(bytes(range(256)))
    (tmp_path / "words.txt").write_text("Dear reader\n")
    for name, complaint in {
        "": "holds several runs; name those that are compared: .*16",
        "stopped": "a run that was stopped",
        "empty": "neither a finished run",
        "points.bin": "not a text file",
        "words.txt": "not a table of numbers",
        "16:/odom": "is a run folder, which has no topics",
        "words.txt:/odom": "is not a recording",
    }.items():
        with pytest.raises(InputError, match=complaint):
            read_source(source_of(str(tmp_path / name)))
    with pytest.raises(InputError, match="no such file or folder; give a run folder"):
        source_of(str(tmp_path / "nothing"))


def test_camera_poses_are_transformed_into_the_lidar_frame() -> None:
    camera = T_CAMERA_LIDAR @ bend() @ se3.inverse(T_CAMERA_LIDAR)
    ours, theirs = Named(Row("ours", Track(bend()))), Named(Row("KISS", Track(camera)))
    _, found = in_lidar_frame([ours, theirs], T_CAMERA_LIDAR, "calib.txt")
    assert found.row.track.poses == pytest.approx(bend(), abs=1e-9)
    assert found.notes == ("poses of camera 0, transformed into the LiDAR frame by calib.txt",)
    assert in_lidar_frame([theirs, theirs], None, "") == [theirs, theirs]  # all of the same body
    with pytest.raises(InputError, match=r"ours is a LiDAR trajectory .*, KISS one of camera 0 .*--calib calib.txt"):
        in_lidar_frame([ours, theirs], None, "")


def test_rows_without_a_reference_are_compared_with_each_other() -> None:
    slow, fast = bend(), bend()
    fast[:, :3, 3] *= 1.01
    comparison = compare_rows([Row("slow", Track(slow)), Row("fast", Track(fast))], None)
    off = comparison.distances_m["slow"]["fast"]
    assert off == comparison.distances_m["fast"]["slow"]
    assert 0.05 < off < 0.3
    assert comparison.inputs["fast"].path_m == pytest.approx(39.39, abs=0.01)
    assert comparison.inputs["fast"].ate_m is None
    text = format_comparison(comparison)
    assert comparison.notes[0].startswith("no reference: no ATE, RPE or drift; the distances tell")
    assert list(comparison.protocol) == ["distance"]
    assert all(figures.notes == () for figures in comparison.inputs.values())
    assert "ATE\n" not in text
    assert f"{off:.3f}" in text
    with pytest.raises(InputError, match="slow and short: 40 poses against 30"):
        compare_rows([Row("slow", Track(slow)), Row("short", Track(slow[:30]))], None)


def test_a_note_says_that_rows_cover_different_parts() -> None:
    truth = Track(bend(), stamps())
    rows = [track_row("all", truth, truth), track_row("half", Track(bend()[:20], stamps()[:20]), truth)]
    comparison = compare_rows(rows, "truth")
    assert comparison.notes == (
        "the trajectories cover different parts of the reference, so their errors differ: all 39.0 m, half 19.0 m",
    )
