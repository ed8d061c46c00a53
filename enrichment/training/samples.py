"""Training samples of depth completion: the image of a frame, its returns by ring, and the target depth.

The input rings are drawn each time a sample is used (`enrichment.training.image_examples`), and the input is computed
from the returns of these rings only. The target has the depths of all returns. Figures are computed where the input has
no return.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from enrichment.geometry.held_out import ring_step
from enrichment.geometry.image_rays import within
from enrichment.training import targets
from enrichment.training.neighbours import Neighbours
from enrichment.training.pooling import cells_of, nearest_depth
from slam.data.camera import nearest_pixel, project, visible
from slam.data.cloud import Array, Frame
from slam.data.dataset import Dataset
from slam.data.depth_map import DEPTH_SCALE
from slam.data.errors import InputError
from slam.data.pose_files import read_poses

#: A return: pixel of the full image, depth along the camera's axis in 1/DEPTH_SCALE m, ring.
RETURN = np.dtype([("column", "<u2"), ("row", "<u2"), ("depth", "<u2"), ("ring", "u1")])
FARTHEST = 65535 / DEPTH_SCALE
MAX_TARGET = 80.0  # m: farther targets are rare, and few of them would dominate a squared error


@dataclass(frozen=True, eq=False)
class Sample:
    """One frame at a scale: cells (H, W) are the pixels of the full image times the scale, rounded down.

    Attributes:
        image: (H, W, 3) uint8 RGB.
        returns: (N,) RETURN, all returns inside the image, also occluded ones: fewer rings may not show the occlusion.
        target: (H, W) float32, depth at the centres of the cells [m], in steps of 1/256 up to MAX_TARGET, 0 = none.
        ring_step: A sparse LiDAR has every `ring_step`-th ring.
        scale: Cells per pixel, at most 1.
    """

    image: Array
    returns: Array
    target: Array
    ring_step: int
    scale: float


def source(data: Dataset, poses: Path | None = None, scale: float = 0.5, neighbours: int = 5) -> Source:
    """Create a source from a sequence, with poses T_world_lidar from a file or else from its ground truth.

    Raises:
        InputError: The file does not have a pose for each scan, or as `Source`.
    """
    if poses is None:
        return Source(data, data.ground_truth, neighbours=neighbours, scale=scale)
    _, values = read_poses(poses)
    if len(values) != len(data):
        fault = f"{len(values)} poses for the {len(data)} scans of {data.path}"
        raise InputError(f"{poses}: {fault}; one pose per scan is needed, as from a run over all scans")
    return Source(data, values, poses.name, neighbours, scale)


@dataclass(frozen=True, eq=False)
class Source:
    """A sequence as a source of samples.

    Attributes:
        data: The sequence.
        poses: (N, 4, 4) T_world_lidar of its scans, NaN where unknown; None: neighbouring scans are not used.
        poses_from: Source of the poses, such as the name of a file.
        neighbours: Number of scans before and after that densify the target of a frame.
        scale: Cells per pixel.

    Raises:
        InputError: The sequence has no camera, or its sensor model is unknown.
    """

    data: Dataset
    poses: Array | None = field(default=None, repr=False)
    poses_from: str = "ground truth"
    neighbours: int = 5
    scale: float = 0.5

    def __post_init__(self) -> None:
        if self.data.calibration is None:
            raise InputError(f"{self.data.path}: no camera calibration; depth completion networks need images")
        if self.data.sensor is None:
            raise InputError(f"{self.data.path}: the sensor model is unknown; add a sensor.yaml to the folder")

    @property
    def target(self) -> str:
        """Source of the target depths, the best one available.

        In this order: exact depth images; disparity images with the scan's returns; returns with neighbouring scans;
        returns only.
        """
        if targets.has_exact(self.data.path):
            return "exact"
        if targets.has_disparity(self.data.path):
            return "disparity and returns"
        if self.poses is not None and self.neighbours > 0:
            return f"returns of the scan and {self.neighbours} before and after, placed by {self.poses_from}"
        return "returns of the scan"

    def __iter__(self) -> Iterator[Sample | None]:
        """Yield the sample of each frame, None for a frame without image, rings or returns in the image."""
        around = None
        if self.poses is not None and "placed by" in self.target:
            around = Neighbours(self.data, self.poses, self.neighbours)
        for position in range(len(self.data)):
            yield self._sample(self.data[position], around, position)

    def _sample(self, frame: Frame, around: Neighbours | None, position: int) -> Sample | None:
        image, cloud, sensor = frame.image, frame.cloud, self.data.sensor
        if image is None or cloud.ring is None or frame.calibration is None:
            return None
        assert sensor is not None
        pixels, depth = project(cloud.xyz, frame.calibration)
        seen = within(pixels, image.shape) & (depth < FARTHEST)
        if not seen.any():
            return None
        pixels, depth = pixels[seen], depth[seen]
        shown = visible(pixels, depth, image.shape)
        shape = int(image.shape[0] * self.scale), int(image.shape[1] * self.scale)
        target = nearest_depth(cells_of(pixels[shown], self.scale), depth[shown], shape)
        if around is not None:
            more = around.depth_image(position, pixels[shown], depth[shown], image.shape, self.scale)
            target = np.where(target > 0, target, more)
        return Sample(
            image=_scaled(image, shape, self.scale),
            returns=_packed(pixels, depth, cloud.ring[seen]),
            target=_quantised(self._from_files(frame.index, target)),
            ring_step=ring_step(sensor),
            scale=self.scale,
        )

    def _from_files(self, number: int, own: Array) -> Array:
        """Target (H, W) from depth or disparity files if there are any, else from scans."""
        exact = targets.exact(self.data.path, number)
        if exact is not None:
            return targets.scaled(exact, own.shape, self.scale)
        disparity = targets.disparity(self.data.path, number)
        if disparity is None:
            return own
        target = targets.scaled(disparity, own.shape, self.scale)
        return np.where(target > 0, target, own)


def _packed(pixels: Array, depth: Array, ring: Array) -> Array:
    """Returns (N,) RETURN, sorted by ring and column."""
    returns = np.empty(len(depth), RETURN)
    returns["column"], returns["row"] = nearest_pixel(pixels)
    returns["depth"], returns["ring"] = np.round(depth * DEPTH_SCALE), ring
    return returns[np.lexsort((returns["column"], returns["ring"]))]


def _quantised(depth: Array) -> Array:
    """Depth (H, W) float32 in steps of 1/256 m, none beyond MAX_TARGET."""
    return np.where(depth <= MAX_TARGET, np.round(depth * DEPTH_SCALE) / DEPTH_SCALE, 0).astype(np.float32)


def _scaled(image: Array, shape: tuple[int, int], scale: float) -> Array:
    """Mean colours of the cells; partial cells at the right and at the bottom are cut off."""
    height, width = (round(size / scale) for size in shape)
    return np.asarray(cv2.resize(image[:height, :width], shape[::-1], interpolation=cv2.INTER_AREA))
