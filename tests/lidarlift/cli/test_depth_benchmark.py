"""`lidarlift depth-benchmark`: figures of every method, and one line for what is wrong."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from enrichment.methods.registry import COMPLETIONS, runnable

Drive = Callable[..., Path]
Command = Callable[..., Any]
FAST = ("--method", "ray-segment")


def with_images(sequence: Path, number: int = 8) -> Path:
    """The sequence with grey images for its first scans."""
    (sequence / "image_2").mkdir()
    for frame in range(number):
        cv2.imwrite(str(sequence / "image_2" / f"{frame:06d}.png"), np.full((360, 1200, 3), 90, np.uint8))
    return sequence


def report(folder: str = "d") -> dict[str, Any]:
    return dict(json.loads((Path(folder) / "depth.json").read_text()))


def test_every_method_has_figures_in_both_views(lidarlift: Command, street_drive: Drive) -> None:
    result = lidarlift("depth-benchmark", with_images(street_drive()), "--frames", "2:3", "--out", "d")
    assert result.code == 0, result.err
    found = report()
    assert list(found) == [*runnable(), "about"]
    for name in runnable():
        entry = found[name]
        assert entry["ms"] > 0
        assert 0 < entry["image"]["returns"] < entry["full"]["returns"]
        assert entry["image"]["coverage"] > 0.5
        assert 0 < entry["image"]["mae_mm"] < 5000
        assert entry["image"].keys() >= {"rmse_mm", "imae", "irmse", "median_mm", "worse_0.3m", "worse_1m"}
        assert result.out.count(f"\n{name} ") == 4
    assert found["ray-segment"]["full"]["coverage"] > 0.9
    assert found["ray-segment"]["full"]["median_mm"] < 100  # a street of planes
    assert found["about"]["frames"] == [2]
    assert "AUSE" in found["about"]["protocol"]
    assert (Path("d") / "risk_coverage.png").read_bytes().startswith(b"\x89PNG")


def test_without_a_camera_only_all_returns_are_measured(lidarlift: Command, street_drive: Drive) -> None:
    result = lidarlift("depth-benchmark", street_drive(), "--frames", ":2", "--phase", "2", "--out", "d", *FAST)
    assert result.code == 0, result.err
    assert report()["ray-segment"].keys() == {"full", "ms"}
    assert report()["about"]["phase"] == 2
    assert "All returns (360 deg)" in result.out
    assert "Camera field of view" not in result.out


def test_a_damaged_scan_is_left_out(lidarlift: Command, street_drive: Drive) -> None:
    result = lidarlift("depth-benchmark", street_drive({1: b""}), "--frames", ":2", "--out", "d", *FAST)
    assert result.code == 0, result.err
    assert report()["about"]["frames_left_out"] == [1]


def test_errors_are_one_line(lidarlift: Command, street_drive: Drive) -> None:
    drive = street_drive({0: b""})
    lidarlift("depth-benchmark", "nowhere").refused("nowhere")
    lidarlift("depth-benchmark", drive, "--method", "delauny").refused("delauny", "did you mean 'delaunay'")
    lidarlift("depth-benchmark", drive, "--frames", "20:").refused("the sequence has 8")
    lidarlift("depth-benchmark", drive, "--frames", "8").refused("FROM:TO")
    lidarlift("depth-benchmark", drive, "--sensor", "vlp16", "--phase", "2").refused("--phase 2", "use 0 or 1")
    result = lidarlift("depth-benchmark", drive, "--frames", ":1")
    assert result.code == 1
    assert "no scan has ring indices" in result.err
    assert not Path("runs").exists()


@pytest.fixture
def depth_maps(tmp_path: Path) -> Path:
    """Two of KITTI's depth completion images: a wall at 10 m, known in every fourth row."""
    truth = np.full((40, 60), 2560, np.uint16)
    sparse = np.where(np.arange(40)[:, None] % 4 == 0, truth, 0).astype(np.uint16)
    for kind, values in (("velodyne_raw", sparse), ("groundtruth_depth", truth), ("image", np.zeros((40, 60, 3)))):
        (tmp_path / "maps" / kind).mkdir(parents=True)
        for number in (5, 8):
            cv2.imwrite(str(tmp_path / "maps" / kind / f"drive_sync_{kind}_{number:010d}_image_02.png"), values)
    return tmp_path / "maps"


def test_depth_maps_are_measured_by_the_rules_of_kitti(lidarlift: Command, depth_maps: Path) -> None:
    result = lidarlift("depth-benchmark", depth_maps, "--out", "d")
    assert result.code == 0, result.err
    found = report()
    assert list(found) == [*COMPLETIONS.names(), "about"]
    for name in COMPLETIONS.names():
        assert found[name]["image"]["images"] == 2
        assert found[name]["image"]["coverage"] > 0.8
        assert found[name]["image"]["mae_mm"] < 10
    assert len(found["about"]["images"]) == 2
    assert "RMSE" in result.out
    assert "written to d: depth.json" in result.out.lower()


def test_depth_maps_need_a_depth_completion_method(lidarlift: Command, depth_maps: Path) -> None:
    lidarlift("depth-benchmark", depth_maps, *FAST).refused("ray-segment", "delaunay")
