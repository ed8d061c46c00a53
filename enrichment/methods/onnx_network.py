"""The paper's networks as methods of enrichment, run by ONNX Runtime."""

from __future__ import annotations

import logging
from functools import partial
from importlib import resources
from importlib.resources.abc import Traversable
from importlib.util import find_spec
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.ndimage import map_coordinates

from enrichment.geometry.image_rays import ImageRays
from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan, heights
from enrichment.interpolation.depth_completion import IP_BASIC_SPREAD, DepthCompletion
from enrichment.interpolation.ray_segment import RaySegment
from slam.data.camera import project, visible
from slam.data.cloud import Array
from slam.data.errors import InputError

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

WEIGHTS = resources.files("enrichment") / "weights"  # NAME.onnx, as enrichment.networks.export writes them

AFRESH = "install lidarlift afresh, or export the network again"

log = logging.getLogger(__name__)


def has_weights(name: str) -> bool:
    """Whether a network can run here: its weights are shipped, and ONNX Runtime is installed."""
    return (WEIGHTS / f"{name}.onnx").is_file() and find_spec("onnxruntime") is not None


SAME_SURFACE = 0.3  # as a share: what is further off than that is another surface; least errors on KITTI raw 0013


class Fallback:
    """Says, once, that ray-segment takes a network's place, and why: its own `fault`, else that of the scan."""

    def __init__(self, name: str) -> None:
        self.fault, self._name, self._told = "", name, False

    def notice(self, fault: str = "") -> None:
        if not self._told:
            log.warning("%s: %s; ray-segment interpolation takes its place", self._name, self.fault or fault)
            self._told = True


class ImageNetwork(DepthCompletion):
    """The method: ray-segment, but where a ray meets the network's dense depth image, that, put right by the returns
    above and below.

    Sigma in the image is a share of the spread of depth, as for IP-Basic; the calibration on held-out rings finds out
    by how much a network's errors differ. Where the network cannot run, for want of an image, of its weights in
    `folder` or of ONNX Runtime, it is ray-segment alone, and the log says so once. Raises InputError where the weights
    are there but damaged. `parameters` is how many were learned, None where the network cannot run.
    """

    parameters: int | None = None

    def __init__(self, name: str, folder: Traversable = WEIGHTS) -> None:
        self._fallback = Fallback(name)
        self.spread_share = IP_BASIC_SPREAD
        try:
            self.complete = network = OnnxNetwork(folder / f"{name}.onnx")
            self.parameters = network.parameters
        except (ImportError, FileNotFoundError) as error:
            self._fallback.fault = f"cannot run here ({error})"

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        plain = RaySegment()(scan, grid)
        if self._fallback.fault or scan.calibration is None or scan.image is None:
            self._fallback.notice("a scan without an image, or without its calibration")
            return plain
        seen = super().__call__(scan, grid)
        met = seen.ranges > 0
        return Prediction(
            ranges=np.where(met, seen.ranges, plain.ranges),
            sigma=np.where(met, seen.sigma, plain.sigma),
            trusted=np.where(met, seen.trusted, plain.trusted),
        )

    def corrected(self, met: Array, rays: ImageRays, dense: Array, scan: SparseScan, grid: RayGrid) -> Array:
        """As many times farther as the image is off at the returns above and below.

        A cell is two pixels high, which is two thirds of a metre on the ground 20 m ahead, and a return may lie
        anywhere in it: the network cannot know its ranges better, but the scan does.
        """
        ratio = range_correction(dense, scan)
        upper = scan.rows_above(grid.sensor)[rays.row]
        lines, own = heights(grid.sensor)[rays.row], heights(scan.lines)[scan.rings]
        share = (own[upper] - lines) / (own[upper] - own[upper + 1])
        above, below = (ratio[scan.points[ring, rays.column]] for ring in (upper, upper + 1))
        above, below = np.where(np.isnan(above), below, above), np.where(np.isnan(below), above, below)
        return np.asarray(met * np.nan_to_num((1 - share) * above + share * below, nan=1.0))


l2l, li2l, f2l = (partial(ImageNetwork, name) for name in ("l2l", "li2l", "f2l"))


