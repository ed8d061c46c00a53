"""An estimate against its reference: the figures of metrics.json, from poses, from files and from a run folder."""

from __future__ import annotations

import json
import math
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from eval import kitti_metric, trajectory
from eval.alignment import MAX_STAMP_DIFFERENCE, NOT_UNIQUE, associate, umeyama
from eval.body_frame import (
    body_frame,
    into_lidar_frame,
    is_rotation,
    read_camera0_calibration,
    require_same_frame,
)
from slam.data.atomic import write_text
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.data.pose_files import read_poses

#: {"ate": {"aligned", "origin", "unaligned"}, "rpe": {"frame", "frame_rotation"}, "drift", "paper_table_iii", ...}
Metrics = dict[str, Any]


def evaluate(
    estimate: Array, reference: Array, stamps: Array | None = None, reference_stamps: Array | None = None
) -> Metrics:
    """All figures for one estimate (N, 4, 4) against a reference (M, 4, 4), poses of the same body.

    With stamps [s] of both, (N,) and (M,), poses within 0.01 s belong together and the rest is left out; else N = M.
    The result is one entry of metrics.json: `ate` [m] by alignment, `rpe` over consecutive frames [m, deg], `drift`
    (see `kitti_metric.Drift`), `paper_table_iii` [m], `path_length_m` of the estimate and `reference_path_length_m`
    over the `frames` compared, and `notes`, sentences to be printed with the figures. Every number is finite or None.

    Raises InputError where fewer than two poses belong together, or the lengths differ and there are no stamps.
    """
    pairs = pair_up(estimate, reference, stamps, reference_stamps)
    notes = [] if len(pairs[0]) == len(estimate) else [_coverage(len(pairs[0]), len(estimate))]
    e, g = (orthonormal(poses) for poses in pairs)
    if not umeyama(e, g)[1]:
        notes.append(NOT_UNIQUE)
    metrics = {
        "frames": len(e),
        "path_length_m": trajectory.path_length(e),
        "reference_path_length_m": trajectory.path_length(g),
        "ate": {
            "aligned": trajectory.ate(e, g, "aligned"),
            "origin": trajectory.ate(e, g, "origin"),
            "unaligned": trajectory.ate(e, g, "unaligned"),
        },
        "rpe": {"frame": trajectory.rpe_translation(e, g), "frame_rotation": trajectory.rpe_rotation(e, g)},
        "drift": kitti_metric.kitti_drift(e, g).as_dict(),
        "paper_table_iii": trajectory.paper_table_iii(e, g),
        "notes": notes,
    }
    return dict(finite(metrics))


def evaluate_files(estimate: Path, reference: Path, calib: Path | None = None) -> Metrics:
    """What `lidarlift evaluate ESTIMATE REFERENCE [--calib calib.txt]` prints: `evaluate` and its "protocol".

    KITTI or TUM files. Two TUM files are associated by their stamps; otherwise the numbers of poses must agree.
    `calib` brings a reference in camera-0 axes into the LiDAR frame, inv(Tr) P Tr. Raises InputError for files that
    cannot be read or paired, and for trajectories whose frames of reference do not fit (see `require_same_frame`).
    """
    stamps, e = _read(estimate)
    reference_stamps, g = _read(reference)
    protocol = _protocol() | {"association": "equal numbers of poses, in order"}
    if stamps is not None and reference_stamps is not None:
        protocol["association"] = f"by time stamp, at most {MAX_STAMP_DIFFERENCE} s apart"
    elif len(e) != len(g):
        raise InputError(
            f"{estimate} has {len(e)} poses, {reference} {len(g)}: files without stamps in both must be equally long; "
            "cut one to the frames of the other, or give both in TUM's format (stamp tx ty tz qx qy qz qw)"
        )
    found = None
    if calib is not None:
        found = body_frame(g)
        g = into_lidar_frame(g, read_camera0_calibration(calib))
        protocol["reference"] = f"brought from camera-0 axes into the LiDAR frame by {calib.name}"
    require_same_frame(e, g, (str(estimate), str(reference)), found)
    protocol["frame"] = f"estimate: {_axes(e)}; reference: {_axes(g)}"
    try:
        return evaluate(e, g, stamps, reference_stamps) | {"protocol": protocol}
    except InputError as error:
        raise InputError(f"{estimate} against {reference}: {error}") from error


