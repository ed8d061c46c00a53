"""Trajectory files: KITTI's (a 3x4 pose per line), TUM's (`stamp tx ty tz qx qy qz qw`), and similar formats."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data.body_frame import rotations
from slam.data.cloud import Array
from slam.data.conventions import ORDERS
from slam.data.errors import InputError
from slam.data.pose_table import PoseTable, read_pose_table
from slam.data.quaternion_order import as_rotations, order_by_motion
from slam.data.stamp_digits import epoch_unit, seconds_of

#: Whole numbers up to this in the first of 13 or 17 columns are frame numbers; stamps are larger, or have fractions.
MOST_FRAMES = 1e7
LONGEST_STEP = 100.0  # s, median step between poses; a larger one is in another unit
LENGTH = 0.05  # tolerance of a quaternion's length
NAMES_REMEDY = "'# stamp tx ty tz qx qy qz qw' or '... qw qx qy qz'"

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses of a file.

    Attributes:
        poses: (N, 4, 4) T_world_body, NaN where the file has no pose (zeros or NaN).
        lines: (N,) the line of each pose in the file.
        stamps: (N,) time stamps [s], None if the file has none.
        numbers: (N,) int64, the frame numbers of the poses, None if the file has none.
        readings: The poses for both orders of the quaternions, 'xyzw' and 'wxyz'; empty if the user states the order,
            and for matrices.
        order: Order in which `poses` are read; None for matrices, and if it is unknown and TUM's is assumed.
        told_by: Source of the order: 'the user', 'a header', 'the motion', or '' without one.
    """

    poses: Array
    lines: Array
    stamps: Array | None = None
    numbers: Array | None = None
    readings: Mapping[str, Array] = field(default_factory=dict)
    order: str | None = None
    told_by: str = ""


def read_poses(path: Path, quaternion: str | None = None) -> tuple[Array | None, Array]:
    """Read stamps (N,) [s], None for KITTI's format, and poses (N, 4, 4), all of which must be known.

    A warning is logged if only the motion shows that quaternions have w first. See `read_whole_trajectory`.
    """
    trajectory = read_whole_trajectory(path, quaternion)
    if (note := w_first_note(path, trajectory)) is not None:
        log.warning(note)
    return trajectory.stamps, trajectory.poses


def w_first_note(path: Path, trajectory: Trajectory) -> str | None:
    """Return a note that quaternions are not in TUM's order, if only the motion shows it; None otherwise."""
    if trajectory.order == "wxyz" and trajectory.told_by == "the motion":
        return f"{path}: judging by the motion, its quaternions have w first; a header line states it: {NAMES_REMEDY}"
    return None


def read_whole_trajectory(path: Path, quaternion: str | None = None) -> Trajectory:
    """Read the trajectory of a file in which every pose is known.

    Raises:
        InputError: As in `read_trajectory`, or a pose is unknown, or the rows are numbered.
    """
    trajectory = read_trajectory(path, quaternion)
    unknown = ~np.isfinite(trajectory.poses).all(axis=(1, 2))
    if unknown.any():
        line = trajectory.lines[int(np.argmax(unknown))]
        fault = "a value that is not finite, zeros, or a quaternion of length zero"
        raise InputError(f"{path}: line {line} has no pose but {fault}; remove or repair it")
    if trajectory.numbers is not None:
        raise InputError(f"{path}: its first column numbers the frames; remove it, or give the frames' stamps instead")
    return trajectory


def read_trajectory(path: Path, quaternion: str | None = None) -> Trajectory:
    """Read the poses of a file.

    Formats: KITTI's (12 columns, or 16), also after a stamp or a frame number; TUM's (8); EuRoC's (17); and any columns
    that a header names.

    Args:
        path: The file.
        quaternion: Order of quaternions, 'xyzw' or 'wxyz'. Default: as a header names the columns, else as the motion
            shows.

    Raises:
        InputError: The file does not exist, contains something other than numbers, or has another format; or a
            rotation is invalid or mirrored (the message has the line).
    """
    table = read_pose_table(path)
    columns = _named_columns(table.names)
    if columns is not None:
        places, turns = columns[:3], sorted(columns[3:])
        named = {columns[3:]: "wxyz", (*columns[4:], columns[3]): "xyzw"}.get(tuple(turns))
        return _from_quaternions(path, table, table.values[:, [*places, *turns]], quaternion, named)
    count = table.values.shape[1]
    if count in (12, 16):
        return Trajectory(_from_matrices(path, table, table.values), table.lines)
    if count == 13 or (count == 17 and (table.values[:, 13:] == [0, 0, 0, 1]).all()):
        poses, first = _from_matrices(path, table, table.values[:, 1:]), table.values[:, 0]
        if (first == np.round(first)).all() and first.min() >= 0 and first.max() < MOST_FRAMES:
            return Trajectory(poses, table.lines, numbers=first.astype(np.int64))
        return Trajectory(poses, table.lines, _seconds(table))
    if count in (8, 17):  # EuRoC's has velocity and biases after the pose
        return _from_quaternions(path, table, table.values[:, 1:8], quaternion)
    raise InputError(
        f"{path}: {count} columns; KITTI's trajectories have 12, TUM's 8; others need a header like {NAMES_REMEDY}"
    )


