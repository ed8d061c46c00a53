"""Target depth images in the folder of a sequence: exact ones of simulations, disparity of KITTI's stereo benchmark."""

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
    """Check whether the folder of a sequence has exact depth images."""
    return (folder / EXACT).is_dir()


def has_disparity(folder: Path) -> bool:
    """Check whether the folder of a sequence has disparity images."""
    return (folder / DISPARITY).is_dir()


def exact(folder: Path, number: int) -> Array | None:
    """Read the exact depth (H, W) float32 [m] that `lidarlift simulate --with-depth` writes; None without it."""
    path = folder / EXACT / f"{number:06d}.png"
    return read_depth_map(path) if path.is_file() else None


def disparity(folder: Path, number: int) -> Array | None:
    """Read the depth (H, W) float32 [m], 0 = none, from the true disparity of KITTI's stereo 2015; None without it.

    disp_occ_0 has 16 bits, 256 steps per pixel; depth = f b / disparity, with f b [pixels x metres] from the difference
    of P2 and P3, the projections of the two colour cameras, in calib.txt.

    Raises:
        InputError: The calibration is missing or has no baseline.
    """
    path = folder / DISPARITY / f"{number:06d}.png"
    if not path.is_file():
        return None
    values = read_depth_map(path)
    calibration = folder / "calib.txt"
    entries = read_keyed_numbers(calibration)
    focal_baseline = float((matrix(entries, calibration, "P2") - matrix(entries, calibration, "P3"))[0, 3])
    if focal_baseline <= 0:
        raise InputError(f"{calibration}: P3 is not to the right of P2; check the calibration of the disparity images")
    return np.divide(np.float32(focal_baseline), values, out=np.zeros_like(values), where=values > 0)


def scaled(depth: Array, shape: tuple[int, ...], scale: float) -> Array:
    """Pool a depth image of pixels into cells, `shape` (H, W)."""
    row, column = np.nonzero(depth)
    return pooled(cells_of(np.column_stack([column, row]), scale), depth[row, column], (shape[0], shape[1]))