def session(file: Traversable) -> InferenceSession:
    """What runs a network, on the CPU. Raises as `OnnxNetwork` does."""
    import onnxruntime

    content = file.read_bytes()
    try:
        return onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    except Exception as error:  # its own errors have no other class in common
        raise InputError(f"{file}: no ONNX network, or damaged ({' '.join(str(error).split())}); {AFRESH}") from error


def metadata_number(session: InferenceSession, file: Traversable, name: str) -> float:
    """A number of a network's metadata. Raises InputError where it is missing."""
    try:
        return float(session.get_modelmeta().custom_metadata_map[name])
    except (KeyError, ValueError) as error:
        raise InputError(f"{file}: a network that does not say its {name}; {AFRESH}") from error


def range_correction(dense: Array, scan: SparseScan) -> Array:
    """(N,) float32: how many times as far as a dense depth image (H, W) has it each point of the scan really is, within
    1 / (1 + SAME_SURFACE) and 1 + SAME_SURFACE; NaN where the camera does not see the point or the image has something
    else there."""
    assert scan.calibration is not None
    pixels, depth = project(scan.cloud.xyz, scan.calibration)
    seen = visible(pixels, depth, dense.shape)
    inverse = np.divide(1, dense, out=np.full(dense.shape, np.nan, np.float32), where=dense > 0)
    ratio = np.full(len(depth), np.nan, np.float32)
    ratio[seen] = depth[seen] * map_coordinates(inverse, pixels[seen].T[::-1], order=1, mode="nearest")
    return np.where(np.abs(np.log(np.maximum(ratio, 1e-3))) < np.log1p(SAME_SURFACE), ratio, np.float32(np.nan))


class OnnxNetwork:
    """A depth completion by a network, at the scale, in cells a pixel, that its file names, with so many parameters.

    Raises FileNotFoundError without the file, ImportError without ONNX Runtime, InputError where the file is damaged.
    """

    def __init__(self, file: Traversable) -> None:
        self._session = session(file)
        self._inputs = [entry.name for entry in self._session.get_inputs()]  # L2L has no image
        self.scale = metadata_number(self._session, file, "scale")
        self.parameters = int(metadata_number(self._session, file, "parameters"))

    def __call__(self, sparse: Array, image: Array) -> Array:
        if not sparse.any():
            return sparse
        depth = downsampled(sparse, self.scale)
        height, width = (round(size / self.scale) for size in depth.shape)
        colours = cv2.resize(image[:height, :width], depth.shape[::-1], interpolation=cv2.INTER_AREA)
        given = {"image": colours.transpose(2, 0, 1)[None] / np.float32(255), "depth": depth[None, None]}
        (dense,) = self._session.run(None, {name: given[name] for name in self._inputs})
        return upsampled(dense[0, 0], self.scale, sparse.shape)


def downsampled(sparse: Array, scale: float) -> Array:
    """A depth image (H, W) [m, 0 = none] with `scale` cells a pixel, at most 1: the nearest depth in each cell.

    Cells are whole: what is left of the image at the right and below is cut off.
    """
    shape = tuple(int(size * scale) for size in sparse.shape)
    pixels = np.nonzero(sparse)
    cells = ((np.stack(pixels) + 0.5) * scale).astype(np.int64)
    inside = (cells < np.array(shape)[:, None]).all(axis=0)
    depth = np.full(shape, np.inf, np.float32)
    np.minimum.at(depth, tuple(cells[:, inside]), sparse[pixels][inside])
    return np.where(np.isinf(depth), np.float32(0), depth)


def upsampled(dense: Array, scale: float, shape: tuple[int, ...]) -> Array:
    """A depth image of cells at (H, W) pixels, linear in inverse depth; what is no depth, 0 or less, stays none."""
    inverse = np.divide(1, dense, out=np.full(dense.shape, np.nan, np.float32), where=dense > 0)
    u, v = (((np.arange(size) + 0.5) * scale - 0.5).astype(np.float32) for size in shape[::-1])
    inverse = cv2.remap(inverse, *np.meshgrid(u, v), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.divide(1, inverse, out=np.zeros(shape, np.float32), where=np.isfinite(inverse))
