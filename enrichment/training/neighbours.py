"""Neighbouring scans, placed by poses, fill what one scan leaves open between its rings."""

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

#: Pixels (H, W) around one whose returns bound its depth: rings are some six rows apart, returns of one up to three.
WINDOW = (15, 9)
#: Beyond these bounds by the larger of metres and a share of the depth, a point is another thing: it moved.
BEYOND, BEYOND_SHARE = 0.1, 0.02


class Neighbours:
    """Scans up to `reach` before and after each of a drive's frames; `poses` (N, 4, 4) T_world_lidar, NaN = unknown."""

    def __init__(self, data: Dataset, poses: Array, reach: int) -> None:
        assert data.sensor is not None
        self._data, self._poses, self._reach = data, poses, reach
        self._correction = data.sensor.vertical_correction
        self._scan = lru_cache(maxsize=2 * reach + 1)(self._corrected)

    def depth_image(self, position: int, pixels: Array, depth: Array, shape: tuple[int, ...], scale: float) -> Array:
        """(H, W) float32 [m, 0 = none] at `scale` of an image of `shape`, from the neighbours of one frame.

        pixels (N, 2), depth (N,): what the camera sees of the frame's own returns. Kept is what lies within the bounds
        that these set around it, and is not behind others. (`visible` is made for the gaps of a single scan: among so
        many points it would hide the ground far away behind the ground before it.)
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
        """The points of each neighbour, (M, 3), in the geometry in which the frame itself was recorded."""
        if np.isnan(self._poses[position]).any():
            return []
        near = range(max(position - self._reach, 0), min(position + self._reach + 1, len(self._poses)))
        T_now_world = se3.inverse(self._poses[position])
        placed = [
            self._scan(other).transformed(T_now_world @ self._poses[other])
            for other in near
            if other != position and np.isfinite(self._poses[other]).all()
        ]
        return [correct_vertical(cloud, -self._correction).xyz for cloud in placed]

    def _corrected(self, position: int) -> PointCloud:
        """A scan deskewed by the motion to the next one (of the last: from the one before), vertically corrected."""
        cloud = self._data[position].cloud
        if cloud.time is not None and len(self._poses) > 1:
            first = min(position, len(self._poses) - 2)
            motion = se3.inverse(self._poses[first]) @ self._poses[first + 1]
            elapsed = self._data.stamps[first + 1] - self._data.stamps[first]
            if np.isfinite(motion).all():
                cloud = deskew(cloud, se3.log(se3.normalized(motion)) / elapsed)
        return correct_vertical(cloud, self._correction)


def _bounds(pixels: Array, depth: Array, shape: tuple[int, ...]) -> tuple[Array, Array]:
    """(H, W) float32, metres: the least and the largest depth around each pixel; without any there, an empty bound."""
    u, v = nearest_pixel(pixels)
    low, high = np.full(shape[:2], np.inf, np.float32), np.zeros(shape[:2], np.float32)
    np.minimum.at(low, (v, u), depth.astype(np.float32))
    np.maximum.at(high, (v, u), depth.astype(np.float32))
    window = np.ones(WINDOW, np.uint8)
    least, largest = cv2.erode(low, window), cv2.dilate(high, window)
    slack = np.maximum(BEYOND, BEYOND_SHARE * largest)
    return least - slack, largest + slack


def _between(pixels: Array, depth: Array, low: Array, high: Array) -> Array:
    """(N,) bool: which points lie inside the image and within the bounds there."""
    inside = within(pixels, low.shape)
    u, v = nearest_pixel(pixels[inside])
    inside[inside] = (depth[inside] >= low[v, u]) & (depth[inside] <= high[v, u])
    return inside
