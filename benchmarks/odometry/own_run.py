"""Run of our odometry over a drive, with all its outputs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from benchmarks.odometry import inputs
from benchmarks.odometry.systems import our_odometry
from slam.cell_sizes import choose_sizes
from slam.config import load_config
from slam.data.cloud import Array, Frame
from slam.data.dataset import Dataset
from slam.graph.drift import MotionErrors, map_errors
from slam.odometry import OdometryStep
from slam.settings import OdometrySettings
from slam.tracking import Tracker

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class OwnRun:
    """Output of the odometry for N frames, see `OdometryStep`.

    poses        (N, 4, 4)
    covariances  (N, 6, 6)
    statuses     (N,) text
    unobserved   N arrays (K, 6)
    """

    poses: Array
    covariances: Array
    statuses: Array
    unobserved: list[Array]

    @property
    def motion_covariances(self) -> Array:
        """Covariances (N, 6, 6) of the motions from the frame before; that from a failed frame has its error too."""
        failed = (self.statuses == "failed")[:-1, None, None]
        before = np.where(failed, self.covariances[:-1], 0)
        return self.covariances + np.concatenate([np.zeros((1, 6, 6)), before])

    @property
    def errors(self) -> MotionErrors:
        """Errors of registrations and drift that the covariances stand for."""
        return map_errors(self.poses, self.covariances, self.unobserved, self.statuses == "failed")

    def share(self, status: str, of: Array) -> float | None:
        """Return the share of the frames in a mask (N,) with a status; None for no frames."""
        return float((self.statuses[of] == status).mean()) if of.any() else None


def settings_of(name: str, data: Dataset, overrides: Sequence[str] = ()) -> OdometrySettings:
    """Those that lidarlift takes by itself for an input of a drive, but for `overrides`, as in `load_config`."""
    return load_config(overrides=overrides, input=inputs.channels(name, data)).odometry


def base_sizes(name: str, data: Dataset, first: Frame) -> dict[str, Any]:
    """Cells and voxels [m] of the odometry on an input of a drive that begins with `first`, by their names."""
    sizes = choose_sizes(settings_of(name, data), inputs.front_end(name, data)(first, ()).xyz)
    return {size: getattr(sizes, size) for size in ("cell_sizes", "voxel_size", "map_voxel_size")}


def own_run(data: Dataset, frames: Iterable[Frame], name: str, overrides: Sequence[str] = ()) -> OwnRun:
    """Our odometry on an input, one of `inputs.names()`, of these frames of a drive."""
    tracker = Tracker(inputs.front_end(name, data), our_odometry(settings_of(name, data, overrides), data))
    steps: list[tuple[Array, Array, str, Array]] = []
    for frame in frames:
        step = tracker(frame).step
        put_right(steps, [_said(each) for each in step.revised])
        steps.append(_said(step))
    put_right(steps, [_said(each) for each in tracker.settle()])
    poses, covariances, statuses, unobserved = zip(*steps, strict=True)
    return OwnRun(np.array(poses), np.array(covariances), np.array(statuses), list(unobserved))


def put_right(said: list[T], revised: Sequence[T]) -> None:
    """Replace what was said of the last scans by what is now known of them."""
    said[len(said) - len(revised) :] = revised


def _said(step: OdometryStep) -> tuple[Array, Array, str, Array]:
    return step.pose, step.covariance, step.status, step.unobserved  # not the cloud: memory
