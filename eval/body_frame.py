"""KITTI's calibration between camera 0 and the LiDAR, and the check that two trajectories have one body frame."""

from __future__ import annotations

from pathlib import Path

from slam.data.body_frame import BodyFrame, body_frame, rotations
from slam.data.cloud import Array
from slam.data.errors import InputError


def read_camera0_calibration(path: Path) -> Array:
    """Read the LiDAR-to-camera-0 transform from KITTI odometry's calib.txt or KITTI raw's calib_velo_to_cam.txt.

    Camera 0 of the raw file is unrectified; that of the odometry file is rectified (they differ by under a degree).

    Args:
        path: A file with the line `Tr:`, or the lines `R:` and `T:`.

    Returns:
        T_camera0_lidar (4, 4) [m], maps points from the LiDAR frame into camera 0.

    Raises:
        InputError: The file is missing, has neither, or is of another pair of sensors.
    """
    from slam.data.files import matrix, read_keyed_numbers  # imports numba, which nothing else here needs

    entries = read_keyed_numbers(path)
    if "Tr" in entries:
        T = matrix(entries, path, "Tr")
    elif "R" in entries and "T" in entries:
        T = matrix(entries, path, "R", "T")
    else:
        raise InputError(
            f"{path}: no LiDAR-to-camera transform found; expected the line 'Tr:' of a KITTI odometry calib.txt "
            "or 'R:' and 'T:' of a KITTI raw calib_velo_to_cam.txt"
        )
    if not rotations(T[None]).all():
        raise InputError(f"{path}: the LiDAR-to-camera transform is not a rigid motion; check the file")
    if T[2, 0] < 0.5:
        raise InputError(
            f"{path}: does not map the LiDAR's forward axis (x) to the camera's (z); "
            "is it of another pair of sensors, such as calib_imu_to_velo.txt?"
        )
    return T


def require_same_frame(
    estimate: Array, reference: Array, names: tuple[str, str], calibrated_from: BodyFrame | None = None
) -> None:
    """Check that two trajectories have the same body frame; otherwise the metrics are meaningless.

    Args:
        estimate: Poses (N, 4, 4) [m].
        reference: Poses (M, 4, 4) [m].
        names: Names of the two files, for the message.
        calibrated_from: Body frame of the reference before --calib transformed it into the LiDAR frame, None without
            --calib.

    Raises:
        InputError: The body frames are known and differ, or --calib was given for a reference in the LiDAR frame.
    """
    if calibrated_from == "lidar":
        raise InputError(
            f"{names[1]}: moves forward along x, so it is in the LiDAR frame already; "
            "--calib is for references in camera-0 axes (forward along z): leave it out"
        )
    kinds = body_frame(estimate), body_frame(reference)
    if "unknown" in kinds or kinds[0] == kinds[1]:
        return
    if calibrated_from is not None:
        raise InputError(
            f"{names[0]}: moves forward along z, so it is in camera-0 axes, while --calib transforms the reference "
            "into the LiDAR frame; if both are in camera-0 axes leave --calib out"
        )
    if kinds[1] == "camera":
        raise InputError(
            f"{names[0]} is a LiDAR trajectory (moves forward along x), {names[1]} one of camera 0 (along z): errors "
            "between different body frames are meaningless; give the calibration with --calib calib.txt"
        )
    raise InputError(
        f"{names[0]} is in camera-0 axes (moves forward along z), {names[1]} in LiDAR axes (along x): errors between "
        "different body frames are meaningless; export the estimate in the LiDAR frame, or give a reference in "
        "camera-0 axes"
    )
