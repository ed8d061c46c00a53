"""Ground truth of a folder of scans, poses.txt: the pose of each scan, and the scans without a pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from slam.data import se3
from slam.data.body_frame import body_frame
from slam.data.cloud import Array
from slam.data.pose_files import Trajectory, read_trajectory
from slam.data.problem import Problem, spans
from slam.data.quaternion_order import orders_by_odometry
from slam.data.sensor import conventions_of_folder

#: Between poses farther apart than STEPS times their median step and than HOLE [s], nothing is interpolated. Within
#: 0.3 s, linear interpolation errs by 2 cm for a car that brakes at 2 m/s^2; ground truth at 1 Hz errs more, but there
#: is no better one.
STEPS, HOLE = 1.5, 0.3
ROUNDING = 1e-3  # s: stamps that differ by less are the same, written with different digits
#: Kinds of problems that the odometry resolves.
UNCLEAR, TOLD = "unclear quaternions", "order of quaternions"
UNSETTLED = (UNCLEAR, TOLD)


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """True poses of the LiDAR.

    Attributes:
        poses: (N, 4, 4) T_world_lidar of the scans, the first known one the identity, NaN where unknown; None without
            ground truth.
        readings: The poses for both orders of the file's quaternions, w last ('xyzw') and w first ('wxyz'), between
            which the odometry decides; empty if the user states the order, and for matrices.
        problems: Problems of the ground truth.
    """

    poses: Array | None = None
    readings: Mapping[str, Array] = field(default_factory=dict)
    problems: tuple[Problem, ...] = ()


def read_ground_truth(path: Path, stamps: Array, numbers: Array, known_times: bool) -> GroundTruth:
    """Read poses.txt, and assign poses to scans: by time if they have stamps, by number if numbered, else by row.

    A scan has no pose beyond the ends of the file, in a gap, and where the file contains zeros or NaN. The order of
    quaternions, w last or first, follows from `quaternion: xyzw` or `wxyz` in sensor.yaml, from a header or from the
    motion, in this order; if it follows from none of these, `poses` is None until the odometry decides.

    Args:
        path: Folder of the sequence.
        stamps: (N,) time stamps of the scans [s].
        numbers: (N,) int64, the numbers in their names.
        known_times: The stamps were recorded, not assumed.

    Raises:
        InputError: poses.txt contains something other than poses.
    """
    file = path / "poses.txt"
    if not file.is_file():
        return GroundTruth()
    trajectory = read_trajectory(file, conventions_of_folder(path, None).quaternion)
    return truth_of(file, trajectory, stamps, numbers, known_times)


def truth_of(file: Path, trajectory: Trajectory, stamps: Array, numbers: Array, known_times: bool) -> GroundTruth:
    """Assign poses to scans as in `read_ground_truth`, for a trajectory of the LiDAR read from `file`."""
    if trajectory.stamps is not None and not known_times:
        return _none(f"{file}: its poses have stamps and the scans have none; give times.txt, or poses without stamps")
    match = _by_time(file, trajectory, stamps) if trajectory.stamps is not None else _by_row(file, trajectory, numbers)
    if isinstance(match, GroundTruth):
        return match
    truths = {order: se3.from_first(_taken(poses, match)) for order, poses in trajectory.readings.items()}
    readings = {order: truth for order, truth in truths.items() if truth is not None}
    poses = se3.from_first(_taken(trajectory.poses, match))
    if poses is None:
        return _none(f"{file}: none of its {len(trajectory.poses)} poses is known where there is a scan")
    problems = (*match.problems, *_without_truth(file, np.isnan(poses[:, 0, 0]), match, numbers))
    if readings and trajectory.order is None:
        text = f"{file}: neither a header nor the motion shows whether its quaternions have w last or first"
        text += "; the odometry decides; to state it, write quaternion: xyzw, or wxyz, into sensor.yaml"
        return GroundTruth(None, readings, (*problems, Problem(UNCLEAR, text)))
    if trajectory.told_by == "the motion" and trajectory.order == "wxyz":
        problems = (*problems, _order(f"{file}: by the motion", "wxyz"))
    return GroundTruth(readings.get(trajectory.order or "", poses), readings, problems)


def _order(where: str, order: str) -> Problem:
    """Report the order in which quaternions are read, its source, and how to state it."""
    text = f"{where}, its quaternions have w {'first' if order == 'wxyz' else 'last'}; they are read so"
    return Problem(TOLD, f"{text} (quaternion: {order} in sensor.yaml says the same)")


def settled_truth(truth: GroundTruth, odometry: Array) -> GroundTruth:
    """Resolve the order of quaternions, and check the axes, by comparison with the odometry.

    Args:
        truth: Ground truth of the run's N scans.
        odometry: Poses (M, 4, 4) T_world_lidar of the first M scans.

    Returns:
        The ground truth in the order that agrees with the odometry, and its problems; without poses if neither order
        agrees and nothing else determines it, or if the poses are those of a camera.
    """
    poses, problems = truth.poses, truth.problems
    if truth.readings:
        agreeing = orders_by_odometry({way: read[: len(odometry)] for way, read in truth.readings.items()}, odometry)
        taken = {way for way, read in truth.readings.items() if _same(poses, read)}
        if not agreeing and poses is None:
            text = "poses.txt: its quaternions agree with the odometry neither with w last nor with w first"
            return _none(f"{text}; write quaternion: xyzw, or wxyz, into sensor.yaml")
        if agreeing and taken.isdisjoint(agreeing):
            poses, problems = truth.readings[agreeing[0]], ()
            if agreeing[0] == "wxyz" or taken:
                problems = (_order("poses.txt: by the odometry", agreeing[0]),)
    if poses is not None and body_frame(odometry) == "lidar":
        known = poses[np.isfinite(poses).all(axis=(1, 2))]
        if body_frame(known) == "camera":
            text = "the ground truth moves along its z axis, as a camera does, and the LiDAR along x"
            return _none(f"{text}; give the LiDAR's, inv(T_camera_lidar) @ P @ T_camera_lidar")
    return GroundTruth(poses, {}, problems)


def _same(poses: Array | None, others: Array) -> bool:
    return poses is not None and np.array_equal(poses, others, equal_nan=True)


@dataclass(frozen=True, eq=False)
class _Match:
    """Assignment of rows to N scans.

    Attributes:
        before: (N,) the row before each scan.
        after: (N,) the row after each scan.
        share: (N,) position of the scan between the two, 0 to 1.
        inside: (N,) bool, the scan is within the range of the rows.
        hole: (N,) bool, the two rows are too far apart.
        problems: Problems of the rows.
    """

    before: Array
    after: Array
    share: Array
    inside: Array
    hole: Array
    problems: tuple[Problem, ...] = ()


def _by_time(file: Path, trajectory: Trajectory, stamps: Array) -> _Match | GroundTruth:
    """Find the rows around each scan's stamp."""
    assert trajectory.stamps is not None
    rows = np.flatnonzero(np.isfinite(trajectory.stamps))
    rows = rows[np.argsort(trajectory.stamps[rows], kind="stable")]
    times = trajectory.stamps[rows]
    new = np.concatenate([[True], np.diff(times) > 0])[: len(times)]
    backward = int((np.diff(trajectory.stamps) < 0).sum())
    rows, times, doubled = rows[new], times[new], int((~new).sum())
    if len(rows) < 2:
        return _none(f"{file}: {len(rows)} poses with a stamp of their own; at least two are needed")
    problems = []
    if backward or doubled:
        text = f"{file}: {doubled} stamps are there twice, {backward} are earlier than the one before"
        problems.append(Problem("unsorted truth", f"{text}; sorted, and the first of each is taken"))
    inside = (stamps >= times[0] - ROUNDING) & (stamps <= times[-1] + ROUNDING)
    if not inside.any():
        theirs, ours = (f"{at[0]:.3f} to {at[-1]:.3f} s" for at in (times, stamps))
        return _none(
            f"{file}: its stamps, {theirs}, do not overlap with those of the scans, {ours}; are both of one clock?"
        )
    before, after, share = se3.neighbours(times, stamps)
    hole = times[after] - times[before] > max(STEPS * float(np.median(np.diff(times))), HOLE) + ROUNDING
    near = [
        np.abs(stamps - times[at]) <= ROUNDING for at in (before, after)
    ]  # a row at the scan's own stamp: nothing to interpolate
    before, after = np.where(near[1], after, before), np.where(near[0], before, after)
    return _Match(rows[before], rows[after], share, inside, hole & ~near[0] & ~near[1], tuple(problems))