def _named_columns(names: tuple[str, ...]) -> tuple[int, ...] | None:
    """Find the columns of x y z and of the quaternion's w x y z in a header; None if it does not name them."""
    turns = {name[-1]: at for at, name in enumerate(names) if name and name[-1] in "wxyz" and _of_rotation(name)}
    places = {
        name[-1]: at
        for at, name in reversed([*enumerate(names)])
        if name and name[-1] in "xyz" and not _of_rotation(name) and (name in "xyz" or name[0] in "pt" or "pos" in name)
    }
    if set(turns) != set("wxyz") or set(places) != set("xyz"):
        return None
    return (*(places[axis] for axis in "xyz"), *(turns[axis] for axis in "wxyz"))


def _of_rotation(name: str) -> bool:
    return name.startswith("q") or any(word in name for word in ("quat", "orient", "rot"))


def _from_matrices(path: Path, table: PoseTable, rows: Array) -> Array:
    """Convert rows (N, 12 or 16) to poses (N, 4, 4), and check the rotations."""
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3] = rows[:, :12].reshape(-1, 3, 4)
    unknown = ~np.isfinite(rows).all(axis=1) | (np.abs(poses[:, :3, :3]).max(axis=(1, 2)) < 1e-6)
    poses[unknown] = np.nan
    wrong = ~unknown
    wrong[~unknown] = ~rotations(poses[~unknown])
    if wrong.any():
        first = int(np.argmax(wrong))
        mirrored = np.linalg.det(poses[first, :3, :3]) < 0
        fault = "mirrored (its determinant is negative)" if mirrored else "not orthonormal"
        raise InputError(
            f"{path}: line {table.lines[first]}: its 3x3 part is {fault}, which is not a rotation; "
            "is it a KITTI trajectory (r11 r12 r13 tx ...)?"
        )
    return poses


def _from_quaternions(
    path: Path, table: PoseTable, values: Array, said: str | None, named: str | None = None
) -> Trajectory:
    """Create a trajectory from values (N, 7): x y z and a quaternion.

    The order of the quaternion is that of the user (`said`), of a header (`named`), or the one that the motion shows.
    """
    quaternions, length = values[:, 3:], np.linalg.norm(values[:, 3:], axis=1)
    known = np.isfinite(values).all(axis=1) & np.isfinite(table.values[:, 0]) & (length > 1e-6)
    wrong = known & (np.abs(length - 1) > LENGTH)
    if wrong.any():
        first = int(np.argmax(wrong))
        fault = f"line {table.lines[first]}: a quaternion of length {length[first]:.3g}, not 1"
        raise InputError(f"{path}: {fault}; columns are stamp tx ty tz qx qy qz qw")
    readings = {}
    for order in ORDERS:
        poses = np.full((len(values), 4, 4), np.nan)
        poses[known] = np.eye(4)
        poses[known, :3, :3] = as_rotations(quaternions[known], order)
        poses[known, :3, 3] = values[known, :3]
        readings[order] = poses
    stamps = _seconds(table)
    if said or named:
        who = "the user" if said else "a header"
        return Trajectory(
            readings[said or named or ""], table.lines, stamps, None, {} if said else readings, said or named, who
        )
    in_time = np.argsort(np.where(known, stamps, np.inf), kind="stable")[: known.sum()]
    told = order_by_motion({order: poses[in_time] for order, poses in readings.items()}) if known.any() else None
    return Trajectory(readings[told or "xyzw"], table.lines, stamps, None, readings, told, "the motion" if told else "")


def _seconds(table: PoseTable) -> Array:
    """Convert the first column (N,) to seconds."""
    stamps = table.values[:, 0]
    if table.stamp_unit is not None:
        return np.asarray(stamps * table.stamp_unit)
    known = stamps[np.isfinite(stamps)]
    steps = np.abs(np.diff(known))
    if epoch_unit(known) or (len(steps) and np.median(steps) > LONGEST_STEP):
        return seconds_of(stamps.tolist())[0]
    return stamps


def kitti_text(poses: Array) -> str:
    """Format poses (N, 4, 4) as KITTI does, with enough digits for a micrometre at 10 km."""
    return "".join(" ".join(f"{value:.10g}" for value in pose[:3].ravel()) + "\n" for pose in poses)


def tum_text(stamps: Array, poses: Array) -> str:
    """Format stamps (N,) and poses (N, 4, 4) as TUM does; w of the quaternion is not negative.

    An unknown pose becomes NaN after its stamp.
    """
    rows = np.full((len(poses), 7), np.nan)
    sound = rotations(poses)
    rows[sound, :3] = poses[sound, :3, 3]
    rows[sound, 3:] = Rotation.from_matrix(poses[sound, :3, :3]).as_quat(canonical=True)
    return "".join(
        f"{stamp:.9f} " + " ".join(f"{value:.10g}" for value in row) + "\n"
        for stamp, row in zip(stamps, rows, strict=True)
    )
