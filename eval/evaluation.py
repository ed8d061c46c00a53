"""Evaluation of an estimate against its reference (metrics.json): from poses, from files, from a run folder."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from eval import kitti_metric, trajectory
from eval.alignment import MAX_STAMP_DIFFERENCE, NOT_UNIQUE, associate, umeyama
from eval.body_frame import read_camera0_calibration, require_same_frame
from eval.consistency import Consistency, consistency
from eval.metrics import AbsoluteErrors, Metrics, RelativeErrors, RunMetrics
from slam.data.atomic import write_text
from slam.data.body_frame import body_frame, into_lidar_frame
from slam.data.cloud import Array
from slam.data.covariance_file import read_covariances
from slam.data.errors import InputError
from slam.data.pose_files import Trajectory, read_poses, read_whole_trajectory, w_first_note
from slam.data.pose_table import read_pose_table
from slam.data.quaternion_order import orders_by_odometry

POSITIONS_ONLY = "the ground truth has positions only: rotation, RPE and drift are not compared"


def evaluate_poses(
    estimate: Array, reference: Array, stamps: Array | None = None, reference_stamps: Array | None = None
) -> Metrics:
    """Compute all figures of a trajectory against its reference: ATE, RPE, KITTI's drift, the paper's Table III.

    With stamps of both, poses are associated within 0.01 s and the rest is left out; otherwise N = M.

    Args:
        estimate: Poses (N, 4, 4) [m].
        reference: Poses (M, 4, 4) [m] of the same body.
        stamps: Stamps of the estimate (N,) [s].
        reference_stamps: Stamps of the reference (M,) [s], of the same clock.

    Returns:
        The figures, their protocol, and notes on their limits.

    Raises:
        InputError: Fewer than two poses are associated, or the lengths differ and there are no stamps.

    Example:
        >>> line = np.tile(np.eye(4), (31, 1, 1)); line[:, 0, 3] = range(31)
        >>> shifted = line.copy(); shifted[:, 1, 3] = 0.5
        >>> metrics = evaluate_poses(shifted, line)
        >>> metrics.frames, round(metrics.ate.unaligned.rmse, 6), round(metrics.rpe.frame.rmse, 6), metrics.drift.name
        (31, 0.5, 0.0, 'short drive, 10 m')
    """
    pairs = pair_up(estimate, reference, stamps, reference_stamps)
    notes = [] if len(pairs[0]) == len(estimate) else [_coverage(len(pairs[0]), len(estimate))]
    e, g = (orthonormal(poses) for poses in pairs)
    if not umeyama(e, g)[1]:
        notes.append(NOT_UNIQUE)
    return Metrics(
        frames=len(e),
        path_length_m=trajectory.path_length(e),
        reference_path_length_m=trajectory.path_length(g),
        ate=AbsoluteErrors(
            aligned=trajectory.ate(e, g, "aligned"),
            origin=trajectory.ate(e, g, "origin"),
            unaligned=trajectory.ate(e, g, "unaligned"),
        ),
        rpe=RelativeErrors(frame=trajectory.rpe_translation(e, g), frame_rotation=trajectory.rpe_rotation(e, g)),
        drift=kitti_metric.kitti_drift(e, g),
        paper_table_iii=trajectory.paper_table_iii(e, g),
        notes=tuple(notes),
        protocol={**trajectory.PROTOCOL, **kitti_metric.PROTOCOL, "software": f"evo {version('evo')}"},
    )


def evaluate_files(estimate: Path, reference: Path, calib: Path | None = None) -> Metrics:
    """Evaluate a trajectory file against a reference file, as `lidarlift evaluate`. See `evaluate_trajectory`."""
    return evaluate_trajectory(estimate, read_whole_trajectory(reference), reference, calib)


def evaluate_trajectory(estimate: Path, theirs: Trajectory, reference: Path, calib: Path | None = None) -> Metrics:
    """Evaluate a trajectory file against a reference.

    Two TUM files are associated by stamps; otherwise the numbers of poses must agree.

    Args:
        estimate: A file of poses in KITTI or TUM format.
        theirs: The reference.
        reference: Its file or data set, for messages.
        calib: A KITTI calibration that transforms a reference in camera-0 axes into the LiDAR frame, inv(Tr) P Tr.

    Returns:
        The figures of `evaluate_poses`; the protocol adds the association and the body frames. If the estimate shows
        that the reference's quaternions have w first, they are read that way, and a note says so.

    Raises:
        InputError: A file cannot be read, the poses cannot be associated, or the body frames differ (see
            `require_same_frame`).
    """
    stamps, e = read_poses(estimate)
    T_camera0_lidar = None if calib is None else read_camera0_calibration(calib)
    order = other_order(theirs, stamps, e, T_camera0_lidar)
    reference_stamps, g = theirs.stamps, theirs.readings[order] if order else theirs.poses
    protocol = {"association": "equal numbers of poses, in order"}
    if stamps is not None and reference_stamps is not None:
        protocol["association"] = f"by time stamp, at most {MAX_STAMP_DIFFERENCE} s apart"
    elif len(e) != len(g):
        raise InputError(
            f"{estimate} has {len(e)} poses, {reference} {len(g)}: without stamps in both, the numbers must be equal; "
            "cut one to the frames of the other, or give both in TUM format (stamp tx ty tz qx qy qz qw)"
        )
    found = None
    if calib is not None and T_camera0_lidar is not None:
        found = body_frame(g)
        g = into_lidar_frame(g, T_camera0_lidar)
        protocol["reference"] = f"transformed from camera-0 axes into the LiDAR frame by {calib.name}"
    require_same_frame(e, g, (str(estimate), str(reference)), found)
    protocol["frame"] = f"estimate: {_axes(e)}; reference: {_axes(g)}"
    try:
        metrics = evaluate_poses(e, g, stamps, reference_stamps)
    except InputError as error:
        raise InputError(f"{estimate} against {reference}: {error}") from error
    note = w_first_note(reference, theirs)
    if order:
        note = f"{reference}: judging by the estimate, its quaternions have w {'first' if order == 'wxyz' else 'last'}"
    notes = metrics.notes if note is None else (*metrics.notes, note)
    return replace(metrics, notes=notes, protocol={**metrics.protocol, **protocol})


def evaluate_run(folder: Path) -> RunMetrics | None:
    """Evaluate a run and write metrics.json into its folder.

    Args:
        folder: A run folder with trajectory_tum.txt, odometry_tum.txt and ground_truth_tum.txt (LiDAR frame, possibly
            of some frames only), associated by stamp; trajectory_covariance.csv is evaluated if it is there. Without
            poses, true_positions.csv is the ground truth (see `evaluate_positions`).

    Returns:
        The figures; None without ground truth, and no file is written.

    Raises:
        InputError: A trajectory is missing, no stamps agree, or the covariances cannot be read.
    """
    truth_file = folder / "ground_truth_tum.txt"
    if not truth_file.is_file():
        return _evaluate_by_positions(folder)
    truth_stamps, truth = _read_stamped(truth_file)

    def evaluated(file: Path) -> Metrics:
        stamps, poses = _read_stamped(file)
        try:
            metrics = evaluate_poses(poses, truth, stamps, truth_stamps)
        except InputError as error:
            raise InputError(f"{file} against {truth_file.name}: {error}") from error
        notes = metrics.notes
        if "camera" in (body_frame(poses), body_frame(truth)):
            notes += ("a trajectory moves along z: its poses are probably not those of a LiDAR",)
        protocol = {
            "association": f"by time stamp, at most {MAX_STAMP_DIFFERENCE} s apart",
            "frame": "LiDAR poses, ground truth transformed into the LiDAR frame",
        }
        return replace(metrics, notes=notes, protocol={**metrics.protocol, **protocol})

    result = RunMetrics(
        evaluated(folder / "trajectory_tum.txt"),
        evaluated(folder / "odometry_tum.txt"),
        _consistency(folder, truth_stamps, truth),
    )
    write_json(folder / "metrics.json", result.as_dict())
    return result


def _evaluate_by_positions(folder: Path) -> RunMetrics | None:
    path = folder / "true_positions.csv"
    if not path.is_file():
        return None
    rows = read_pose_table(path).values

    def evaluated(file: Path) -> Metrics:
        stamps, poses = _read_stamped(file)
        try:
            return evaluate_positions(poses, rows[:, 1:], stamps, rows[:, 0])
        except InputError as error:
            raise InputError(f"{file} against {path.name}: {error}") from error

    result = RunMetrics(evaluated(folder / "trajectory_tum.txt"), evaluated(folder / "odometry_tum.txt"))
    write_json(folder / "metrics.json", result.as_dict())
    return result


def evaluate_positions(estimate: Array, positions: Array, stamps: Array, position_stamps: Array) -> Metrics:
    """Compute the figures of a trajectory that positions alone allow: the ATE after alignment, and path lengths.

    Args:
        estimate: Poses (N, 4, 4) [m].
        positions: True positions (M, 3) [m], in a frame of any orientation.
        stamps: Stamps of the estimate (N,) [s].
        position_stamps: Stamps of the positions (M,) [s], of the same clock.

    Returns:
        The figures; those that need rotations are NaN or None.

    Raises:
        InputError: Fewer than two poses are associated.
    """
    reference = np.tile(np.eye(4), (len(positions), 1, 1))
    reference[:, :3, 3] = positions
    e, g = pair_up(orthonormal(estimate), reference, stamps, position_stamps)
    notes = [POSITIONS_ONLY] if len(e) == len(estimate) else [POSITIONS_ONLY, _coverage(len(e), len(estimate))]
    if not umeyama(e, g)[1]:
        notes.append(NOT_UNIQUE)
    unknown = trajectory.Statistics(*[math.nan] * len(trajectory.STATISTICS))
    return Metrics(
        frames=len(e),
        path_length_m=trajectory.path_length(e),
        reference_path_length_m=trajectory.path_length(g),
        ate=AbsoluteErrors(aligned=trajectory.ate(e, g, "aligned"), origin=unknown, unaligned=unknown),
        rpe=RelativeErrors(frame=unknown, frame_rotation=unknown),
        drift=kitti_metric.Drift(None, None, (), 0, "none", reason="the ground truth has positions only"),
        paper_table_iii=unknown,
        notes=tuple(notes),
        protocol={
            "ate": trajectory.PROTOCOL["ate"],
            "association": f"by time stamp, at most {MAX_STAMP_DIFFERENCE} s apart",
            "software": f"evo {version('evo')}",
        },
    )


def pair_up(
    estimate: Array, reference: Array, stamps: Array | None = None, reference_stamps: Array | None = None
) -> tuple[Array, Array]:
    """Return the associated poses of an estimate and its reference.

    Args:
        estimate: Poses (N, 4, 4).
        reference: Poses (M, 4, 4).
        stamps: Stamps of the estimate (N,) [s], or None.
        reference_stamps: Stamps of the reference (M,) [s], or None. With both, poses are associated within 0.01 s.

    Returns:
        Poses (K, 4, 4) of the estimate and (K, 4, 4) of the reference, K >= 2.

    Raises:
        InputError: Fewer than two poses are associated, or N and M differ without stamps.
    """
    if stamps is not None and reference_stamps is not None:
        ours, theirs = associate(stamps, reference_stamps)
        if len(ours) < 2:
            raise InputError(
                f"{len(ours)} pairs of poses within {MAX_STAMP_DIFFERENCE} s: the stamps of the estimate are "
                f"{stamps[0]:.3f} to {stamps[-1]:.3f} s, of the reference {reference_stamps[0]:.3f} to "
                f"{reference_stamps[-1]:.3f} s; both need the same clock and at least two common instants"
            )
        return estimate[ours], reference[theirs]
    if len(estimate) != len(reference):
        raise InputError(f"{len(estimate)} poses against {len(reference)}, without stamps to associate them")
    if len(estimate) < 2:
        raise InputError("a single pose cannot be evaluated; give at least two")
    return estimate, reference


def orthonormal(poses: Array) -> Array:
    """Return poses (N, 4, 4) with orthonormal rotations; KITTI files round to seven digits, which evo rejects."""
    result = poses.copy()
    result[:, :3, :3] = Rotation.from_matrix(poses[:, :3, :3]).as_matrix()
    return result


def finite(value: Any) -> Any:
    """Replace non-finite numbers in dicts and lists by None, since JSON has no NaN.

    Example:
        >>> finite({"rmse": float("nan"), "lengths": (1, 2.5)})
        {'rmse': None, 'lengths': [1, 2.5]}
    """
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [finite(entry) for entry in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value


def write_json(path: Path, content: Any) -> None:
    """Write strict JSON atomically; non-finite numbers become null."""
    write_text(path, json.dumps(finite(content), indent=2, allow_nan=False) + "\n")


def _read_stamped(path: Path) -> tuple[Array, Array]:
    stamps, poses = read_poses(path, "xyzw")  # as a run writes them
    if stamps is None:
        raise InputError(f"{path}: has no stamps; expected is the TUM format (stamp tx ty tz qx qy qz qw)")
    return stamps, poses


def _consistency(folder: Path, truth_stamps: Array, truth: Array) -> Consistency | None:
    """NEES of a run's trajectory. Its covariances are relative to its first pose, which must have a reference."""
    path = folder / "trajectory_covariance.csv"
    if not path.is_file():
        return None
    stamps, poses = _read_stamped(folder / "trajectory_tum.txt")
    covariances = read_covariances(path)[1]
    if len(covariances) != len(poses):
        raise InputError(f"{path}: {len(covariances)} covariances for {len(poses)} poses; run again")
    ours, theirs = associate(stamps, truth_stamps)
    if not len(ours) or ours[0] != 0:
        return None
    return consistency(poses[ours], covariances[ours], truth[theirs])


