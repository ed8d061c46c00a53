"""Dense depth images to study: all rings of a scan filled in, a simulation's exact ones, and where depth jumps."""

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

NEAR = 6  # pixels: gaps between returns up to twice as wide are filled in
FILLED = 0.75  # share of a row, or column, that must be known: the rest is cut off
FARTHEST = 80.0  # m: what is beyond, the sky too, counts as so far away
#: Pixels between the two sides of a jump, down and across: returns are up to six rows apart and three columns.
GAPS = (6, 4)
JUMP = 0.1  # the nearer side is at most 0.9 times as far as the other


@dataclass(frozen=True, eq=False)
class DepthImage:
    """The depth of an image, in every pixel.

    depth   (H, W) float64, metres
    known   (H, W) bool: measured nearby, not filled in across a gap
    image   (H, W, 3) uint8 RGB, the same pixels
    number  of the frame
    """

    depth: Array
    known: Array
    image: Array
    number: int


def of_scan(frame: Frame) -> tuple[DepthImage, tuple[slice, slice]]:
    """The returns that the camera sees, joined by Delaunay triangles, linear in inverse depth as planes are.

    Cut to the rows and columns that returns fill, which come second. Raises InputError where the frame has no
    image or calibration, or the camera sees too few returns.
    """
    image = frame.image
    if image is None or frame.calibration is None:
        raise InputError(f"scan {frame.index}: no image or no camera calibration; the studies need both")
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
    """The same pixels of the exact depth that `lidarlift simulate --with-depth` wrote, if it did."""
    path = folder / "depth_2" / f"{scan.number:06d}.png"
    if not path.is_file():
        return None
    depth = read_depth_map(path)[window].astype(float)
    depth = np.where(depth > 0, np.minimum(depth, FARTHEST), FARTHEST)
    return DepthImage(depth, np.ones(depth.shape, bool), scan.image, scan.number)


def steps(values: Array) -> Array:
    """(2, H, W): how much larger values (H, W) are half of GAPS below each pixel than above it, and right than left."""
    return np.stack([_filtered(values, axis, gap, (-1.0, 1.0)) for axis, gap in enumerate(GAPS)])


def jumps(depth: Array) -> Array:
    """(2, H, W), down and across: how much nearer one side of a pixel is than the other, 1 - near / far.

    On planes inverse depth is linear in the image. Each side, half of GAPS away, is also continued to the pixel as a
    plane, and the smaller of the two differences counts: slopes have none, however steep, and folds hardly any. 0 where
    the image's border is too near to tell.
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
    """(2, H, W) bool: the lines, one or two pixels wide, along which depth jumps down, and across."""
    result = np.empty((2, *depth.shape), bool)
    for axis, (gap, size) in enumerate(zip(GAPS, jumps(depth), strict=True)):
        ridge = uniform_filter1d(size, gap + 1, axis, mode="nearest")  # a jump is as large half a gap beside it
        top = ridge >= maximum_filter1d(ridge, 2 * gap + 1, axis, mode="nearest") - 1e-9
        result[axis] = top & (size > JUMP)
    return result


def _filtered(values: Array, axis: int, gap: int, weights: tuple[float, ...]) -> Array:
    """Values (H, W) weighted around each pixel, so many pixels apart."""
    spread = np.zeros(gap * (len(weights) - 1) + 1)
    spread[::gap] = weights
    return np.asarray(correlate1d(values, spread, axis, mode="nearest"))


def _among(pixels: Array, shape: tuple[int, int]) -> Array:
    """(H, W) bool: which pixels lie among those at `pixels` (N, 2), columns and rows: a closing by discs."""
    empty = np.ones(shape, bool)
    column, row = nearest_pixel(pixels)
    empty[row, column] = False
    near = distance_transform_edt(empty) <= NEAR
    return np.asarray(distance_transform_edt(near) > NEAR) | ~empty


def _window(known: Array) -> tuple[slice, slice]:
    """The rows, and of these the columns, from the first to the last that is filled."""
    parts: list[slice] = []
    for axis in (1, 0):
        filled = np.flatnonzero(known.mean(axis=axis) >= FILLED)
        if len(filled) == 0:
            raise InputError("the camera sees no more than a corner of the scans; is the calibration right?")
        parts.append(slice(int(filled[0]), int(filled[-1]) + 1))
        known = known[parts[0]]
    return parts[0], parts[1]
