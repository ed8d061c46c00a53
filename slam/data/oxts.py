"""Poses from KITTI's inertial navigation (OXTS RT 3003): packets of latitude, longitude, altitude and attitude."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data import se3
from slam.data.cloud import Array
from slam.data.errors import InputError

#: Equatorial radius [m] of KITTI's development kit.
EARTH_RADIUS = 6378137.0
#: Maximum time between a scan and the nearest packet [s] for ground truth; packets are 0.1 s apart.
FARTHEST_PACKET = 0.15
REMEDY = "copy the file again, or remove the oxts folder to run without ground truth"


def read_packets(files: list[Path]) -> Array:
    """Read packet files.

    Returns:
        (N, 6) float64: latitude, longitude [deg], altitude [m], roll, pitch, yaw [rad]; NaN for a packet without a
        fix, which has zeros.

    Raises:
        InputError: A file cannot be read or is not a packet.
    """
    rows = []
    for path in files:
        try:
            rows.append([float(value) for value in path.read_text(encoding="ascii").split()[:6]])
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: not an OXTS packet ({error}); {REMEDY}") from error
        if len(rows[-1]) < 6 or not np.isfinite(rows[-1]).all():
            raise InputError(f"{path}: an OXTS packet has 30 finite numbers; {REMEDY}")
    packets = np.array(rows, np.float64).reshape(-1, 6)
    packets[(packets[:, :2] == 0).all(axis=1)] = np.nan
    return packets


def imu_poses(packets: Array) -> Array:
    """Convert packets (N, 6) to T_world_imu (N, 4, 4), NaN for packets of NaN.

    The projection is Mercator's at the first latitude, as in KITTI's development kit.
    """
    known = np.isfinite(packets).all(axis=1)
    result = np.full((len(packets), 4, 4), np.nan)
    if not known.any():
        return result
    latitude, longitude, altitude, roll, pitch, yaw = packets[known].T
    scale = np.cos(np.deg2rad(latitude[0]))
    poses = np.tile(np.eye(4), (len(latitude), 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll])).as_matrix()
    poses[:, 0, 3] = scale * EARTH_RADIUS * np.deg2rad(longitude)
    poses[:, 1, 3] = scale * EARTH_RADIUS * np.log(np.tan(np.pi / 4 + np.deg2rad(latitude) / 2))
    poses[:, 2, 3] = altitude
    poses[:, :3, 3] -= poses[0, :3, 3].copy()
    result[known] = poses
    return result


def poses_at(stamps: Array, poses: Array, at: Array) -> Array:
    """Interpolate poses at times `at` (M,).

    Packets lag the scans by 12-25 ms, so the first scan lies before the first packet: the samples are extrapolated by
    one step at either end.

    Args:
        stamps: (N,) increasing times of the samples [s].
        poses: (N, 4, 4) samples; those of NaN are ignored.
        at: (M,) times [s].

    Returns:
        (M, 4, 4), NaN if no sample is near.
    """
    known = np.isfinite(poses).all(axis=(1, 2))
    stamps, poses = stamps[known], poses[known]
    if len(stamps) < 2:
        return np.full((len(at), 4, 4), np.nan)
    before = poses[0] @ se3.inverse(poses[1]) @ poses[0]
    after = poses[-1] @ se3.inverse(poses[-2]) @ poses[-1]
    times = np.concatenate([[2 * stamps[0] - stamps[1]], stamps, [2 * stamps[-1] - stamps[-2]]])
    result = se3.interpolate(times, np.concatenate([before[None], poses, after[None]]), at)
    right = np.searchsorted(stamps, at).clip(1, len(stamps) - 1)
    distance = np.minimum(np.abs(at - stamps[right - 1]), np.abs(at - stamps[right]))
    result[(distance > FARTHEST_PACKET) | (at < times[0]) | (at > times[-1])] = np.nan
    return result
