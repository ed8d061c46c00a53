"""Densification of targets: neighbouring scans, aligned by poses, add depth between the rings of a scan."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from enrichment.geometry.image_rays import within
from enrichment.training.pooling import cells_of, in_front, pooled
from slam.data import se3
from slam.data.camera import nearest_pixel, project
from slam.data.cloud import Array, PointCloud
from slam.data.dataset import Dataset
from slam.data.distortion import correct_vertical, deskew

#: Window (H, W) [pixels] whose returns bound the depth of a pixel: rings are some six rows apart, their returns up to
#: three columns.
WINDOW = (15, 9)
#: Tolerance of these bounds, the larger of metres and a share of the depth; points beyond are of moving objects.
TOLERANCE, TOLERANCE_SHARE = 0.1, 0.02


class Neighbours:
    """Scans before and after each frame of a sequence.

    Args:
        data: The sequence.
        poses: (N, 4, 4) T_world_lidar, NaN where unknown.
        reach: Number of scans before and after.
    """

    def __init__(self, data: Dataset, poses: Array, reach: int) -> None:
        assert data.sensor is not None
        self._data, self._poses, self._reach = data, poses, reach
        self._correction = data.sensor.vertical_correction
        self._scan = lru_cache(maxsize=2 * reach + 1)(self._corrected)

    def depth_image(self, position: int, pixels: Array, depth: Array, shape: tuple[int, ...], scale: float) -> Array:
        """Compute the depth image of the neighbours of a frame.

        Points outside of the bounds set by the frame's own returns and occluded points are removed. (`visible` is made
        for the gaps of a single scan: among this many points it would hide distant ground behind nearer ground.)

        Args:
            position: Position of the frame.
            pixels: Pixels (N, 2) of the frame's own visible returns.
            depth: Depths (N,) of these [m].
            shape: Shape of the image.
            scale: Cells per pixel.

        Returns:
            (H, W) float32 [m], 0 = none.
        """
        size = int(shape[0] * scale), int(shape[1] * scale)
        calibration = self._data.calibration
        assert calibration is not None
        found = [project(xyz, calibration) for xyz in self._around(position)]
        low, high = _bounds(pixels, depth, shape)
        kept = [_between(p, d, low, high) for p, d in found]
        others = [(p[k], d[k]) for (p, d), k in zip(found, kept, strict=True)]
        cells = cells_of(np.concatenate([pixels, *(p for p, _ in others)]), scale)
        depths = np.concatenate([depth, *(d for _, d in others)])
        shown = in_front(cells, depths, size)
        return pooled(cells[shown], depths[shown], size)

    def _around(self, position: int) -> list[Array]:
        """Points (M, 3) of each neighbour, in the recorded geometry of the frame."""
        if np.isnan(self._poses[position]).any():
            return []
        near = range(max(position - self._reach, 0), min(position + self._reach + 1, len(self._poses)))
        T_now_world = se3.inverse(self._poses[position])
        aligned = [
            self._scan(other).transformed(T_now_world @ self._poses[other])
            for other in near
            if other != position and np.isfinite(self._poses[other]).all()
        ]
        return [correct_vertical(cloud, -self._correction).xyz for cloud in aligned]

    def _corrected(self, position: int) -> PointCloud:
        """A vertically corrected scan, deskewed by the motion to the next one (for the last: from the one before)."""
        cloud = self._data[position].cloud
        if cloud.time is not None and len(self._poses) > 1:
            first = min(position, len(self._poses) - 2)
            motion = se3.inverse(self._poses[first]) @ self._poses[first + 1]
            elapsed = self._data.stamps[first + 1] - self._data.stamps[first]
            if np.isfinite(motion).all():
                cloud = deskew(cloud, se3.log(se3.normalized(motion)) / elapsed)
        return correct_vertical(cloud, self._correction)


def _bounds(pixels: Array, depth: Array, shape: tuple[int, ...]) -> tuple[Array, Array]:
    """Minimum and maximum depth around each pixel with tolerance, (H, W) float32 [m]; empty bounds without returns."""
    u, v = nearest_pixel(pixels)
    low, high = np.full(shape[:2], np.inf, np.float32), np.zeros(shape[:2], np.float32)
    np.minimum.at(low, (v, u), depth.astype(np.float32))
    np.maximum.at(high, (v, u), depth.astype(np.float32))
    window = np.ones(WINDOW, np.uint8)
    least, largest = cv2.erode(low, window), cv2.dilate(high, window)
    tolerance = np.maximum(TOLERANCE, TOLERANCE_SHARE * largest)
    return least - tolerance, largest + tolerance


def _between(pixels: Array, depth: Array, low: Array, high: Array) -> Array:
    """Points (N,) bool inside the image and within the bounds."""
    inside = within(pixels, low.shape)
    u, v = nearest_pixel(pixels[inside])
    inside[inside] = (depth[inside] >= low[v, u]) & (depth[inside] <= high[v, u])
    return inside
