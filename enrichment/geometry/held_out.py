"""What a method is examined on: some rings of a recorded scan are its input, the returns of the others the answers."""

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
    """A sparse scan, and M returns of the rings that it lacks, each with the ray that it is asked for on.

    ring, column  (M,) the ray: the line of the return's ring at the centre of its azimuth column
    ranges        (M,) float32, metres: how far along the ray the return is (`RayGrid.range_of`)
    seen          (M,) bool: the camera sees the return, in the scan with all its rings; None without an image
    """

    scan: SparseScan
    ring: Array
    column: Array
    ranges: Array
    seen: Array | None

    def answers(self, prediction: Prediction) -> tuple[Array, Array, Array]:
        """Of the returns held out, (M,) each: ranges [m], 0 for none, sigmas [m], and whether these are trusted."""
        ray = self.ring, self.column
        return prediction.ranges[ray], prediction.sigma[ray], prediction.trusted[ray]


def past_of(data: Dataset, position: int, count: int = HISTORY) -> History:
    """Up to `count` scans before one of a drive, newest last, placed by the drive's true poses; none without these."""
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
    """Every so-many-th ring is kept: 4 where that leaves sixteen or more, else 2."""
    return 4 if sensor.ring_count >= 64 else 2


def hold_out(frame: Frame, grid: RayGrid, phase: int = 0, past: History = ()) -> HeldOut:
    """Rings phase, phase + step, ... of a frame kept, and of the `past` scans before it; the others held out.

    Raises InputError without rings.
    """
    cloud, step = frame.cloud, ring_step(grid.sensor)
    if cloud.ring is None:
        raise InputError(f"scan {frame.index}: nobody knows which laser its points came from; name the LiDAR: --sensor")
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
