"""The paper's networks as enrichment methods, run by ONNX Runtime."""

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
from slam.data.machine import usable_cores

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

WEIGHTS = resources.files("enrichment") / "weights"  # NAME.onnx, as enrichment.networks.export writes them

REMEDY = "reinstall lidarlift, or export the network again"

EXTERNAL = b"location"  # key of a tensor whose data are in another file

log = logging.getLogger(__name__)


def has_weights(name: str) -> bool:
    """Check whether a network can run: its weights are shipped, and ONNX Runtime is installed."""
    return (WEIGHTS / f"{name}.onnx").is_file() and find_spec("onnxruntime") is not None


SAME_SURFACE = 0.3  # relative deviation: beyond it a return is on another surface; best value on KITTI raw 0013


class Fallback:
    """Logs once that ray-segment replaces a network.

    Args:
        name: Name of the network.

    Attributes:
        fault: Why the network cannot run at all, '' if it can.
    """

    def __init__(self, name: str) -> None:
        self.fault, self._name, self._told = "", name, False

    def notice(self, fault: str = "") -> None:
        """Log the reason, which is `self.fault` or else the `fault` of the scan."""
        if not self._told:
            log.warning("%s: %s; ray-segment interpolation is used instead", self._name, self.fault or fault)
            self._told = True


