"""Depth images that lie beside a drive: exact ones of simulations, disparity of KITTI's stereo benchmark."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from enrichment.training.pooling import cells_of, pooled
from slam.data.cloud import Array
from slam.data.depth_map import read_depth_map
from slam.data.errors import InputError
from slam.data.files import matrix, read_keyed_numbers

EXACT, DISPARITY = "depth_2", "disp_occ_0"  # folders


def has_exact(folder: Path) -> bool:
    """Whether exact depth images lie in a drive's folder."""
    return (folder / EXACT).is_dir()


def has_disparity(folder: Path) -> bool:
    """Whether disparity images lie in a drive's folder."""
    return (folder / DISPARITY).is_dir()


def exact(folder: Path, number: int) -> Array | None:
    """(H, W) float32, metres: the exact depth that `lidarlift simulate --with-depth` wrote, if it did."""
    path = folder / EXACT / f"{number:06d}.png"
    return read_depth_map(path) if path.is_file() else None


def disparity(folder: Path, number: int) -> Array | None:
    """(H, W) float32, metres, 0 = none: depth by the true disparity of KITTI's stereo 2015 benchmark, if there is any.

    disp_occ_0 holds 16 bits, 256 steps a pixel; depth = f b / disparity, with f b [pixels x metres] from calib.txt:
    what P2 and P3, the two colour cameras' projections, differ by. Raises InputError where that is missing.
    """
    path = folder / DISPARITY / f"{number:06d}.png"
    if not path.is_file():
        return None
    values = read_depth_map(path)
    calibration = folder / "calib.txt"
    entries = read_keyed_numbers(calibration)
    focal_baseline = float((matrix(entries, calibration, "P2") - matrix(entries, calibration, "P3"))[0, 3])
    if focal_baseline <= 0:
        raise InputError(f"{calibration}: P3 is not to the right of P2; disparity says nothing then")
    return np.divide(np.float32(focal_baseline), values, out=np.zeros_like(values), where=values > 0)


def scaled(depth: Array, shape: tuple[int, ...], scale: float) -> Array:
    """A depth image of pixels as one of cells, `shape` (H, W)."""
    row, column = np.nonzero(depth)
    return pooled(cells_of(np.column_stack([column, row]), scale), depth[row, column], (shape[0], shape[1]))
