"""True poses in recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slam.data import se3
from slam.data.dataset import open_dataset
from slam.data.recordings.recording import Recording
from slam.data.recordings.writer import RecordingWriter
from tests.slam.data.recordings.conftest import Event, clouds, mounting, nanoseconds

Record = Callable[..., Path]


def pose(at: float) -> Any:
    """In a bend, 5 m/s."""
    return se3.exp(at * np.array([0, 0, 0.2, 5, 0, 0]))


WANTED = np.array([se3.inverse(pose(0.1)) @ pose(0.1 * number + 0.1) for number in range(10)])


def odometry(topic: str, times: Sequence[float], child: str = "velodyne", T: Any = np.eye(4)) -> list[Event]:
    """Of a body at T_lidar_body."""

    def event(at: float) -> Event:
        return at, lambda writer, recorded: writer.write(
            topic, recorded, writer.odometry(nanoseconds(at), "map", child, pose(at) @ T)
        )

    return [event(at) for at in times]


def opened(record: Record, *events: Event, form: str = "bag", **said: str) -> Any:
    return open_dataset(record([*clouds(), *events], form), **said)


TIMES = np.arange(0, 1.3, 0.02).tolist()


@pytest.mark.parametrize("form", ["bag", "mcap"])
def test_odometry_that_is_called_truth(record: Record, form: str) -> None:
    data = opened(record, *odometry("/ground_truth/odom", TIMES), form=form)
    assert data.topics["truth"] == "/ground_truth/odom"
    np.testing.assert_allclose(data.ground_truth, WANTED, atol=1e-4)
    assert data.problems == ()


def test_what_a_robot_believes_is_no_truth_unless_somebody_says_so(record: Record) -> None:
    data = opened(record, *odometry("/odom", TIMES))
    assert data.ground_truth is None
    assert "/odom (Odometry, 65), none of which is called truth" in data.problems[0].message
    said = opened(record, *odometry("/odom", TIMES), truth_topic="/odom")
    np.testing.assert_allclose(said.ground_truth, WANTED, atol=1e-4)


def test_poses_of_another_frame_are_brought_to_the_lidar(record: Record) -> None:
    T = se3.exp(np.array([0.1, 0, 1.5, 0.3, -0.2, -1.0]))  # T_lidar_base
    events = odometry("/gt", TIMES, "base_link", T)
    data = opened(record, *events, *mounting({("base_link", "velodyne"): se3.inverse(T)}))
    np.testing.assert_allclose(data.ground_truth, WANTED, atol=1e-4)
    unknown = opened(record, *events)
    assert [problem.kind for problem in unknown.problems] == ["unknown frame of truth"]


def test_poses_and_paths(record: Record) -> None:
    def stamped(writer: RecordingWriter, at: float) -> Any:
        return writer.stamped_pose(nanoseconds(at), "map", pose(at))

    def path(writer: RecordingWriter, recorded: int) -> None:
        poses = [stamped(writer, at) for at in TIMES]
        writer.write("/truth", recorded, writer.make("nav_msgs/msg/Path", header=poses[0].header, poses=poses))

    def single(at: float) -> Event:
        return at, lambda writer, recorded: writer.write("/truth", recorded, stamped(writer, at))

    for events in ([(1.2, path)], [single(at) for at in TIMES]):
        np.testing.assert_allclose(opened(record, *events).ground_truth, WANTED, atol=1e-4)


def test_over_a_hole_nothing_is_interpolated(record: Record) -> None:
    times = [at for at in TIMES if not 0.33 < at < 0.87]
    data = opened(record, *odometry("/ground_truth", times))
    known = np.isfinite(data.ground_truth[:, 0, 0])
    assert known.tolist() == [True] * 3 + [False] * 5 + [True] * 2
    assert [problem.kind for problem in data.problems] == ["hole in ground truth"]


def test_one_pose_is_no_truth(record: Record) -> None:
    data = opened(record, *odometry("/ground_truth", [0.5]))
    assert data.ground_truth is None
    assert "at least two are needed" in data.problems[0].message


def test_quaternions_of_zero_are_unknown_poses(record: Record) -> None:
    def zero(writer: RecordingWriter, recorded: int) -> None:
        message = writer.odometry(recorded, "map", "velodyne", pose(0.5))
        message.pose.pose.orientation = writer.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=0.0)
        writer.write("/gt", recorded, message)

    data = opened(record, *odometry("/gt", TIMES), (0.51, zero))
    np.testing.assert_allclose(data.ground_truth, WANTED, atol=1e-4)


def fixes(times: Sequence[float], lost: Sequence[float] = ()) -> list[Event]:
    """Places of the LiDAR, its world's x axis to the north."""

    def event(at: float) -> Event:
        def write(writer: RecordingWriter, recorded: int) -> None:
            x, y, z = pose(at)[:3, 3]
            status = writer.make("sensor_msgs/msg/NavSatStatus", status=-1 if at in lost else 0, service=1)
            message = writer.make(
                "sensor_msgs/msg/NavSatFix",
                header=writer.header(nanoseconds(at), "gps"),
                status=status,
                latitude=float(49 + np.rad2deg(x / 6366000.0)) if at not in lost else 0.0,
                longitude=float(8 - np.rad2deg(y / 6388800.0) / np.cos(np.deg2rad(49))),
                altitude=float(120 + z),
                position_covariance=np.diag([0.25, 0.25, 1.0]).ravel(),
                position_covariance_type=2,
            )
            writer.write("/gps/fix", recorded, message)

        return at, write

    return [event(at) for at in times]