def other_order(theirs: Trajectory, stamps: Array | None, e: Array, T_camera0_lidar: Array | None) -> str | None:
    """Return the order of a reference's quaternions if an estimate agrees with another one than they are read in.

    Args:
        theirs: The reference.
        stamps: Stamps of the estimate (N,) [s], None without.
        e: Poses of the estimate (N, 4, 4).
        T_camera0_lidar: Transforms the reference into the LiDAR frame before it is compared, None if it need not be.

    Returns:
        'xyzw' or 'wxyz'; None if the order is right or cannot be told.
    """
    if stamps is not None and theirs.stamps is not None:
        ours, pairs = associate(stamps, theirs.stamps)
    else:
        ours = pairs = np.arange(len(e) if len(e) == len(theirs.poses) else 0)
    if not theirs.readings or len(ours) < 2:
        return None
    readings = {order: read[pairs] for order, read in theirs.readings.items()}
    if T_camera0_lidar is not None:
        readings = {order: into_lidar_frame(read, T_camera0_lidar) for order, read in readings.items()}
    agreeing = orders_by_odometry(readings, e[ours])
    return agreeing[0] if agreeing and (theirs.order or "xyzw") not in agreeing else None


def _coverage(paired: int, frames: int) -> str:
    return f"{paired} of {frames} frames have a reference; 'consecutive' means consecutive among these"


def _axes(poses: Array) -> str:
    return {"lidar": "LiDAR axes", "camera": "camera-0 axes", "unknown": "axes not recognised"}[body_frame(poses)]