def evaluate_run(folder: Path) -> dict[str, Any] | None:
    """Write metrics.json of a run folder: {"slam": ..., "odometry": ..., "protocol": ...}; None without ground truth.

    Reads trajectory_tum.txt, odometry_tum.txt and ground_truth_tum.txt (LiDAR frame, may cover only some frames),
    associated by stamp. Raises InputError where one of the two trajectories is missing or no stamps agree.
    """
    truth_file = folder / "ground_truth_tum.txt"
    if not truth_file.is_file():
        return None
    truth_stamps, truth = _read_stamped(truth_file)
    result: dict[str, Any] = {}
    for name, file in (("slam", folder / "trajectory_tum.txt"), ("odometry", folder / "odometry_tum.txt")):
        stamps, poses = _read_stamped(file)
        try:
            result[name] = evaluate(poses, truth, stamps, truth_stamps)
        except InputError as error:
            raise InputError(f"{file} against {truth_file.name}: {error}") from error
        if "camera" in (body_frame(poses), body_frame(truth)):
            result[name]["notes"].append("a trajectory moves along z: these do not look like poses of a LiDAR")
    result["protocol"] = _protocol() | {
        "association": f"by time stamp, at most {MAX_STAMP_DIFFERENCE} s apart",
        "frame": "LiDAR poses, ground truth brought into the LiDAR frame",
    }
    write_json(folder / "metrics.json", result)
    return result


def pair_up(
    estimate: Array, reference: Array, stamps: Array | None = None, reference_stamps: Array | None = None
) -> tuple[Array, Array]:
    """The poses (K, 4, 4) of both that belong together, K >= 2; raises InputError otherwise."""
    if stamps is not None and reference_stamps is not None:
        ours, theirs = associate(stamps, reference_stamps)
        if len(ours) < 2:
            raise InputError(
                f"{len(ours)} pairs of poses within {MAX_STAMP_DIFFERENCE} s: the estimate's stamps are "
                f"{stamps[0]:.3f} to {stamps[-1]:.3f} s, the reference's {reference_stamps[0]:.3f} to "
                f"{reference_stamps[-1]:.3f} s; both must come from the same clock and share at least two instants"
            )
        return estimate[ours], reference[theirs]
    if len(estimate) != len(reference):
        raise InputError(f"{len(estimate)} poses against {len(reference)}, and no stamps to associate them by")
    if len(estimate) < 2:
        raise InputError("a single pose has no motion to evaluate; give at least two")
    return estimate, reference


def orthonormal(poses: Array) -> Array:
    """Poses (N, 4, 4) with exact rotations; KITTI's files round them to seven digits, more than evo accepts."""
    result = poses.copy()
    result[:, :3, :3] = Rotation.from_matrix(poses[:, :3, :3]).as_matrix()
    return result


def finite(value: Any) -> Any:
    """The same structure of dicts and lists with None in the place of what is not finite: JSON has no NaN."""
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [finite(entry) for entry in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value


def write_json(path: Path, content: Any) -> None:
    """Strict JSON, whole or not at all; what is not finite becomes null."""
    write_text(path, json.dumps(finite(content), indent=2, allow_nan=False) + "\n")


def _read(path: Path) -> tuple[Array | None, Array]:
    stamps, poses = read_poses(path)
    if not is_rotation(poses):
        raise InputError(f"{path}: its 3x3 parts are not rotations; is it a KITTI trajectory (r11 r12 r13 tx ...)?")
    return stamps, poses


def _read_stamped(path: Path) -> tuple[Array, Array]:
    stamps, poses = _read(path)
    if stamps is None:
        raise InputError(f"{path}: has no stamps; TUM's format is expected (stamp tx ty tz qx qy qz qw)")
    return stamps, poses


def _coverage(paired: int, frames: int) -> str:
    return f"{paired} of {frames} frames have a reference; 'consecutive' means consecutive among these"


def _protocol() -> dict[str, str]:
    return {**trajectory.PROTOCOL, **kitti_metric.PROTOCOL, "software": f"evo {version('evo')}"}


def _axes(poses: Array) -> str:
    return {"lidar": "LiDAR axes", "camera": "camera-0 axes", "unknown": "axes not recognised"}[body_frame(poses)]
