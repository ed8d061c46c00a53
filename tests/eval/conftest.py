"""Run folders as a run writes them, made of a few literal figures."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest

from eval.evaluation import evaluate_poses, write_json
from eval.metrics import RunMetrics
from slam.data.cloud import Array
from slam.data.pose_files import tum_text

TIMINGS = """\
frame,stamp_s,status,unobserved_along,unobserved_about,inlier_ratio,points,load_ms,front_end_ms,odometry_ms,waiting_ms
"""
FRAMES = (  # in turn
    "registered,,,nan,9000,1.0,1.25,12.5,0.0",
    "degenerate,1.000 0.000 0.000,,0.81,30000,1.0,1.25,12.5,0.0",
    "registered,,,0.92,10000,1.0,1.25,12.5,0.0",
)
LOOPS = """\
i,j,distance,yaw_deg,inlier_ratio,overlap,weight,status,reason,tx,ty,tz,qx,qy,qz,qw
0,2,0.12,3.5,0.95,0.9,1,accepted,,2,0,0,0,0,0,1
0,1,,,,,0,rejected,descriptors differ,0,0,0,0,0,0,1
"""


def line(length: float, count: int = 101) -> Array:
    """Poses straight on."""
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, 0, 3] = np.linspace(0, length, count)
    return poses


def _write_run(
    folder: Path, length: float, reference: float | None = 100.0, failed: int = 0, notes: Sequence[str] = ()
) -> Path:
    folder.mkdir(parents=True)
    stamps = np.arange(101.0)
    report = {
        "protocol": {"dataset": "Street", "path": None, "frames": [0, 101, 1], "input": folder.name, "config": {}},
        "counts": {"frames": 101, "registered": 101 - failed, "retried": 0, "degenerate": 0, "failed": failed},
        "notes": list(notes),
        "problems": [],
        "loops": {"keyframes": 50, "candidates": 9, "accepted": 7},
        "path_length_m": length,
        "map_points": 1_234_567,
        "peak_memory_mb": 512,
        "timings_ms": {"front_end": {"median": 1.25, "p95": 3.0}, "odometry": {"median": 12.5, "p95": 20.0}},
    }
    (folder / "run.json").write_text(json.dumps(report))
    frames = zip(range(101), cycle(FRAMES), strict=False)
    (folder / "timings.csv").write_text(TIMINGS + "".join(f"{k},{k}.0,{rest}\n" for k, rest in frames))
    (folder / "loops.csv").write_text(LOOPS)
    for track in ("odometry", "trajectory"):
        (folder / f"{track}_tum.txt").write_text(tum_text(stamps, line(length)))
    if reference:
        metrics = evaluate_poses(line(length), line(reference))
        write_json(folder / "metrics.json", RunMetrics(metrics, metrics).as_dict())
        (folder / "ground_truth_tum.txt").write_text(tum_text(stamps, line(reference)))
    return folder


@pytest.fixture(scope="session")
def write_run() -> Callable[..., Path]:
    """`write_run(folder, 101.0)`: a run whose path of 100 m was found 101 m long."""
    return _write_run


@pytest.fixture
def run_folder(tmp_path: Path) -> Callable[..., Path]:
    """`run_folder("16", 101.0)`: the same in a folder of this name."""
    return lambda name, *arguments, **options: _write_run(tmp_path / name, *arguments, **options)
