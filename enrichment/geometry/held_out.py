"""Held-out rings: some rings of a recorded scan are the input of a method, the returns of the others the reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from slam.data import se3
from slam.data.camera import project, visible
from slam.data.cloud import HISTORY, Array, Frame, History
from slam.data.dataset import Dataset
from slam.data.errors import InputError
from slam.data.sensor import Sensor


@dataclass(frozen=True, eq=False)
class HeldOut:
    """A sparse scan, and the M returns of the held-out rings.

    Attributes:
        scan: The sparse scan.
        ring: (M,) ring index of each return; its ray is on the line of this ring.
        column: (M,) azimuth column of each return; its ray is at the centre of this column.
        ranges: (M,) float32, range of each return along the ray [m] (`RayGrid.range_of`).
        seen: (M,) bool, whether the camera sees the return, judged with all rings of the scan; None without an image.
    """

    scan: SparseScan
    ring: Array
    column: Array
    ranges: Array
    seen: Array | None

    def answers(self, prediction: Prediction) -> tuple[Array, Array, Array]:
        """Return range [m] (0 for none), sigma [m] and trusted of a prediction at the held-out returns, (M,) each."""
        ray = self.ring, self.column
        return prediction.ranges[ray], prediction.sigma[ray], prediction.trusted[ray]


def past_of(data: Dataset, position: int, count: int = HISTORY) -> History:
    """Return up to `count` earlier scans of a sequence, newest last, with true relative poses; empty without these."""
    poses = data.ground_truth
    if poses is None or np.isnan(poses[position]).any():
        return ()
    known = [then for then in range(max(position - count, 0), position) if not np.isnan(poses[then]).any()]
    clouds = [data[then].cloud for then in known]
    now_world = se3.inverse(poses[position])
    return [
        (cloud, now_world @ poses[then]) for then, cloud in zip(known, clouds, strict=True) if cloud.ring is not None
    ]


def ring_step(sensor: Sensor) -> int:
    """Return the step between kept rings: 4 if this leaves 16 rings or more, else 2."""
    return 4 if sensor.ring_count >= 64 else 2


def hold_out(frame: Frame, grid: RayGrid, phase: int = 0, past: History = ()) -> HeldOut:
    """Keep the rings phase, phase + step, ... of a frame and of the `past` scans; hold out the others.

    Raises:
        InputError: The points have no ring indices.
    """
    cloud, step = frame.cloud, ring_step(grid.sensor)
    if cloud.ring is None:
        raise InputError(
            f"scan {frame.index}: no ring indices, the sensor model is unknown; name the LiDAR with --sensor"
        )
    image = frame.image if frame.calibration else None
    rings = np.arange(grid.sensor.ring_count)
    dropped = rings[rings % step != phase]
    out = cloud.select(np.isin(cloud.ring, dropped))
    assert out.ring is not None
    seen = None
    if image is not None and frame.calibration is not None:
        seen = visible(*project(cloud.xyz, frame.calibration), image.shape)[np.isin(cloud.ring, dropped)]
    return HeldOut(
        scan=SparseScan(cloud, grid.sensor, rings, lambda: image, frame.calibration, read_past=lambda: past).without(
            dropped
        ),
        ring=out.ring,
        column=grid.column_of(out.xyz),
        ranges=grid.range_of(out.xyz, out.ring).astype(np.float32),
        seen=seen,
    )