def _by_row(file: Path, trajectory: Trajectory, numbers: Array) -> _Match | GroundTruth:
    """Find the row of each scan, by its frame number if the file or the number of rows allows it."""
    rows, count = np.arange(len(numbers)), len(trajectory.poses)
    if trajectory.numbers is not None:
        row_of = {int(number): row for row, number in enumerate(trajectory.numbers)}
        rows = np.array([row_of.get(int(number), -1) for number in numbers])
    elif count != len(numbers) and count > numbers[-1]:
        rows = numbers
    elif count != len(numbers) and (np.diff(numbers) != 1).any():
        text = f"{file}: {count} poses for {len(numbers)} scans, the last of which is number {numbers[-1]}"
        return _none(f"{text}; a pose is needed for every scan, or for every number, since some are missing")
    inside = (rows >= 0) & (rows < count)
    rows = np.where(inside, rows, 0)
    return _Match(rows, rows, np.zeros(len(rows)), inside, np.zeros(len(rows), bool))


def _taken(poses: Array, match: _Match) -> Array:
    """Interpolate poses (N, 4, 4) of the scans from a file's (M, 4, 4); NaN where there is none."""
    truth = np.full((len(match.share), 4, 4), np.nan)
    start, end = poses[match.before], poses[match.after]
    known = match.inside & ~match.hole & np.isfinite(start).all(axis=(1, 2)) & np.isfinite(end).all(axis=(1, 2))
    truth[known] = se3.blend(start[known], end[known], match.share[known])
    return truth


def _without_truth(file: Path, lost: Array, match: _Match, numbers: Array) -> tuple[Problem, ...]:
    """Report the scans (N,) without a pose, one Problem per reason."""
    reasons = {
        "poses shorter than scans": (~match.inside, "beyond the poses"),
        "hole in ground truth": (match.inside & match.hole, "between poses that are too far apart in time"),
        "unknown pose": (lost & match.inside & ~match.hole, "where the file contains zeros or NaN"),
    }
    found = []
    for kind, (which, why) in reasons.items():
        if which.any():
            text = f"{file}: {int(which.sum())} of {len(lost)} scans are {why}"
            found.append(Problem(kind, f"{text}; these have no ground truth: {_named(numbers, which)}"))
    return tuple(found)


def _named(numbers: Array, which: Array) -> str:
    """Format the numbers of the scans (N,) bool as ranges."""
    at = np.flatnonzero(which)
    cuts = [0, *(np.flatnonzero(np.diff(at) > 1) + 1), len(at)]
    return spans([(int(numbers[at[first]]), int(numbers[at[last - 1]])) for first, last in pairwise(cuts)])


def _none(text: str) -> GroundTruth:
    return GroundTruth(problems=(Problem("no ground truth", f"{text}; there is no ground truth"),))
