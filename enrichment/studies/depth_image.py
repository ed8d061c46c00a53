"""Dense depth images for the studies, interpolated or exact, and their discontinuities."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.ndimage import correlate1d, distance_transform_edt, maximum_filter1d, uniform_filter1d

from slam.data.camera import nearest_pixel, project, visible
from slam.data.cloud import Array, Frame
from slam.data.depth_map import read_depth_map
from slam.data.errors import InputError

NEAR = 6  # pixels: gaps of up to twice this width between returns are interpolated
FILLED = 0.75  # minimum share of known pixels of a row or column; others are cut off
FARTHEST = 80.0  # m: larger depths, and the sky, are clipped to it
#: Pixels between the two sides of a jump, vertical and horizontal: returns are up to six rows and three columns apart.
GAPS = (6, 4)
JUMP = 0.1  # minimum relative difference of depth across a discontinuity


@dataclass(frozen=True, eq=False)
class DepthImage:
    """Dense depth of an image.

    Attributes:
        depth: (H, W) float64 [m].
        known: (H, W) bool, measured nearby, not interpolated across a wide gap.
        image: (H, W, 3) uint8 RGB, the same pixels.
        number: Number of the frame.
    """

    depth: Array
    known: Array
    image: Array
    number: int


def of_scan(frame: Frame) -> tuple[DepthImage, tuple[slice, slice]]:
    """Interpolate the returns that the camera sees by Delaunay triangles, linearly in inverse depth: exact on planes.

    Returns:
        The depth image, cut to the rows and columns that returns fill, and these rows and columns.

    Raises:
        InputError: The frame has no image or calibration, or the camera sees too few returns.
    """
    image = frame.image
    if image is None or frame.calibration is None:
        raise InputError(f"scan {frame.index}: no image or no camera calibration; studies need both")
    pixels, depth = project(frame.cloud.xyz, frame.calibration)
    seen = visible(pixels, depth, image.shape)
    if seen.sum() < 100:
        raise InputError(f"scan {frame.index}: {seen.sum()} returns in the image; is the calibration right?")
    pixels, inverse = pixels[seen], 1 / depth[seen]
    known = _among(pixels, image.shape[:2])
    window = _window(known)
    every = np.stack(np.meshgrid(*(np.arange(part.start, part.stop) for part in window[::-1])), axis=-1)
    filled = LinearNDInterpolator(pixels, inverse)(every)
    outside = np.isnan(filled)
    filled[outside] = NearestNDInterpolator(pixels, inverse)(every[outside])
    return DepthImage(np.minimum(1 / filled, FARTHEST), known[window], image[window], frame.index), window


def exact(folder: Path, scan: DepthImage, window: tuple[slice, slice]) -> DepthImage | None:
    """Read the same pixels of the exact depth that `lidarlift simulate --with-depth` writes; None without it."""
    path = folder / "depth_2" / f"{scan.number:06d}.png"
    if not path.is_file():
        return None
    depth = read_depth_map(path)[window].astype(float)
    depth = np.where(depth > 0, np.minimum(depth, FARTHEST), FARTHEST)
    return DepthImage(depth, np.ones(depth.shape, bool), scan.image, scan.number)


def steps(values: Array) -> Array:
    """Compute the differences (2, H, W) of values (H, W) below minus above and right minus left, GAPS apart."""
    return np.stack([_filtered(values, axis, gap, (-1.0, 1.0)) for axis, gap in enumerate(GAPS)])


def jumps(depth: Array) -> Array:
    """Compute the relative depth difference across each pixel, 1 - near / far, (2, H, W), vertical and horizontal.

    On planes inverse depth is linear in the image. Both sides, half of GAPS away, are also extrapolated to the pixel as
    planes, and the smaller of the two differences is taken: it vanishes on slopes and nearly on folds. It is 0 close to
    the border of the image.
    """
    inverse = 1 / depth
    continued = np.stack([_filtered(inverse, axis, gap, (0.5, -1.5, 1.5, -0.5)) for axis, gap in enumerate(GAPS)])
    nearer = np.stack([maximum_filter1d(inverse, gap + 1, axis, mode="nearest") for axis, gap in enumerate(GAPS)])
    result = np.minimum(np.abs(steps(inverse)), np.abs(continued)) / nearer
    for axis, gap in enumerate(GAPS):
        along = np.moveaxis(result[axis], axis, 0)
        along[: 3 * gap // 2], along[-3 * gap // 2 :] = 0, 0
    return np.asarray(result)


def discontinuities(depth: Array) -> Array:
    """Compute the lines, one or two pixels wide, along which depth jumps, (2, H, W) bool, vertical and horizontal."""
    result = np.empty((2, *depth.shape), bool)
    for axis, (gap, size) in enumerate(zip(GAPS, jumps(depth), strict=True)):
        ridge = uniform_filter1d(size, gap + 1, axis, mode="nearest")  # a jump has a plateau of one gap's width
        top = ridge >= maximum_filter1d(ridge, 2 * gap + 1, axis, mode="nearest") - 1e-9
        result[axis] = top & (size > JUMP)
    return result


def _filtered(values: Array, axis: int, gap: int, weights: tuple[float, ...]) -> Array:
    """Correlate values (H, W) with weights that are `gap` pixels apart."""
    spread = np.zeros(gap * (len(weights) - 1) + 1)
    spread[::gap] = weights
    return np.asarray(correlate1d(values, spread, axis, mode="nearest"))


def _among(pixels: Array, shape: tuple[int, int]) -> Array:
    """Pixels (H, W) bool among those at `pixels` (N, 2), columns and rows: a closing by discs."""
    empty = np.ones(shape, bool)
    column, row = nearest_pixel(pixels)
    empty[row, column] = False
    near = distance_transform_edt(empty) <= NEAR
    return np.asarray(distance_transform_edt(near) > NEAR) | ~empty


def _window(known: Array) -> tuple[slice, slice]:
    """The rows, and then the columns, from the first to the last that is filled."""
    parts: list[slice] = []
    for axis in (1, 0):
        filled = np.flatnonzero(known.mean(axis=axis) >= FILLED)
        if len(filled) == 0:
            raise InputError("the camera sees only a corner of the scans; is the calibration right?")
        parts.append(slice(int(filled[0]), int(filled[-1]) + 1))
        known = known[parts[0]]
    return parts[0], parts[1]
