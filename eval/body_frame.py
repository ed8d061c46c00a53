"""KITTI's calibration between camera 0 and the LiDAR, and the check that two trajectories are of one body."""

from __future__ import annotations

from pathlib import Path

from slam.data.body_frame import BodyFrame, body_frame, rotations
from slam.data.cloud import Array
from slam.data.errors import InputError


def read_camera0_calibration(path: Path) -> Array:
    """Where the LiDAR is, seen from camera 0: KITTI odometry's calib.txt or KITTI raw's calib_velo_to_cam.txt.

    The raw file's camera 0 is the unrectified one; the odometry file's is rectified (they differ by under a degree).

    Args:
        path: A file with the line `Tr:`, or the lines `R:` and `T:`.

    Returns:
        T_camera0_lidar (4, 4) [m], maps points of the LiDAR into camera 0.

    Raises:
        InputError: The file is missing, holds neither, or holds another pair of sensors.
    """
    from slam.data.files import matrix, read_keyed_numbers  # brings numba, which nothing else here needs

    entries = read_keyed_numbers(path)
    if "Tr" in entries:
        T = matrix(entries, path, "Tr")
    elif "R" in entries and "T" in entries:
        T = matrix(entries, path, "R", "T")
    else:
        raise InputError(
            f"{path}: no LiDAR-to-camera transform in it; expected the line 'Tr:' of a KITTI odometry calib.txt "
            "or 'R:' and 'T:' of a raw drive's calib_velo_to_cam.txt"
        )
    if not rotations(T[None]).all():
        raise InputError(f"{path}: the LiDAR-to-camera transform is not a rotation and a translation; check the file")
    if T[2, 0] < 0.5:
        raise InputError(
            f"{path}: does not turn the LiDAR's forward (x) into the camera's (z); "
            "is it another pair of sensors, such as calib_imu_to_velo.txt?"
        )
    return T


def require_same_frame(
    estimate: Array, reference: Array, names: tuple[str, str], calibrated_from: BodyFrame | None = None
) -> None:
    """Refuse trajectories that are poses of different bodies; the metrics would mean nothing.

    Args:
        estimate: Poses (N, 4, 4) [m].
        reference: Poses (M, 4, 4) [m].
        names: Of the two files, for the message.
        calibrated_from: The frame that the reference showed before --calib brought it into the LiDAR frame, None
            without --calib.

    Raises:
        InputError: The frames of the two are known and differ, or --calib was given where it does not belong.
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
            f"{names[0]}: moves forward along z, so it is in camera-0 axes, while --calib brings the reference into "
            "the LiDAR frame; if both are in camera-0 axes leave --calib out"
        )
    if kinds[1] == "camera":
        raise InputError(
            f"{names[0]} is a LiDAR trajectory (moves forward along x), {names[1]} one of camera 0 (along z): errors "
            "between different bodies mean nothing; give the drive's calibration with --calib calib.txt"
        )
    raise InputError(
        f"{names[0]} is in camera-0 axes (moves forward along z), {names[1]} in LiDAR axes (along x): errors between "
        "different bodies mean nothing; export the estimate in the LiDAR frame, or give a reference in camera-0 axes"
    )
