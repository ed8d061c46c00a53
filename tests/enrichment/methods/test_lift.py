"""Lift as a method: on all rays between two returns, for any LiDAR; without what it needs, ray-segment."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from enrichment.geometry.rays import RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from enrichment.interpolation.ray_segment import RaySegment
from enrichment.lift.network import Lift
from enrichment.methods.lift import LiftMethod
from enrichment.networks.export import export_lift
from slam.data.errors import InputError


@pytest.fixture
def method(tmp_path: Path) -> LiftMethod:
    """Untrained: near ray-segment, which is where learning starts."""
    torch.manual_seed(0)
    export_lift(Lift(), tmp_path)
    return LiftMethod(tmp_path)


@pytest.mark.parametrize("columns", [2000, 1801])
def test_lift_predicts_the_same_rays_as_ray_segment(
    columns: int, method: LiftMethod, sparse: Callable[..., SparseScan]
) -> None:
    scan = replace(sparse(), columns=columns)
    grid = RayGrid(scan.lines, columns)
    found, plain = method(scan, grid), RaySegment()(scan, grid)
    np.testing.assert_array_equal(found.ranges > 0, plain.ranges > 0)
    np.testing.assert_array_equal(np.isfinite(found.sigma), plain.ranges > 0)
    assert not found.trusted[plain.ranges == 0].any()
    known = plain.ranges > 0
    assert np.median(np.abs(found.ranges[known] / plain.ranges[known] - 1)) < 0.1
    assert (found.sigma[known] > 0).all()


def test_lift_needs_no_camera(method: LiftMethod, sparse: Callable[..., SparseScan], grid: RayGrid) -> None:
    assert sparse().image is None
    assert method(sparse(), grid).ranges.any()


def test_lift_predicts_held_out_rings_only(
    method: LiftMethod, sparse: Callable[..., SparseScan], grid: RayGrid
) -> None:
    """A ray's answer does not depend on which others are asked for."""
    scan, rows = sparse(), np.array([5, 6, 30])
    lines = grid.sensor.only(rows)
    few, all_of_them = method(scan, RayGrid(lines)), method(scan, grid)
    np.testing.assert_allclose(few.ranges, all_of_them.ranges[rows], rtol=1e-3)
    np.testing.assert_allclose(few.sigma, all_of_them.sigma[rows], rtol=1e-3)


@pytest.mark.parametrize("missing", ["weights", "onnxruntime"])
def test_without_weights_lift_falls_back_to_ray_segment(
    missing: str,
    method: LiftMethod,
    sparse: Callable[..., SparseScan],
    grid: RayGrid,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    if missing == "onnxruntime":
        monkeypatch.setitem(sys.modules, "onnxruntime", None)
    else:
        (tmp_path / "lift.onnx").unlink()
    method = LiftMethod(tmp_path)
    assert method.parameters is None
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            np.testing.assert_array_equal(method(sparse(), grid).ranges, RaySegment()(sparse(), grid).ranges)
    (record,) = caplog.records
    assert missing.replace("weights", "lift.onnx") in record.getMessage()


def test_damaged_weights_are_an_error(method: LiftMethod, tmp_path: Path) -> None:
    assert method.parameters is not None
    (tmp_path / "lift.onnx").write_bytes(b"nothing of the kind")
    with pytest.raises(InputError, match=r"lift\.onnx: not an ONNX network"):
        LiftMethod(tmp_path)


def test_without_rays_between_the_rings_it_predicts_nothing(
    method: LiftMethod, sparse: Callable[..., SparseScan]
) -> None:
    scan = sparse()
    found = method(scan, RayGrid(scan.lines.only(scan.rings)))
    assert not found.ranges.any()
    assert not found.trusted.any()
    assert np.isinf(found.sigma).all()
