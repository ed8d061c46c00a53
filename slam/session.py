"""The run folder: each file is complete or missing, and all files are of one run.

The results of an earlier run are removed when there are new ones, run.json first; the new run.json is written last. So
a folder with a run.json has a finished run; a folder without it has the odometry of a stopped run.

The session of a run under way is in the folder UNFINISHED, beside the results of an earlier run. It becomes SESSION
shortly before run.json is written.
"""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from slam import degeneracy
from slam.data.atomic import remove_temporaries, write_text
from slam.data.body_frame import rotations
from slam.data.cloud import Array
from slam.data.covariance_file import MEANING, covariance_text
from slam.data.errors import InputError
from slam.data.machine import peak_memory, trim_memory
from slam.data.point_writer import write_points
from slam.data.pose_files import kitti_text, tum_text
from slam.graph.g2o import write_g2o
from slam.graph.ledger import csv_text
from slam.identity import SHOWN, differences, versions
from slam.journal.journal import SESSION as SESSION_NAME
from slam.journal.journal import Journal, has_snapshot, remove_session
from slam.journal.session_file import SessionFile
from slam.journal.tables import FRAME
from slam.mapping.picture import map_png
from slam.records import STAGES
from slam.run import Run

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
ODOMETRY = ("odometry_kitti.txt", "odometry_tum.txt", "ground_truth_tum.txt", "timings.csv")  # written before that
SESSION, UNFINISHED = "session", "unfinished"  # folders in the run folder


def begin_session(folder: Path, about: dict[str, Any]) -> Journal:
    """Begin a session in a run folder, in place of an unfinished one.

    Args:
        folder: The run folder.
        about: What the results depend on, see `identity`.

    Raises:
        InputError: The folder cannot be written.
    """
    remove_temporaries(folder, (*RESULTS, *ODOMETRY))
    return Journal.begin(folder / UNFINISHED, about)


def resume_session(folder: Path, about: dict[str, Any]) -> Journal | None:
    """Open the session of a run folder to continue it, the unfinished one first; None if there is nothing to continue.

    A finished run is continued from its last snapshot, and has the same results again.

    Raises:
        InputError: Code, input or settings have changed since, or the session is damaged.
    """
    try:
        if not has_snapshot(folder / UNFINISHED) and has_snapshot(folder / SESSION):
            remove_session(folder / UNFINISHED)
            (folder / SESSION).rename(folder / UNFINISHED)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}); choose another folder") from error
    if not has_snapshot(folder / UNFINISHED):
        return None
    changed = session_differences(folder, about)
    if changed:
        more = f", and {len(changed) - SHOWN} more" if len(changed) > SHOWN else ""
        raise InputError(
            f"{folder}: the run cannot be resumed, for {'; '.join(changed[:SHOWN])}{more}. "
            "Use what the run began with, or choose another folder"
        )
    remove_temporaries(folder, (*RESULTS, *ODOMETRY))
    return Journal.resume(folder / UNFINISHED)


def session_differences(folder: Path, about: dict[str, Any]) -> list[str]:
    """List what differs between a run and the unfinished session of its folder.

    Raises:
        InputError: The session is damaged.
    """
    with SessionFile.open(folder / UNFINISHED / SESSION_NAME) as file:
        return differences(file.about, about)


def unfinished_frames(folder: Path) -> int:
    """Return the number of frames of the unfinished session that can be continued; 0 if there is none.

    Raises:
        InputError: The session is damaged.
    """
    return recorded_frames(folder) if has_snapshot(folder / UNFINISHED) else 0


def recorded_frames(folder: Path) -> int:
    """Return the number of frames of the unfinished session, also of one that cannot be continued; 0 if there is none.

    Raises:
        InputError: The session is damaged.
    """
    if not (folder / UNFINISHED / SESSION_NAME).is_file():
        return 0
    with SessionFile.open(folder / UNFINISHED / SESSION_NAME) as file:
        return file.count(FRAME)


def drop_session(folder: Path) -> None:
    """Remove the unfinished session of a run folder, unless it can be continued."""
    if not has_snapshot(folder / UNFINISHED):
        with suppress(OSError):
            remove_session(folder / UNFINISHED)


def save_odometry(run: Run, folder: str | Path) -> None:
    """Write odometry, ground truth and timings, and remove an earlier run's results.

    Raises:
        InputError: The folder cannot be written.
    """
    folder = Path(folder)
    if folder.is_dir():
        for name in RESULTS:
            (folder / name).unlink(missing_ok=True)
        remove_session(folder / SESSION)
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
    if not run.records or folder.is_symlink():
        return None
    try:
        run.settle_truth()
        save_odometry(run, folder)
    except InputError:  # the disk may be the reason for the stop
        return None
    return folder


def save_run(run: Run, folder: str | Path, journal: Journal | None = None) -> Path:
    """Write the run folder: odometry, trajectory, loops, map and, last, run.json; return the folder.

    Args:
        run: The finished run.
        folder: The run folder.
        journal: The run's session in that folder; it is closed.

    Raises:
        InputError: The folder cannot be written.
    """
    folder = Path(folder)
    save_odometry(run, folder)
    _write_poses(run, folder, "trajectory", run.poses)
    frames = run.records.indices.tolist()
    write_text(folder / "trajectory_covariance.csv", covariance_text(frames, run.stamps, run.covariances()))
    _write_mapping(run, folder)
    if journal:
        journal.move(folder / SESSION)
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
    frames = run.records.indices[mapping.keyframes.indices].tolist()
    write_text(folder / "loops.csv", csv_text(mapping.ledger, frames))
    write_g2o(folder / "graph.g2o", mapping.graph)
    if len(mapping.map):
        write_points(folder / "map.pcd", mapping.map)
        trim_memory()
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
    times = {stage: run.records.milliseconds(stage) for stage in STAGES} | run.milliseconds
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
            "versions": versions(),
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
    """Numbers of keyframes, of those at known places, of registered candidates and accepted loops."""
    if run.mapping is None:
        return {}
    mapping = run.mapping
    counts = {"keyframes": len(mapping.keyframes), "known": len(mapping.known)}
    return {**counts, "candidates": len(mapping.ledger), "accepted": mapping.loops}


def _percentile(values: Array, q: float) -> float:
    return round(float(np.percentile(values, q)), 3)


def _matrix(T: Array | None) -> list[list[float]] | None:
    return None if T is None else T.tolist()
