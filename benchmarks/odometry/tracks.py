"""Odometry over a drive, and how it is judged: distances, and whether its covariance is true."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.odometry.nees import nees
from benchmarks.odometry.own_run import put_right
from benchmarks.odometry.systems import our_odometry
from enrichment.enricher import Enricher
from enrichment.geometry.sparse_scan import Method
from eval.evaluation import evaluate_poses
from slam.config import load_config
from slam.data.cloud import Array, Frame
from slam.data.dataset import Dataset
from slam.front_end import FrontEnd, RingFrontEnd
from slam.odometry import OdometryStep
from slam.settings import OdometrySettings
from slam.tracking import Tracker


def front_ends(data: Dataset, methods: Mapping[str, Method]) -> dict[str, tuple[FrontEnd, OdometrySettings]]:
    """For 64 channels, for 16, and for these filled in by each method, each with its settings."""
    assert data.sensor is not None
    sparse = RingFrontEnd(load_config(input="16").front_end, data.sensor)
    made: dict[str, tuple[FrontEnd, str]] = {
        "64": (RingFrontEnd(load_config().front_end, data.sensor), "64"),
        "16": (sparse, "16"),
    }
    for name, method in methods.items():
        made[name] = Enricher(sparse, method, *sparse.lines(), data.sensor), "enriched"
    return {name: (front_end, load_config(input=channels).odometry) for name, (front_end, channels) in made.items()}


@dataclass(frozen=True, eq=False)
class Track:
    """One odometry over a drive: poses (N, 4, 4), median milliseconds a frame, NEES per degree of freedom."""

    poses: Array
    failed: int
    front_end_ms: float
    milliseconds: float
    nees: float | None

    @property
    def length(self) -> float:
        return float(np.linalg.norm(np.diff(self.poses[:, :3, 3], axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class Runner:
    """Odometry over a drive's frames; `truth` (N, 4, 4) where it is exact enough to judge covariances by."""

    data: Dataset
    frames: Sequence[Frame]
    truth: Array | None

    def __call__(self, front_end: FrontEnd, settings: OdometrySettings) -> Track:
        """The front end is shown the past, as while driving."""
        tracker = Tracker(front_end, our_odometry(settings, self.data))
        tracked = [tracker(frame) for frame in self.frames]
        steps: list[OdometryStep] = []
        for each in tracked:
            put_right(steps, each.step.revised)
            steps.append(each.step)
        put_right(steps, tracker.settle())
        front_end_ms, milliseconds = (
            float(np.median([each.milliseconds[stage] for each in tracked])) for stage in ("front_end", "odometry")
        )
        poses = np.array([step.pose for step in steps])
        covariances = np.array([step.covariance for step in steps])
        return Track(
            poses=poses,
            failed=sum(step.status == "failed" for step in steps),
            front_end_ms=front_end_ms,
            milliseconds=milliseconds,
            nees=None if self.truth is None else nees(poses, covariances, self.truth),
        )


def apart(track: Track, reference: Track) -> float:
    return rmse(track.poses, reference.poses)


def rmse(poses: Array, reference: Array) -> float:
    """After SE(3) alignment, metres."""
    return evaluate_poses(poses, reference).ate.aligned.rmse


def geometric_mean(values: Sequence[float]) -> float | None:
    """None of nothing."""
    return float(np.exp(np.mean(np.log(values)))) if values else None
