"""Point clouds, frames and the camera calibration."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from slam.data.problem import Problem

Array = npt.NDArray[Any]

#: Range error of a measured point [m], half the width of the central 68 % interval (HDL-64E and VLP-16 data sheets).
MEASURED_SIGMA = 0.02


@dataclass(frozen=True, eq=False)
class PointCloud:
    """N points in the sensor's frame (x forward, y left, z up), immutable: methods return new clouds.

    Attributes:
        xyz: (N, 3) float32 [m].
        intensity: (N,) float32, 0..1.
        ring: (N,) int16, 0 = top laser; None if the rings are unknown.
        time: (N,) float32, seconds from the scan's stamp; None if unknown, or if the points need no deskewing.
        sigma: (N,) float32 [m], half the width of the central 68 % interval of the range error.
        measured: (N,) bool, True for returns of the sensor, False for points that an enricher predicted.
        colour: (N, 3) uint8 RGB, or None.
    """

    xyz: Array
    intensity: Array
    ring: Array | None = None
    time: Array | None = None
    sigma: Array = None  # type: ignore[assignment]  # filled in below
    measured: Array = None  # type: ignore[assignment]
    colour: Array | None = None

    def __post_init__(self) -> None:
        count = len(self.xyz)
        defaults = {
            "sigma": lambda: np.full(count, MEASURED_SIGMA, np.float32),
            "measured": lambda: np.ones(count, bool),
        }
        dtypes = {"ring": np.int16, "measured": bool, "colour": np.uint8}
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None and field.name in defaults:
                value = defaults[field.name]()
            if value is None:
                continue
            value = np.ascontiguousarray(value, dtypes.get(field.name, np.float32))
            shape = (count, 3) if field.name in ("xyz", "colour") else (count,)
            if value.shape != shape:
                raise ValueError(f"PointCloud.{field.name}: shape {value.shape}, expected {shape}")
            object.__setattr__(self, field.name, value)

    def __len__(self) -> int:
        return len(self.xyz)

    def select(self, index: Array | slice) -> PointCloud:
        """Return the points of a mask (N,), an index array or a slice, with all their fields.

        Raises:
            IndexError: A mask has another length, or an index is out of range.
        """
        if isinstance(index, slice):
            return self._map(lambda values: values[index])
        index = np.asarray(index)
        if index.dtype == bool and index.shape != (len(self),):
            raise IndexError(f"a mask of shape {index.shape} for {len(self)} points")
        places = np.flatnonzero(index) if index.dtype == bool else index  # several times faster than a mask per field
        return self._map(lambda values: values.take(places, axis=0))

    def with_xyz(self, xyz: Array) -> PointCloud:
        """Return the cloud with other coordinates (N, 3) [m]."""
        return replace(self, xyz=xyz)

    def transformed(self, T_b_a: Array) -> PointCloud:
        """Transform the cloud from frame a to frame b; `T_b_a` (4, 4)."""
        rotation, translation = T_b_a[:3, :3].astype(np.float32), T_b_a[:3, 3].astype(np.float32)
        return self.with_xyz(self.xyz @ rotation.T + translation)

    def _map(self, function: Callable[[Array], Array]) -> PointCloud:
        columns = {field.name: getattr(self, field.name) for field in fields(self)}
        mapped: dict[str, Any] = {name: None if value is None else function(value) for name, value in columns.items()}
        return PointCloud(**mapped)


#: Clouds of earlier scans, newest last, each with T_now_then (4, 4): predicted pose of its frame in the current frame.
History = Sequence[tuple[PointCloud, Array]]
HISTORY = 5  # clouds of earlier scans that a front end receives


@dataclass(frozen=True, eq=False)
class Calibration:
    """Calibration of the camera.

    Attributes:
        K: (3, 3) camera matrix of the image as stored [pixels].
        T_camera_lidar: (4, 4), LiDAR to camera (z forward).
        distortion: OpenCV's coefficients (k1 k2 p1 p2 [k3 ...]); empty for rectified images.
        fisheye: Whether the lens is equidistant; `distortion` then has k1 k2 k3 k4 of OpenCV's fisheye model, or none.
        T_camera0_lidar: (4, 4), LiDAR to the camera that the reference poses belong to, if it is another one (KITTI's
            camera 0); else None.
    """

    K: Array
    T_camera_lidar: Array
    distortion: tuple[float, ...] = ()
    T_camera0_lidar: Array | None = None
    fisheye: bool = False


#: Gives an image, (H, W, 3) uint8 RGB, or None where there is none.
ImageReader = Callable[[], Array | None]


@dataclass(frozen=True, eq=False)
class View:
    """A camera, and what reads its image of a scan."""

    calibration: Calibration
    read_image: ImageReader


@dataclass(frozen=True, eq=False)
class Frame:
    """One scan of a sequence, with its images.

    Attributes:
        index: Number of the scan in the data set.
        stamp: Time stamp [s].
        cloud: Points as recorded.
        calibration: Calibration of the camera, of several of the one that looks ahead, or None.
        read_image: Reads the image, see `image`.
        problems: Faults of this scan or its images, and how they were handled.
        others: The other cameras, which only colour points.
    """

    index: int
    stamp: float
    cloud: PointCloud
    calibration: Calibration | None = None
    read_image: ImageReader = lambda: None
    problems: tuple[Problem, ...] = ()
    others: tuple[View, ...] = ()

    @cached_property
    def image(self) -> Array | None:
        """Image (H, W, 3) uint8 RGB, read on first access; None if the data set has no image for this scan."""
        return self.read_image()

    @property
    def views(self) -> tuple[View, ...]:
        """All cameras whose calibration is known, the one that looks ahead first."""
        ahead = () if self.calibration is None else (View(self.calibration, lambda: self.image),)
        return (*ahead, *self.others)

    @property
    def image_readers(self) -> tuple[ImageReader, ...]:
        """Return the functions that read the images of all cameras."""
        return (self.read_image, *(view.read_image for view in self.others))