class ImageNetwork(DepthCompletion):
    """Enrichment method that uses a network's depth inside the image, and ray-segment elsewhere.

    The network's depth is rescaled by the returns above and below each ray. Sigma in the image is a share of the spread
    of depth, as for IP-Basic; online calibration on held-out rings adapts it to the network's errors. If the network
    cannot run, without an image, weights or ONNX Runtime, ray-segment is used everywhere, and this is logged once.

    Args:
        name: Name of the network.
        folder: Folder of the weights.

    Attributes:
        parameters: Number of learned parameters, None if the network cannot run.

    Raises:
        InputError: The weights are damaged.
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
        """Predict ranges between the rings."""
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
        """Scale the ranges (M,) by the ratio of measured to predicted depth at the returns above and below.

        A cell is two pixels high, which is two thirds of a metre on the ground 20 m ahead, and a return may be anywhere
        in it: the network cannot resolve its range, but the scan does.
        """
        ratio = range_correction(dense, scan)
        upper = scan.rows_above(grid.sensor)[rays.row]
        lines, own = heights(grid.sensor)[rays.row], heights(scan.lines)[scan.rings]
        share = (own[upper] - lines) / (own[upper] - own[upper + 1])
        above, below = (ratio[scan.points[ring, rays.column]] for ring in (upper, upper + 1))
        above, below = np.where(np.isnan(above), below, above), np.where(np.isnan(below), above, below)
        return np.asarray(met * np.nan_to_num((1 - share) * above + share * below, nan=1.0))


l2l, li2l, f2l = (partial(ImageNetwork, name) for name in ("l2l", "li2l", "f2l"))


def session(file: Traversable, threads: int | None = None) -> InferenceSession:
    """Open an inference session of a network on the CPU.

    Args:
        file: The ONNX file.
        threads: Number of threads, by default one for each core that this process may use.

    Threads without work sleep. ONNX Runtime's default, one for each core of the machine, which spin while they wait,
    took 1.8 times the processor time on two cores, and 1.6 times the time while other processes ran. Without ONNX
    Runtime's plan of all buffers, Lift takes the same time and 48 MB less.

    ONNX can refer to other files, by the key 'location' of a tensor. Weights are one file, and one from a stranger must
    not read others: a file with this word is refused before ONNX Runtime sees it.

    Raises:
        FileNotFoundError: The file is missing.
        ImportError: ONNX Runtime is not installed.
        InputError: The file is damaged, or refers to other files.
    """
    import onnxruntime

    content = file.read_bytes()
    if EXTERNAL in content:
        raise InputError(f"{file}: the network refers to data in other files, which are not read; {REMEDY}")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads or usable_cores()
    options.enable_mem_pattern = False
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime's errors have no other common base
        raise InputError(
            f"{file}: not an ONNX network, or damaged ({' '.join(str(error).split())}); {REMEDY}"
        ) from error


def metadata_number(session: InferenceSession, file: Traversable, name: str) -> float:
    """Return a number from a network's metadata.

    Raises:
        InputError: It is missing.
    """
    try:
        return float(session.get_modelmeta().custom_metadata_map[name])
    except (KeyError, ValueError) as error:
        raise InputError(f"{file}: the metadata of the network lack '{name}'; {REMEDY}") from error


def range_correction(dense: Array, scan: SparseScan) -> Array:
    """Compute the ratio of measured to predicted depth for each point of the scan, (N,) float32.

    Ratios outside 1 / (1 + SAME_SURFACE) to 1 + SAME_SURFACE are of another surface. They are NaN, as are points that
    the camera does not see.
    """
    assert scan.calibration is not None
    pixels, depth = project(scan.cloud.xyz, scan.calibration)
    seen = visible(pixels, depth, dense.shape)
    inverse = np.divide(1, dense, out=np.full(dense.shape, np.nan, np.float32), where=dense > 0)
    ratio = np.full(len(depth), np.nan, np.float32)
    ratio[seen] = depth[seen] * map_coordinates(inverse, pixels[seen].T[::-1], order=1, mode="nearest")
    return np.where(np.abs(np.log(np.maximum(ratio, 1e-3))) < np.log1p(SAME_SURFACE), ratio, np.float32(np.nan))


class OnnxNetwork:
    """Depth completion by a network.

    Args:
        file: The ONNX file.

    Attributes:
        scale: Cells per pixel, from the metadata of the file.
        parameters: Number of learned parameters.

    Raises:
        FileNotFoundError: The file is missing.
        ImportError: ONNX Runtime is not installed.
        InputError: The file is damaged.
    """

    def __init__(self, file: Traversable) -> None:
        self._session = session(file)
        self._inputs = [entry.name for entry in self._session.get_inputs()]  # L2L has no image
        self.scale = metadata_number(self._session, file, "scale")
        self.parameters = int(metadata_number(self._session, file, "parameters"))

    def __call__(self, sparse: Array, image: Array) -> Array:
        """Complete a sparse depth image (H, W) [m], given the image (H, W, 3)."""
        if not sparse.any():
            return sparse
        depth = downsampled(sparse, self.scale)
        height, width = (round(size / self.scale) for size in depth.shape)
        colours = cv2.resize(image[:height, :width], depth.shape[::-1], interpolation=cv2.INTER_AREA)
        given = {"image": colours.transpose(2, 0, 1)[None] / np.float32(255), "depth": depth[None, None]}
        (dense,) = self._session.run(None, {name: given[name] for name in self._inputs})
        return upsampled(dense[0, 0], self.scale, sparse.shape)


def downsampled(sparse: Array, scale: float) -> Array:
    """Downsample a depth image (H, W) [m, 0 = none] to `scale` <= 1 cells per pixel: the nearest depth in each cell.

    Partial cells at the right and at the bottom are cut off.
    """
    shape = tuple(int(size * scale) for size in sparse.shape)
    pixels = np.nonzero(sparse)
    cells = ((np.stack(pixels) + 0.5) * scale).astype(np.int64)
    inside = (cells < np.array(shape)[:, None]).all(axis=0)
    depth = np.full(shape, np.inf, np.float32)
    np.minimum.at(depth, tuple(cells[:, inside]), sparse[pixels][inside])
    return np.where(np.isinf(depth), np.float32(0), depth)


def upsampled(dense: Array, scale: float, shape: tuple[int, ...]) -> Array:
    """Upsample a depth image of cells to (H, W) pixels, linearly in inverse depth; depths of 0 or less stay none."""
    inverse = np.divide(1, dense, out=np.full(dense.shape, np.nan, np.float32), where=dense > 0)
    u, v = (((np.arange(size) + 0.5) * scale - 0.5).astype(np.float32) for size in shape[::-1])
    inverse = cv2.remap(inverse, *np.meshgrid(u, v), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.divide(1, inverse, out=np.zeros(shape, np.float32), where=np.isfinite(inverse))
