"""The run folder: each file is complete or missing, and all files are of one run.

The results of an earlier run are removed when there are new ones, run.json first; the new run.json is written last. So
a folder with a run.json has a finished run; a folder without it has the odometry of a stopped run.
"""

from __future__ import annotations

import json
import platform
from contextlib import suppress
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from slam import degeneracy
from slam.data.atomic import write_text
from slam.data.body_frame import rotations
from slam.data.cloud import Array
from slam.data.covariance_file import MEANING, covariance_text
from slam.data.errors import InputError
from slam.data.machine import peak_memory
from slam.data.point_writer import write_points
from slam.data.pose_files import kitti_text, tum_text
from slam.graph.g2o import write_g2o
from slam.graph.ledger import csv_text
from slam.mapping.picture import map_png
from slam.run import STAGES, Run

RESULTS = (  # written after loops and map
    "run.json",
    "metrics.json",
    "trajectory.png",
    "trajectory_kitti.txt",
    "trajectory_tum.txt",
    "trajectory_covariance.csv",
    "loops.csv",
    "graph.g2o",
    "map.pcd",
    "map.png",
    "scan.npz",
    "report.html",
)
PACKAGES = ("lidarlift", "numpy", "numba", "scipy", "gtsam", "onnxruntime", "open3d", "open3d-cpu", "evo")


def save_odometry(run: Run, folder: str | Path) -> None:
    """Write odometry, ground truth and timings, and remove an earlier run's results.

    Raises:
        InputError: The folder cannot be written.
    """
    folder = Path(folder)
    if folder.is_dir():
        for name in RESULTS:
            (folder / name).unlink(missing_ok=True)
    _write_poses(run, folder, "odometry", run.odometry_poses)
    _write_ground_truth(run, folder)
    _write_true_positions(run, folder)
    write_text(folder / "timings.csv", _timings_csv(run))


def save_stopped(run: Run, folder: str | Path) -> Path | None:
    """Write the odometry of a stopped run, as `save_odometry` does, so that its poses are not lost.

    If the folder has a finished run, that run is kept, and FOLDER-stopped is written next to it.

    Returns:
        The folder; None if there are no frames, or the folder cannot be written.
    """
    folder = Path(folder)
    if (folder / "run.json").exists():
        folder = folder.with_name(f"{folder.name}-stopped")
    if not run.records:
        return None
    try:
        run.settle_truth()
        save_odometry(run, folder)
    except InputError:  # the disk may be the reason for the stop
        return None
    return folder


def save_run(run: Run, folder: str | Path) -> Path:
    """Write the run folder: odometry, trajectory, loops, map and, last, run.json; return the folder.

    Raises:
        InputError: The folder cannot be written.
    """
    folder = Path(folder)
    save_odometry(run, folder)
    _write_poses(run, folder, "trajectory", run.poses)
    frames = [record.index for record in run.records]
    write_text(folder / "trajectory_covariance.csv", covariance_text(frames, run.stamps, run.covariances()))
    _write_mapping(run, folder)
    write_text(folder / "run.json", json.dumps(_report(run), indent=2) + "\n")
    return folder


def read_report(folder: Path) -> dict[str, Any]:
    """Return the content of a run folder's run.json.

    Raises:
        InputError: The file is missing or damaged.
    """
    path = folder / "run.json"
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"{path}: not a run ({error}); give a folder written by `lidarlift run`") from error


def _write_poses(run: Run, folder: Path, name: str, poses: Array) -> None:
    write_text(folder / f"{name}_kitti.txt", kitti_text(poses))
    write_text(folder / f"{name}_tum.txt", tum_text(run.stamps, poses))


def _write_mapping(run: Run, folder: Path) -> None:
    """Write map, picture, loops and graph; nothing without keyframes."""
    mapping = run.mapping
    if mapping is None or len(mapping.keyframes) == 0:
        return
    frames = [run.records[index].index for index in mapping.keyframes.indices]
    write_text(folder / "loops.csv", csv_text(mapping.ledger, frames))
    write_g2o(folder / "graph.g2o", mapping.graph)
    if len(mapping.map):
        write_points(folder / "map.pcd", mapping.map)
        map_png(mapping.map, run.poses[:, :3, 3], folder / "map.png")