NORTH = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
POSITIONS = np.array([pose(0.1 * number + 0.1)[:3, 3] - pose(0.1)[:3, 3] for number in range(10)]) @ NORTH.T


@pytest.mark.parametrize("form", ["bag", "mcap"])
def test_positions_by_gnss_are_a_ground_truth_without_rotations(record: Record, form: str) -> None:
    data = opened(record, *fixes(np.arange(0, 1.3, 0.1).tolist()), *odometry("/odom", TIMES), form=form)
    assert (data.ground_truth, data.topics["truth"]) == (None, "/gps/fix")
    np.testing.assert_allclose(data.true_positions, POSITIONS, atol=0.01)
    assert [problem.kind for problem in data.problems] == ["positions as ground truth"]
    for word in ("/gps/fix: the ground truth has positions only", "rotation is not compared", "receiver 0.5 m"):
        assert word in data.problems[0].message


def test_poses_come_before_gnss_unless_the_topic_is_named(record: Record) -> None:
    events = [*fixes(np.arange(0, 1.3, 0.1).tolist()), *odometry("/gt", TIMES)]
    data = opened(record, *events)
    assert (data.topics["truth"], data.true_positions, data.problems) == ("/gt", None, ())
    named = opened(record, *events, truth_topic="/gps/fix")
    assert (named.topics["truth"], named.ground_truth) == ("/gps/fix", None)
    assert named.true_positions is not None


def test_where_gnss_is_lost_there_is_no_position(record: Record) -> None:
    times = np.arange(0, 1.3, 0.1).tolist()
    data = opened(record, *fixes(times, lost=times[3:9]), *mounting({("velodyne", "gps"): se3.exp(np.eye(6)[4])}))
    assert np.isfinite(data.true_positions[:, 0]).tolist() == [True] * 2 + [False] * 6 + [True] * 2
    assert [problem.kind for problem in data.problems] == ["hole in ground truth", "positions as ground truth"]
    assert "the antenna is 1.00 m from the LiDAR, which is not corrected" in data.problems[1].message
    none = opened(record, *fixes(times, lost=times))
    assert (none.ground_truth, none.true_positions) == (None, None)
    assert [problem.kind for problem in none.problems] == ["no ground truth"]


def test_only_poses_around_the_part_that_is_used_are_read(record: Record, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[int] = []
    message = Recording.message

    def noted(self: Recording, topic: str, number: int) -> Any:
        read.append(number)
        return message(self, topic, number)

    early = odometry("/gt", np.arange(-100, -31, 0.5).tolist())
    path = record([*clouds(), *early, *odometry("/gt", TIMES)])
    monkeypatch.setattr(Recording, "message", noted)
    data: Any = open_dataset(path, start=100.0)
    np.testing.assert_allclose(data.ground_truth, WANTED, atol=1e-4)
    assert min(read) == len(early)
