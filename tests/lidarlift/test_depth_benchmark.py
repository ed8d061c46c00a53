"""The depth benchmark as a function: figures of methods whose answers are known, and progress."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import SparseScan
from lidarlift.depth_benchmark import completions, depth_map_report, sequence_report
from slam.data.cloud import Array
from slam.data.dataset import open_dataset
from slam.data.errors import InputError


class AlwaysTenMetres:
    """A method with three parameters that predicts the range of every ray."""

    parameters = 3

    def __call__(self, scan: SparseScan, grid: RayGrid) -> Prediction:
        shape = (grid.sensor.ring_count, grid.columns)
        return Prediction(np.full(shape, 10, np.float32), np.ones(shape, np.float32), np.ones(shape, bool))


def test_every_method_is_measured_on_every_frame(street_drive: Callable[..., Path]) -> None:
    data, seen = open_dataset(street_drive({1: b""})), list[None]()
    report = sequence_report(data, {"ten": AlwaysTenMetres()}, slice(0, 3), 1, lambda: seen.append(None))
    assert len(seen) == 3
    assert (report.about.frames, report.about.frames_left_out) == ((0, 1, 2), (1,))
    assert (report.about.ring_step, report.about.phase) == (4, 1)
    ten = report.methods["ten"]
    assert ten.image is None
    assert ten.full is not None
    assert ten.parameters == 3
    assert ten.full.coverage == 1
    assert ten.full.returns == pytest.approx(2 * 48 * 600, rel=0.01)  # 48 of 64 rings of 600 returns, of two scans
    assert ten.full.bands["0-10"].returns + ten.full.bands["10-20"].returns > 0
    json.dumps(report.as_dict(), allow_nan=False)


def test_unmeasurable_sequences_are_errors(street_drive: Callable[..., Path]) -> None:
    data = open_dataset(street_drive())
    with pytest.raises(InputError, match="the sequence has 8"):
        sequence_report(data, {}, slice(20, None))
    scans = open_dataset(data.path / "velodyne")  # without the sensor.yaml beside them
    with pytest.raises(InputError, match="the sensor model is unknown"):
        sequence_report(scans, {})


def test_depth_maps_are_completed_by_every_method(tmp_path: Path) -> None:
    for kind, values in (
        ("velodyne_raw", np.full((2, 3), 512)),
        ("groundtruth_depth", np.full((2, 3), 768)),
        ("image", np.zeros((2, 3, 3))),
    ):
        (tmp_path / kind).mkdir()
        cv2.imwrite(str(tmp_path / kind / f"a_{kind}_1.png"), values.astype(np.uint8 if kind == "image" else np.uint16))
    seen = list[None]()

    def as_measured(sparse: Array, _image: Array) -> Array:
        return sparse

    report = depth_map_report(tmp_path, {"same": as_measured}, on_image=lambda: seen.append(None))
    figures = report.methods["same"].image
    assert figures is not None
    assert figures.mae_mm == pytest.approx(1000)  # 2 m where 3 m are true
    assert (figures.coverage, len(seen)) == (1, 1)
    with pytest.raises(InputError, match="no depth maps in that range; it has 1"):
        depth_map_report(tmp_path, {"same": as_measured}, slice(1, None))


def test_only_depth_completion_methods_complete_depth_maps() -> None:
    assert list(completions(["mrf"])) == ["mrf"]
    assert "delaunay" in completions()
    with pytest.raises(InputError, match=r"unknown depth completion 'delauny'; did you mean 'delaunay'"):
        completions(["delauny"])
