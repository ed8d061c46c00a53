"""KITTI's depth completion benchmark: its folders, and its figures of one depth map."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from eval.depth.metrics import Figures, errors
from slam.data.cloud import Array
from slam.data.depth_map import read_depth_map
from slam.data.errors import InputError
from slam.data.files import image_reader

SPARSE, TRUTH, IMAGE = FOLDERS = ("velodyne_raw", "groundtruth_depth", "image")
KEYS = ("mae_mm", "rmse_mm", "imae", "irmse")

PROTOCOL = {
    "figures": "of each image over its pixels with truth and a prediction, then the mean over images, as in KITTI",
    "coverage": "share of the pixels with truth that a prediction exists for; KITTI expects all",
    "iMAE, iRMSE": "of the inverse depth, 1/km",
}


@dataclass(frozen=True)
class DepthMapTriple:
    """Files of one image: the LiDAR's depths in it, the truth, and the image itself."""

    sparse: Path
    truth: Path
    image: Path

    def read(self) -> tuple[Array, Array, Array]:
        """Sparse and true depths (H, W) float32 [m], 0 for none, and the image (H, W, 3) uint8 RGB.

        Raises InputError where a file is missing or damaged, or their sizes differ.
        """
        sparse, truth, image = read_depth_map(self.sparse), read_depth_map(self.truth), image_reader(self.image)()
        if image is None:
            raise InputError(f"{self.image}: not an image that can be read; the triple needs it")
        if not sparse.shape == truth.shape == image.shape[:2]:
            raise InputError(f"{self.sparse}: {sparse.shape}, but truth is {truth.shape} and image {image.shape[:2]}")
        return sparse, truth, image


def is_depth_map_folder(path: Path) -> bool:
    """Whether a folder is laid out like KITTI's `val_selection_cropped`."""
    return all((path / name).is_dir() for name in FOLDERS)


def depth_map_triples(path: Path) -> list[DepthMapTriple]:
    """In the order of their names: folder's name and file's name agree, `..._velodyne_raw_0000000005_image_02.png`.

    Raises InputError where there are none.
    """
    found = [
        DepthMapTriple(sparse, *(path / kind / sparse.name.replace(SPARSE, kind) for kind in (TRUTH, IMAGE)))
        for sparse in sorted((path / SPARSE).glob("*.png"))
    ]
    if not found:
        raise InputError(f"{path / SPARSE}: no .png in it; KITTI's val_selection_cropped has depth maps there")
    return found


def evaluate_map(truth: Array, dense: Array) -> Figures:
    """The benchmark's figures of one image, from depth maps (H, W) [m] with 0 for none; see `PROTOCOL`."""
    asked = truth > 0
    known = asked & (dense > 0)
    figures = errors(truth[known].astype(float), dense[known].astype(float) - truth[known])
    return {"coverage": known.sum() / max(asked.sum(), 1), **{key: figures[key] for key in KEYS}}


def mean_figures(images: list[Figures]) -> Figures:
    """Means over images; those that a method said nothing of count in `coverage` alone. None where it never did."""
    result: Figures = {"images": len(images)}
    for key in ("coverage", *KEYS):
        values = [figures[key] for figures in images if figures[key] is not None]
        result[key] = float(np.mean(values)) if values else None
    return result
