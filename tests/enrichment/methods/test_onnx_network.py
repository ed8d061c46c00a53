"""Networks as methods: the network's depth in the image, ray-segment elsewhere and if an input is missing."""

from __future__ import annotations

import logging
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch

from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.interpolation.ray_segment import RaySegment
from enrichment.methods import onnx_network
from enrichment.methods.onnx_network import ImageNetwork, downsampled, upsampled
from enrichment.networks.depth_network import FAR
from enrichment.networks.export import export
from enrichment.networks.registry import NETWORKS
from slam.data.camera import project
from slam.data.cloud import Array, Calibration
from slam.data.errors import InputError

LOOKING_AHEAD = np.array([[0, -1, 0, 0.1], [0, 0, -1, -0.1], [1, 0, 0, -0.3], [0, 0, 0, 1.0]])
CALIBRATION = Calibration(np.array([[175.0, 0, 150], [0, 175.0, 42], [0, 0, 1]]), LOOKING_AHEAD)
IMAGE = np.full((93, 301, 3), 90, np.uint8)


@pytest.fixture
def scan(sparse: Callable[..., SparseScan]) -> SparseScan:
    """Ground and a wall across, before a camera."""
    return replace(sparse(), read_image=lambda: IMAGE, calibration=CALIBRATION)


@pytest.fixture
def network_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ray-segment predicts nothing: whatever a network's method predicts then is the network's."""

    def nothing(_: SparseScan, grid: RayGrid) -> Prediction:
        return Prediction(np.zeros(grid.shape), np.full(grid.shape, np.inf), np.zeros(grid.shape, bool))

    monkeypatch.setattr(onnx_network, "RaySegment", lambda: nothing)


def always(depth: float, folder: Path, name: str = "l2l", scale: float = 1.0) -> ImageNetwork:
    """A network that gives this depth [m] whatever it sees."""
    network = NETWORKS.load(name)()
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.zero_()
        dict(network.named_parameters())["scnn.last.bias" if name == "l2l" else "head.4.bias"].fill_(depth / FAR)
    export(network, folder, name, scale)
    return ImageNetwork(name, folder)


def same(one: Prediction, other: Prediction) -> None:
    for field in ("ranges", "sigma", "trusted"):
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field))


@pytest.mark.parametrize(("name", "scale"), [("l2l", 1.0), ("l2l", 0.5), ("f2l", 0.5)])
def test_rays_in_the_image_end_at_the_depth_of_the_network(
    name: str, scale: float, scan: SparseScan, grid: RayGrid, tmp_path: Path
) -> None:
    found, plain = always(200.0, tmp_path, name, scale)(scan, grid), RaySegment()(scan, grid)
    row, column = np.nonzero(found.ranges > 100)  # ray-segment's end at the wall or on the ground
    pixels, depth = project(grid.points(found.ranges[row, column], row, column), CALIBRATION)
    np.testing.assert_allclose(depth, 200.0, rtol=1e-5)
    assert len(row) > 5000
    assert (np.abs(pixels - (150, 46)) <= (151, 47)).all()
    assert found.trusted[row, column].all()  # nothing could be smoother
    beside = np.abs(grid.azimuth) > 1
    assert plain.ranges[:, beside].any()
    same(*(Prediction(p.ranges[:, beside], p.sigma[:, beside], p.trusted[:, beside]) for p in (found, plain)))


@pytest.mark.usefixtures("network_alone")
def test_a_wall_is_predicted_at_its_measured_range(scan: SparseScan, grid: RayGrid, tmp_path: Path) -> None:
    """A network that takes means of depth near by, at half of the image's resolution."""
    network = NETWORKS.load("l2l")()
    with torch.no_grad():
        for name, parameter in network.named_parameters():
            parameter.fill_(1 / parameter.shape[1] if name.endswith("weight") else 0)
    export(network, tmp_path, "l2l", scale=0.5)
    wall = replace(scan, cloud=scan.cloud.select(scan.cloud.xyz[:, 0] > 14.99))
    found, plain = ImageNetwork("l2l", tmp_path)(wall, grid), RaySegment()(wall, grid)
    known = (plain.ranges > 0) & (np.abs(grid.azimuth) < 0.6)
    answered = known & (found.ranges > 0)
    assert answered.sum() > 0.9 * known.sum()
    rho = found.ranges * np.cos(grid.sensor.elevation)[:, None]
    np.testing.assert_allclose((rho * np.cos(grid.azimuth))[answered], 15.0, rtol=1e-3)


