"""A scan's points, and what belongs to one instant of a drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
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

    xyz        (N, 3) float32, metres
    intensity  (N,) float32, 0..1
    ring       (N,) int16, 0 = top laser, or None where the rings are unknown
    time       (N,) float32, seconds from the scan's stamp, or None where the points need no deskewing
    sigma      (N,) float32, metres: half the width of the central 68 % interval of the range error
    measured   (N,) bool: returned by the sensor (True) or predicted by an enricher (False)
    colour     (N, 3) uint8 RGB, or None
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
        """The points that a mask (N,), an index array or a slice picks, with all their fields."""
        return self._map(lambda values: values[index])

    def with_xyz(self, xyz: Array) -> PointCloud:
        """The same points elsewhere: (N, 3)."""
        return replace(self, xyz=xyz)

    def transformed(self, T_b_a: Array) -> PointCloud:
        """The cloud of frame a in frame b; `T_b_a` (4, 4)."""
        rotation, translation = T_b_a[:3, :3].astype(np.float32), T_b_a[:3, 3].astype(np.float32)
        return self.with_xyz(self.xyz @ rotation.T + translation)

    def _map(self, function: Callable[[Array], Array]) -> PointCloud:
        columns = {field.name: getattr(self, field.name) for field in fields(self)}
        mapped: dict[str, Any] = {name: None if value is None else function(value) for name, value in columns.items()}
        return PointCloud(**mapped)


#: Past clouds, newest last, each with T_now_then (4, 4): its sensor's frame in the present one, as predicted.
History = Sequence[tuple[PointCloud, Array]]
HISTORY = 5  # past clouds that a front end is shown


@dataclass(frozen=True, eq=False)
class Calibration:
    """The camera beside the LiDAR.

    K                (3, 3) camera matrix of the image as it is delivered, pixels
    T_camera_lidar   (4, 4) maps LiDAR points into the camera's frame (z forward)
    distortion       OpenCV's coefficients (k1 k2 p1 p2 [k3 ...]); empty for rectified images
    fisheye          the lens is equidistant, and the coefficients are k1 k2 k3 k4 of OpenCV's fisheye model, or none
    T_camera0_lidar  (4, 4) for data sets whose reference poses are those of another camera (KITTI's camera 0)
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
    """One scan of a drive: its number in the data set, stamp [s], points as recorded, and the camera beside it, of
    several the one that looks ahead; `others` only colour points.

    `problems` says what was wrong with this scan or its images, and what was done about it.
    """

    index: int
    stamp: float
    cloud: PointCloud
    calibration: Calibration | None = None
    read_image: ImageReader = lambda: None
    problems: tuple[Problem, ...] = ()
    others: tuple[View, ...] = ()

    @property
    def image(self) -> Array | None:
        """(H, W, 3) uint8 RGB, read when asked for; None where the data set has no image of this scan."""
        return self.read_image()

    @property
    def views(self) -> tuple[View, ...]:
        """All cameras whose calibration is known, the one that looks ahead first."""
        ahead = () if self.calibration is None else (View(self.calibration, self.read_image),)
        return (*ahead, *self.others)

    @property
    def image_readers(self) -> tuple[ImageReader, ...]:
        """What reads the images of all cameras."""
        return (self.read_image, *(view.read_image for view in self.others))
