"""KITTI's depth completion benchmark: folder layout, and metrics of depth maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from eval.depth.metrics import errors
from slam.data.cloud import Array
from slam.data.depth_map import read_depth_map
from slam.data.errors import InputError
from slam.data.images import ImageFile

SPARSE, TRUTH, IMAGE = FOLDERS = ("velodyne_raw", "groundtruth_depth", "image")

PROTOCOL = {
    "figures": "per image over the pixels with ground truth and a prediction, then averaged over images, as in KITTI",
    "coverage": "share of the pixels with ground truth that have a prediction; KITTI expects all",
    "iMAE, iRMSE": "errors of the inverse depth, 1/km",
}


@dataclass(frozen=True)
class DepthMapTriple:
    """Files of one image.

    Attributes:
        sparse: Depth map of the LiDAR.
        truth: True depth map.
        image: The image.
    """

    sparse: Path
    truth: Path
    image: Path

    def read(self) -> tuple[Array, Array, Array]:
        """Read the three files.

        Returns:
            Sparse and true depths (H, W) float32 [m], 0 for none, and the image (H, W, 3) uint8 RGB.

        Raises:
            InputError: A file is missing or damaged, or their sizes differ.
        """
        sparse, truth, image = read_depth_map(self.sparse), read_depth_map(self.truth), ImageFile(self.image)()
        if image is None:
            raise InputError(f"{self.image}: not a readable image; each depth map needs its image")
        if not sparse.shape == truth.shape == image.shape[:2]:
            raise InputError(
                f"{self.sparse}: size {sparse.shape}, but the ground truth has {truth.shape} and the image "
                f"{image.shape[:2]}; all three must agree"
            )
        return sparse, truth, image


def is_depth_map_folder(path: Path) -> bool:
    """Check whether a folder has the layout of KITTI's `val_selection_cropped`."""
    return all((path / name).is_dir() for name in FOLDERS)


def depth_map_triples(path: Path) -> list[DepthMapTriple]:
    """List the files of each image of a folder, sorted by name.

    Args:
        path: A folder with velodyne_raw, groundtruth_depth and image; file names contain the name of their folder, as
            in `..._velodyne_raw_0000000005_image_02.png`.

    Returns:
        At least one triple; missing files are reported when they are read.

    Raises:
        InputError: The folder has no depth maps.
    """
    found = [
        DepthMapTriple(sparse, *(path / kind / sparse.name.replace(SPARSE, kind) for kind in (TRUTH, IMAGE)))
        for sparse in sorted((path / SPARSE).glob("*.png"))
    ]
    if not found:
        raise InputError(f"{path / SPARSE}: has no .png; KITTI's val_selection_cropped has its depth maps there")
    return found


@dataclass(frozen=True)
class DepthMapFigures:
    """Figures of the benchmark, for one image or averaged over several; None if nothing was predicted.

    Attributes:
        images: Number of images.
        coverage: Share of the pixels with ground truth that have a prediction, 0..1.
        mae_mm: Mean absolute error [mm].
        rmse_mm: Root mean square error [mm].
        imae: Mean absolute error of the inverse depth [1/km].
        irmse: Root mean square error of the inverse depth [1/km].
    """

    images: int
    coverage: float
    mae_mm: float | None
    rmse_mm: float | None
    imae: float | None
    irmse: float | None

    def as_dict(self) -> dict[str, Any]:
        """Return the content for JSON."""
        return asdict(self)


def depth_map_figures(truth: Array, dense: Array) -> DepthMapFigures:
    """Compute the figures of one image by the rules of KITTI's depth completion benchmark (Uhrig et al., 3DV 2017).

    Args:
        truth: True depths (H, W) [m], 0 where unknown.
        dense: Predicted depths (H, W) [m], 0 where not predicted.

    Returns:
        The figures over the pixels that have both depths.

    Example:
        >>> found = depth_map_figures(np.array([[2.0, 4.0, 0.0]]), np.array([[2.5, 0.0, 9.0]]))
        >>> found.mae_mm, found.coverage
        (500.0, 0.5)
    """
    asked = truth > 0
    known = asked & (dense > 0)
    found = errors(truth[known].astype(float), dense[known].astype(float) - truth[known])
    coverage = float(known.sum() / max(asked.sum(), 1))
    return DepthMapFigures(1, coverage, found.mae_mm, found.rmse_mm, found.imae, found.irmse)


def mean_over_images(images: Sequence[DepthMapFigures]) -> DepthMapFigures:
    """Average figures over images; images without any prediction count for `coverage` only.

    Args:
        images: The figures of each image, at least one.

    Returns:
        The means, None without any prediction, and the number of images.
    """

    def mean(name: str) -> float | None:
        values = [value for figures in images if (value := getattr(figures, name)) is not None]
        return float(np.mean(values)) if values else None

    coverage = float(np.mean([figures.coverage for figures in images]))
    return DepthMapFigures(len(images), coverage, *map(mean, ("mae_mm", "rmse_mm", "imae", "irmse")))