@pytest.mark.usefixtures("network_alone")
@pytest.mark.parametrize(("factor", "wrong"), [(0.9, False), (1.1, False), (0.5, True)])
def test_depths_are_corrected_by_the_returns_above_and_below(
    factor: float, wrong: bool, scan: SparseScan, grid: RayGrid, tmp_path: Path
) -> None:
    """A wall that a network has too near or too far; half as far is another thing before it."""
    wall = replace(scan, cloud=scan.cloud.select(scan.cloud.xyz[:, 0] > 14.99))
    found, plain = always(factor * 14.7, tmp_path)(wall, grid), RaySegment()(wall, grid)  # 0.3 m before the LiDAR
    known = (plain.ranges > 0) & (np.abs(grid.azimuth) < 0.6)
    rho = found.ranges * np.cos(grid.sensor.elevation)[:, None]
    answered = known & (found.ranges > 0)
    assert answered.sum() > 0.8 * known.sum()
    expected = factor * 14.7 + 0.3 if wrong else 15.0
    np.testing.assert_allclose((rho * np.cos(grid.azimuth))[answered], expected, rtol=5e-3)


def test_pixels_without_depth_use_ray_segment(scan: SparseScan, grid: RayGrid, tmp_path: Path) -> None:
    same(always(-1.0, tmp_path)(scan, grid), RaySegment()(scan, grid))


def test_images_without_returns_use_ray_segment(scan: SparseScan, grid: RayGrid, tmp_path: Path) -> None:
    behind = replace(scan, cloud=scan.cloud.select(scan.cloud.xyz[:, 0] < 0))
    same(always(10.0, tmp_path)(behind, grid), RaySegment()(behind, grid))


@pytest.mark.parametrize("missing", ["weights", "onnxruntime", "image", "calibration"])
def test_without_weights_networks_fall_back_to_ray_segment(
    missing: str,
    scan: SparseScan,
    grid: RayGrid,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    if missing == "onnxruntime":
        monkeypatch.setitem(sys.modules, "onnxruntime", None)
    elif missing == "image":
        scan = replace(scan, read_image=lambda: None)
    elif missing == "calibration":
        scan = replace(scan, calibration=None)
    method = ImageNetwork("f2l", tmp_path) if missing == "weights" else always(10.0, tmp_path)
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            same(method(scan, grid), RaySegment()(scan, grid))
    (record,) = caplog.records
    assert missing.replace("weights", "f2l.onnx") in record.getMessage()
    assert "ray-segment" in record.getMessage()


@pytest.mark.parametrize("content", [b"", b"nothing of the kind", None])
def test_damaged_weights_are_an_error(content: bytes | None, tmp_path: Path) -> None:
    always(10.0, tmp_path)
    path = tmp_path / "l2l.onnx"
    if content is None:  # a network, but not one of ours
        model = onnx.load(path)
        del model.metadata_props[:]
        onnx.save(model, path)
    else:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"l2l\.onnx: .*export the network again"):
        ImageNetwork("l2l", tmp_path)


def test_a_network_with_data_in_other_files_is_refused(tmp_path: Path) -> None:
    """The file beside holds what a stranger wants to read."""
    always(10.0, tmp_path)
    whole = onnx.load(tmp_path / "l2l.onnx")
    onnx.save_model(whole, tmp_path / "l2l.onnx", save_as_external_data=True, location="secret", size_threshold=0)
    assert (tmp_path / "secret").is_file()
    with pytest.raises(InputError, match="refers to data in other files"):
        ImageNetwork("l2l", tmp_path)


def test_downsampling_takes_the_nearest_depth() -> None:
    sparse = np.zeros((5, 7), np.float32)
    sparse[0, 0], sparse[1, 1], sparse[2, 3], sparse[4, 6] = 9.0, 4.0, 7.0, 3.0  # the last one in no whole cell
    assert downsampled(sparse, 0.5).tolist() == [[4, 0, 0], [0, 7, 0]]
    np.testing.assert_array_equal(downsampled(sparse, 1.0), sparse)


def test_upsampling_is_linear_in_inverse_depth() -> None:
    cells = 1 / (0.05 + 0.01 * np.arange(6, dtype=np.float32) * np.ones((4, 1), np.float32))
    pixels = upsampled(cells, 0.5, (9, 12))
    expected = 0.05 + 0.01 * (np.arange(1, 11) / 2 - 0.25) * np.ones((9, 1))
    np.testing.assert_allclose(1 / pixels[:, 1:-1], expected, rtol=1e-5)


def test_upsampling_keeps_missing_depth() -> None:
    cells: Array = np.full((4, 6), 8.0, np.float32)
    cells[1, 2] = -3.0
    pixels = upsampled(cells, 0.5, (8, 12))
    assert not pixels[2:4, 4:6].any()
    np.testing.assert_allclose(pixels[:, 8:], 8.0, rtol=1e-5)


def test_running_networks_does_not_import_torch() -> None:
    code = """
import sys
import enrichment.enricher, lidarlift.cli
from enrichment.methods.registry import METHODS
for name in METHODS.names():
    METHODS.load(name)()
try:
    lidarlift.cli.main()
except SystemExit:
    print("torch" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code, "--help"], check=True, capture_output=True, text=True)
    assert done.stdout.endswith("False\n")
