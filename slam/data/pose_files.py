"""Trajectories as text: KITTI's (a 3x4 pose a line) and TUM's (`stamp tx ty tz qx qy qz qw`)."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data.cloud import Array
from slam.data.errors import InputError


def read_poses(path: Path) -> tuple[Array | None, Array]:
    """Stamps (N,) [s], or None for KITTI's format, and poses (N, 4, 4).

    Raises InputError where the file is missing, empty, not made of numbers or of neither format.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numpy warns of an empty file; the message below says more
            table = np.loadtxt(path, ndmin=2)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except ValueError as error:
        raise InputError(f"{path}: not a table of numbers ({error}); a KITTI or TUM trajectory is expected") from error
    if table.size == 0:
        raise InputError(f"{path}: no poses in it; a KITTI or TUM trajectory is expected")
    if table.shape[1] not in (8, 12):
        raise InputError(f"{path}: {table.shape[1]} columns; KITTI's trajectories have 12, TUM's 8")
    if not np.isfinite(table).all():
        line = int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0]) + 1
        raise InputError(f"{path}: line {line} holds a value that is not finite; remove or repair it")
    poses = np.tile(np.eye(4), (len(table), 1, 1))
    if table.shape[1] == 12:
        poses[:, :3, :4] = table.reshape(-1, 3, 4)
        return None, poses
    if (np.linalg.norm(table[:, 4:], axis=1) < 1e-6).any():
        raise InputError(f"{path}: a quaternion of length zero; columns are stamp tx ty tz qx qy qz qw")
    poses[:, :3, :3] = Rotation.from_quat(table[:, 4:]).as_matrix()
    poses[:, :3, 3] = table[:, 1:4]
    return table[:, 0], poses


def kitti_text(poses: Array) -> str:
    """Poses (N, 4, 4) as KITTI writes them, with digits enough for a micrometre at 10 km."""
    return "".join(" ".join(f"{value:.10g}" for value in pose[:3].ravel()) + "\n" for pose in poses)


def tum_text(stamps: Array, poses: Array) -> str:
    """Stamps (N,) and poses (N, 4, 4) as TUM writes them; w of the quaternion is not negative."""
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat(canonical=True)
    rows = np.column_stack([poses[:, :3, 3], quaternions])
    return "".join(
        f"{stamp:.9f} " + " ".join(f"{value:.10g}" for value in row) + "\n"
        for stamp, row in zip(stamps, rows, strict=True)
    )