def _write_ground_truth(run: Run, folder: Path) -> None:
    path, stamps = folder / "ground_truth_tum.txt", run.stamps
    truth = np.zeros((0, 4, 4)) if run.ground_truth is None else run.ground_truth[: len(stamps)]
    known = rotations(truth)
    if known.sum() >= 2:
        write_text(path, tum_text(stamps[: len(truth)][known], truth[known]))
    else:
        path.unlink(missing_ok=True)  # of an earlier run


def _write_true_positions(run: Run, folder: Path) -> None:
    path, stamps = folder / "true_positions.csv", run.stamps
    true = np.zeros((0, 3)) if run.source.true_positions is None else run.source.true_positions[: len(stamps)]
    known = np.flatnonzero(np.isfinite(true).all(axis=1))
    if len(known) < 2:
        path.unlink(missing_ok=True)  # of an earlier run
        return
    rows = [f"{stamps[at]:.9f},{','.join(f'{value:.4f}' for value in true[at])}\n" for at in known]
    write_text(path, "".join(["stamp,x,y,z\n", *rows]))


def _timings_csv(run: Run) -> str:
    """A row per frame.

    `unobserved_along` and `unobserved_about` are the unobservable directions of a degenerate scan: unit vectors 'x y z'
    of translations and of axes of rotation, in the sensor's axes, separated by '; '.
    """
    stages = ",".join(f"{stage}_ms" for stage in STAGES)
    rows = [f"frame,stamp_s,status,unobserved_along,unobserved_about,inlier_ratio,points,{stages}"]
    for record in run.records:
        times = ",".join(f"{record.milliseconds[stage]:.3f}" for stage in STAGES)
        along, about = degeneracy.translations(record.unobserved), degeneracy.rotations(record.unobserved)
        rows.append(
            f"{record.index},{record.stamp:.6f},{record.status},{_vectors(along)},{_vectors(about)},"
            f"{record.inlier_ratio:.4f},{record.points},{times}"
        )
    return "\n".join(rows) + "\n"


def _vectors(vectors: Array) -> str:
    """Vectors (M, 3) as text; + 0.0 turns -0 into 0."""
    return "; ".join(" ".join(f"{value:.3f}" for value in vector.round(3) + 0.0) for vector in vectors)


def _report(run: Run) -> dict[str, Any]:
    source = run.source
    positions = source.positions or range(len(run.records))
    times = {stage: np.array([record.milliseconds[stage] for record in run.records]) for stage in STAGES}
    times |= {stage: np.array(values) for stage, values in run.milliseconds.items()}
    return {
        "protocol": {
            "dataset": source.name,
            "path": str(source.path) if source.path else None,
            "sensor": source.sensor.name if source.sensor else None,
            "frames": [positions.start, positions.stop, positions.step],
            "input": run.config.front_end.input,
            "vertical_correction_deg": round(float(np.rad2deg(run.vertical_correction)), 6),
            "deskew": run.deskewed,
            "point_times": run.times(),
            "stamps": source.stamps_from,
            "topics": dict(source.topics),
            "sizes_m": asdict(run.sizes) if run.sizes else None,
            "alignment": "none: the first frame is the origin; metrics.json says how each figure was aligned",
            "covariances": MEANING,
            "versions": _versions(),
            "config": run.config.model_dump(mode="json"),
        },
        "counts": run.counts(),
        "loops": _loops(run),
        "notes": run.notes(),
        "problems": [problem.message for problem in run.problems],
        "timings_ms": {
            stage: {"median": _percentile(values, 50), "p95": _percentile(values, 95)}
            for stage, values in times.items()
            if len(values)
        },
        "path_length_m": round(float(np.linalg.norm(np.diff(run.poses[:, :3, 3], axis=0), axis=1).sum()), 4),
        "map_points": len(run.map),
        "peak_memory_mb": peak_memory(),
        "T_camera0_lidar": _matrix(source.calibration.T_camera0_lidar if source.calibration else None),
    }


def _loops(run: Run) -> dict[str, int]:
    """Numbers of keyframes, registered candidates and accepted loops."""
    if run.mapping is None:
        return {}
    mapping = run.mapping
    return {"keyframes": len(mapping.keyframes), "candidates": len(mapping.ledger), "accepted": mapping.loops}


def _percentile(values: Array, q: float) -> float:
    return round(float(np.percentile(values, q)), 3)


def _matrix(T: Array | None) -> list[list[float]] | None:
    return None if T is None else T.tolist()


def _versions() -> dict[str, str]:
    """Versions of Python and of the installed PACKAGES; Open3D has two names."""
    installed = {"python": platform.python_version()}
    for name in PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            installed[name] = metadata.version(name)
    return installed
