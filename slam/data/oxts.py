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
#: Scans farther from every packet than this [s] have no truth: packets come every 0.1 s.
FARTHEST_PACKET = 0.15
REMEDY = "copy it afresh, or remove the oxts folder to run without ground truth"


def read_packets(files: list[Path]) -> Array:
    """(N, 6) float64: latitude, longitude [deg], altitude [m], roll, pitch, yaw [rad] of each packet file.

    NaN for a packet without a fix, which has zeros.
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
    """(N, 6) as above -> T_world_imu (N, 4, 4), by the Mercator projection at the first latitude (KITTI's devkit); NaN
    where a packet is."""
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
    """Poses (M, 4, 4) at times `at` (M,), between the samples; NaN where no sample is near.

    Packets lag the scans by 12-25 ms, so the first scan lies before the first packet: the samples are continued by
    one step at either end. `stamps` (N,) must rise; samples of NaN are none.
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
