"""KITTI's depth completion benchmark: its folders, and its figures of one depth map."""

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
    "figures": "of each image over its pixels with truth and a prediction, then the mean over images, as in KITTI",
    "coverage": "share of the pixels with truth that a prediction exists for; KITTI expects all",
    "iMAE, iRMSE": "of the inverse depth, 1/km",
}


@dataclass(frozen=True)
class DepthMapTriple:
    """Files of one image.

    Attributes:
        sparse: The LiDAR's depths in it.
        truth: The true depths.
        image: The image itself.
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
            raise InputError(f"{self.image}: not an image that can be read; the triple needs it")
        if not sparse.shape == truth.shape == image.shape[:2]:
            raise InputError(f"{self.sparse}: {sparse.shape}, but truth is {truth.shape} and image {image.shape[:2]}")
        return sparse, truth, image


def is_depth_map_folder(path: Path) -> bool:
    """Whether a folder is laid out like KITTI's `val_selection_cropped`."""
    return all((path / name).is_dir() for name in FOLDERS)


def depth_map_triples(path: Path) -> list[DepthMapTriple]:
    """The files of a folder's images, in the order of their names.

    Args:
        path: With the folders velodyne_raw, groundtruth_depth and image; a file's name has its folder's name in it,
            `..._velodyne_raw_0000000005_image_02.png`.

    Returns:
        At least one; files that are missing show when they are read.

    Raises:
        InputError: There are none.
    """
    found = [
        DepthMapTriple(sparse, *(path / kind / sparse.name.replace(SPARSE, kind) for kind in (TRUTH, IMAGE)))
        for sparse in sorted((path / SPARSE).glob("*.png"))
    ]
    if not found:
        raise InputError(f"{path / SPARSE}: no .png in it; KITTI's val_selection_cropped has depth maps there")
    return found


@dataclass(frozen=True)
class DepthMapFigures:
    """The benchmark's figures, of one image or as means over several; None where nothing was predicted.

    Attributes:
        images: How many images these are of.
        coverage: Share of the pixels with truth that a prediction exists for, 0..1.
        mae_mm: Mean absolute error [mm].
        rmse_mm: Root of the mean square error [mm].
        imae: Mean absolute error of the inverse depth [1/km].
        irmse: Root of the mean square error of the inverse depth [1/km].
    """

    images: int
    coverage: float
    mae_mm: float | None
    rmse_mm: float | None
    imae: float | None
    irmse: float | None

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def depth_map_figures(truth: Array, dense: Array) -> DepthMapFigures:
    """The figures of one image by the rules of KITTI's depth completion benchmark (Uhrig et al., 3DV 2017).

    Args:
        truth: True depths (H, W) [m], 0 for none.
        dense: Predicted depths (H, W) [m], 0 for none.

    Returns:
        The figures over the pixels that have both.

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
    """Means over images; those that a method said nothing of count in `coverage` alone. None where it never did.

    Args:
        images: The figures of each, at least one.

    Returns:
        Their means; `images` says of how many.
    """

    def mean(name: str) -> float | None:
        values = [value for figures in images if (value := getattr(figures, name)) is not None]
        return float(np.mean(values)) if values else None

    coverage = float(np.mean([figures.coverage for figures in images]))
    return DepthMapFigures(len(images), coverage, *map(mean, ("mae_mm", "rmse_mm", "imae", "irmse")))
