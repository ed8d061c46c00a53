"""Measurements of the scripts on sequences of a few frames."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.common import page as pages
from benchmarks.common.page import surroundings, target, verdict
from benchmarks.loops import places
from benchmarks.loops.back_end import online, solved
from benchmarks.loops.pose_graphs import grown
from benchmarks.mapping import moving_objects
from benchmarks.odometry.names import CHANNELS, REFERENCE, SYSTEMS
from benchmarks.odometry.tracks import Runner, apart, front_ends, rmse
from enrichment.interpolation.ray_segment import RaySegment
from slam.data.cloud import Array
from slam.data.dataset import open_dataset
from slam.settings import ScanContextSettings

Street = Callable[..., Path]


def test_targets_are_met_or_missed() -> None:
    assert target("time [ms]", 4.96, "<=", 5, 1) == ("time [ms]", "5.0", "<= 5", "met")
    assert [verdict(2.0, relation, 2.0) for relation in (">=", "<=", "≥", "≤", "<")] == ["met"] * 4 + ["missed"]
    assert verdict(None, ">=", 1.0) == "-"


def test_the_version_of_open3d_is_found_under_both_names(monkeypatch: pytest.MonkeyPatch) -> None:
    def version(name: str) -> str:
        if name != "open3d-cpu":
            raise PackageNotFoundError(name)
        return "0.20.0"

    monkeypatch.setattr(pages, "version", version)
    assert surroundings(("open3d",))["versions"]["open3d"] == "0.20.0"


def test_odometry_is_compared_with_its_peers(street_drive: Street, tmp_path: Path) -> None:
    pytest.importorskip("kiss_icp")
    pytest.importorskip("small_gicp")
    from benchmarks.odometry.comparison import compare
    from benchmarks.odometry.frame_rate_page import page
    from benchmarks.odometry.frame_rate_picture import draw

    drive, memory = street_drive(), {name: {"memory_mb": 2.0, "memory_before_first_scan_mb": 1.0} for name in SYSTEMS}
    name, entries, facts = compare(drive, slice(0, 7), 1, None, memory)
    for channels in CHANNELS:
        assert all(entries[system][channels]["error"] is None for system in SYSTEMS)
        assert entries["ndt"][channels]["ate_m"] < 0.1
    assert entries[REFERENCE]["64"]["ratio_to_kiss"] == 1
    about: dict[str, Any] = surroundings(()) | {"command": "", "datasets": {name: facts}, "repeats": 1, "uncounted": 5}
    told = page({"about": about, name: entries})
    assert f"| {name} | ATE, 64 channels [m]: KISS-ICP's + 5 % or 1 cm |" in told
    draw({name: entries}, tmp_path / "frame_rate.png")
    assert (tmp_path / "frame_rate.png").read_bytes().startswith(b"\x89PNG")


def test_odometry_runs_on_every_input(street_drive: Street) -> None:
    data = open_dataset(street_drive())
    truth = data.ground_truth
    assert truth is not None
    run = Runner(data, [data[position] for position in range(len(data))], np.asarray(truth))
    tracks = {name: run(*each) for name, each in front_ends(data, {"ray-segment": RaySegment()}).items()}
    assert list(tracks) == ["64", "16", "ray-segment"]
    assert 0 < apart(tracks["ray-segment"], tracks["64"]) < 0.1
    assert all(rmse(track.poses, np.asarray(truth)) < 0.1 for track in tracks.values())
    assert all(track.nees is not None and track.nees > 0 for track in tracks.values())


def test_a_static_street_keeps_its_map(street_drive: Street) -> None:
    figures = moving_objects.mapped(street_drive(), "64", None)
    assert figures["poses"] == "odometry"
    assert figures["removed"] < 0.01
    told = moving_objects.page({"about": surroundings(()) | {"command": "none"}, "maps": [figures]})
    assert f"| 64 | odometry | {figures['voxels']} |" in told


def test_the_back_end_rejects_false_loops() -> None:
    case = grown(700, seed=0).with_false(0.3, seed=1)
    row = solved(case, "ours", "30%, seed 1")
    assert (row.false_kept, row.true_lost) == (0, 0)
    assert row.error is not None
    assert row.error < row.before
    assert online(case)["loops"] == len(case.loops)


def test_a_street_driven_twice_is_recognised(street_scans: list[Array], street_poses: Array) -> None:
    clouds = [scan[:, :3] for scan in street_scans[::2]]
    reference = np.concatenate([street_poses[::2], street_poses[::2]])
    settings = ScanContextSettings(min_travelled_distance=5.0, submap_length=0.0)
    found = places.recognise(
        places.RecordedKeyframes([*clouds, *clouds], reference, reference, 1.0), [*clouds, *clouds], settings
    )
    assert found["revisits"] == len(clouds)
    assert found["recall_top_1"] == 1
