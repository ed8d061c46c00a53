"""Odometry by scenes: the figures on literal paths, what the page says of them, and a small run."""

from __future__ import annotations

import os
from argparse import Namespace
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.common.page import surroundings
from benchmarks.common.script import RESULTS
from benchmarks.common.simulated import SCENES, frame_numbers, scene
from benchmarks.odometry import inputs, scenes
from benchmarks.odometry.chosen_drives import chosen_drives
from benchmarks.odometry.measure import Run
from benchmarks.odometry.names import GENZ, IN_SCENES, OURS, REFERENCE
from benchmarks.odometry.path_errors import along_track_error, corrected, directions, errors_ahead, worst_frame
from benchmarks.odometry.scenes_page import page, ranking, where_we_lose, wrong_without_knowing
from eval.evaluation import write_json
from slam.config import load_config
from slam.data import se3
from slam.data.cloud import Array
from slam.data.dataset import open_dataset
from slam.data.errors import InputError
from slam.data.sensor import Sensor
from slam.front_end import RingFrontEnd

Street = Callable[..., Path]


def options(*drives: str, frames: str | None = None, trajectories: Path | None = None) -> Namespace:
    return Namespace(drives=drives, frames=frames, trajectories=trajectories)


def positions(*xy: tuple[float, float]) -> Array:
    poses = np.tile(np.eye(4), (len(xy), 1, 1))
    poses[:, :2, 3] = xy
    return poses


CORNER = positions((0, 0), (4, 0), (4, 4))  # the last metre leads to the left


@pytest.mark.parametrize(
    ("end", "along"),
    [((4, 3), -1.0), ((4, 4.5), 0.5), ((7, 4), 0.0)],  # behind, ahead, beside
)
def test_how_far_ahead_an_estimate_ends(end: tuple[float, float], along: float) -> None:
    error = along_track_error(positions((0, 0), (4, 0), end), CORNER)
    assert error == pytest.approx(along, abs=1e-12)


def test_only_the_first_poses_are_put_onto_each_other() -> None:
    turned = se3.exp(np.array([0, 0, 1.0, 3.0, -2.0, 0])) @ positions((0, 0), (4, 0), (4, 3))
    assert along_track_error(turned, CORNER) == pytest.approx(-1.0)


def test_who_stands_still_goes_nowhere() -> None:
    assert along_track_error(CORNER, positions((0, 0), (0.1, 0), (0, 0.2))) is None


def test_the_frame_that_errs_most() -> None:
    truth = positions((0, 0), (1, 0), (2, 0), (3, 0))
    found = worst_frame(positions((0, 0), (1.1, 0), (1.8, 0), (2.9, 0)), truth)
    assert found is not None
    assert found[0] == 2
    assert found[1] == pytest.approx(0.3)
    assert worst_frame(truth[:1], truth[:1]) is None


def test_motions_that_go_too_far_ahead() -> None:
    truth = positions((0, 0), (1, 0), (2, 0), (3, 0))
    errors = errors_ahead(positions((0, 0), (1.1, 0), (1.9, 0), (2.9, 0.5)), truth)
    assert errors == pytest.approx([0, 0.1, -0.2, 0])


def test_where_the_sensor_moves_in_its_own_axes() -> None:
    left = se3.exp(np.array([0, 0, np.pi / 2, 0, 0, 0]))  # it looks along y and drives along x
    assert directions(positions((0, 0), (1, 0), (2, 0)) @ left) == pytest.approx(np.tile([0.0, -1.0, 0.0], (3, 1)))
    assert np.isnan(directions(positions((0, 0), (0.1, 0), (0, 0)))).all()


def test_reported_frames_are_corrected_before_the_rest_is_judged() -> None:
    truth = positions((0, 0), (1, 0), (2, 0), (3, 0), (4, 0))
    estimate = positions((0, 0), (1, 0), (1, 0), (3, 0), (5, 0))  # stands still in frame 2, jumps ahead after it
    left = corrected(estimate, truth, np.array([False, False, True, False, False]))
    assert left[:, 0, 3] == pytest.approx([0, 1, 2, 3, 5])


def of_system(ate: float | None, path: float, ratio: float = 2.0, **more: Any) -> dict[str, Any]:
    return {
        "error": None, "ate_m": ate, "dense_m": None, "along_track_m": -0.5, "path_length_m": path,
        "worst_m": 0.25, "worst_frame": 7, "failed_frames": None, "degenerate_frames": None,
        "median_ms": 10.0, "ratio_to_kiss": ratio,
    } | more  # fmt: skip


FACTS = {"frames": 40, "first": 10, "last": 49, "sensor": "hdl64", "rings": 64, "truth_path_length_m": 100.0}
FOUND: dict[str, Any] = {
    "bridge": {
        "full": {
            "reason": None,
            "front_end_ms": None,
            "systems": {
                "ndt": of_system(0.3, 94.0, 0.5, failed_frames=2, degenerate_frames=1),
                "ndt-scan-to-scan": of_system(0.1, 96.0, failed_frames=0, degenerate_frames=0),
                "kiss-icp": of_system(0.4, 99.0, 1.0),
                "vgicp": of_system(0.2, 80.0),
                "gicp": {"error": "scan 3: RuntimeError: no points"},
            },
        },
        "lift": {"reason": "no images"},
    }
}


def test_ranks_and_where_we_lose() -> None:
    systems = FOUND["bridge"]["full"]["systems"]
    assert [name for name, _ in ranking(systems)] == ["ndt-scan-to-scan", "vgicp", "ndt", "kiss-icp"]
    assert where_we_lose(FOUND) == [
        "bridge, full: ATE 0.300 m; vgicp 0.200.",
        "bridge, full: 2.00 times the time of kiss-icp.",
    ]
    assert wrong_without_knowing(FOUND, {"bridge": FACTS}) == [
        "bridge, full, ndt: 94.0 m for 100.0, -0.5 m at the end; 37 of 40 frames are `registered`."
    ]
    round_about = {
        "ndt": of_system(0.1, 100.0, failed_frames=0, degenerate_frames=0, along_track_m=5.5),
        "ndt-scan-to-scan": {"error": "no"},
    }
    (line,) = wrong_without_knowing({"bridge": {"16": {"reason": None, "systems": round_about}}}, {"bridge": FACTS})
    assert line == "bridge, 16, ndt: 100.0 m for 100.0, +5.5 m at the end; 40 of 40 frames are `registered`."


def test_where_all_is_well_nothing_is_lost() -> None:
    ours = of_system(0.1, 100.0, failed_frames=0, degenerate_frames=0)
    systems = {"ndt": ours, "ndt-scan-to-scan": of_system(None, 100.0)}
    found = {"street": {"full": {"reason": None, "systems": systems | {"kiss-icp": of_system(0.2, 101.0, 1.0)}}}}
    assert where_we_lose(found) == []
    assert wrong_without_knowing(found, {"street": FACTS}) == []


def test_the_page_says_all_of_it() -> None:
    about = surroundings(()) | {"command": "", "datasets": {"bridge": FACTS}, "uncounted": 5}
    told = page({"about": about, **FOUND})
    assert "| bridge | full | vgicp | 0.200 | 0.300 | 1.50 | 2 of 3 |" in told
    assert "| full | ndt | 0.300 | - | -0.500 | 94.0 | -6.0 | 0.250 | 7 | 1 | 2 | 10.0 | 0.50 |" in told
    assert "| full | gicp | failed | - |" in told
    assert "`gicp` failed on full: scan 3: RuntimeError: no points" in told
    assert "| lift | - (no images) | - |" in told
    assert "40 frames, 10 to 49; hdl64, 64 rings; 100.0 m by the ground truth." in told


def test_reported_errors_are_not_unreported_errors() -> None:
    told = of_system(0.3, 90.0, failed_frames=0, degenerate_frames=20)
    told["untold"] = {"path_length_m": 99.0, "along_track_m": -1.0}
    systems = {"ndt": told, "ndt-scan-to-scan": {"error": "no"}}
    assert wrong_without_knowing({"tunnel": {"full": {"reason": None, "systems": systems}}}, {"tunnel": FACTS}) == []


def test_the_error_that_was_told_is_told_apart() -> None:
    truth = positions(*((float(x), 0) for x in range(6)))
    poses = truth.copy()
    poses[3:, 0, 3] -= 1.0  # it stands still in frame 3, and reports it
    run = Run(poses=list(poses), statuses=["registered"] * 3 + ["degenerate"] + ["registered"] * 2)
    found = scenes.along(run, truth, np.arange(6))
    assert found["along_track_m"] == pytest.approx(-1.0)
    assert found["untold"] == pytest.approx({"path_length_m": 5.0, "along_track_m": 0.0})
    peer = scenes.along(Run(poses=list(poses), statuses=[None] * 6), truth, np.arange(6))
    assert peer["untold"] == pytest.approx({"path_length_m": 4.0, "along_track_m": -1.0})


def test_the_page_has_the_ate_of_an_earlier_run_on_as_many_frames(tmp_path: Path) -> None:
    earlier = {"ate_m": 0.9}
    file = tmp_path / "scenes.json"
    write_json(file, {
        "about": {"date": "2026-01-02", "datasets": {"bridge": {"frames": 40}}},
        "bridge": {"full": {"reason": None, "systems": {"ndt": earlier}}, "lift": {"reason": "no images"}},
    })  # fmt: skip
    about = surroundings(()) | {"command": "", "datasets": {"bridge": FACTS}, "uncounted": 5}
    about["before"] = scenes.before(file)
    told = page({"about": about, **FOUND})
    assert "| sequence | input | nearest | ATE m | ndt m | before m | times | rank |" in told
    assert "as it was on 2026-01-02" in told
    assert "| bridge | full | vgicp | 0.200 | 0.300 | 0.900 | 1.50 | 2 of 3 |" in told
    about["datasets"] = {"bridge": FACTS | {"frames": 30}}
    assert "| bridge | full | vgicp | 0.200 | 0.300 | - | 1.50 | 2 of 3 |" in page({"about": about, **FOUND})
    file.write_text("[]")
    with pytest.raises(InputError, match=r"scenes.json: not a file of this script"):
        scenes.before(file)


def test_the_committed_figures_of_the_time_before() -> None:
    drives = scenes.before(RESULTS / "scenes_before.json")["drives"]
    assert drives["bridge"]["ate_m"]["full"] == pytest.approx(87.071, abs=0.001)


def test_recorded_drives_are_ranked_by_the_dense_trajectory_too() -> None:
    systems = {"ndt": of_system(0.3, 100.0, dense_m=0.02, failed_frames=0, degenerate_frames=0),
               "ndt-scan-to-scan": {"error": "no"}, "kiss-icp": of_system(0.2, 100.0, dense_m=0.01)}  # fmt: skip
    about = surroundings(()) | {"command": "", "datasets": {"04": FACTS}, "uncounted": 5}
    told = page({"about": about, "04": {"full": {"reason": None, "systems": systems}}})
    assert "| sequence | input | nearest | to dense m | ndt m | times | rank |" in told
    assert "| 04 | full | kiss-icp | 0.010 | 0.020 | 2.00 | 2 of 2 |" in told


def test_drives_that_do_not_exist() -> None:
    with pytest.raises(InputError, match="jamm: no such folder, and no simulated drive; there are loop, straight"):
        chosen_drives(options("jamm"))
    with pytest.raises(InputError, match="05: its path is needed; add --trajectories FOLDER"):
        list(chosen_drives(options("05")))
    with pytest.raises(InputError, match="jam: no frames in 900:; the sequence has 350"):
        list(chosen_drives(options("jam", frames="900:")))


@pytest.mark.parametrize(
    ("rings", "missing"),
    [(16, ["16"]), (64, ["lift"]), (128, ["ray-segment", "lift"]), (None, ["16", "ray-segment", "lift"])],
)
def test_inputs_that_a_sensor_has_not(street_drive: Street, rings: int | None, missing: list[str]) -> None:
    data: Any = open_dataset(street_drive())  # without images
    data.sensor = None if rings is None else Sensor("some", np.linspace(0.1, -0.4, rings), np.zeros(rings))
    assert [name for name in inputs.DEFAULT if inputs.why_not(name, data)] == missing
    assert inputs.channels("full", data) == ("16" if rings == 16 else "64")


def test_sixteen_rings_are_those_of_input_16(street_drive: Street) -> None:
    data: Any = open_dataset(street_drive())
    usual = RingFrontEnd(load_config(input="16").front_end, data.sensor)(data[0], ())
    ((cloud, _),) = inputs.scans("16", data, [0], [])
    assert (cloud.xyz == usual.xyz).all()
    data.sensor = Sensor("128 rings", np.linspace(0.1, -0.4, 128), np.zeros(128))
    assert inputs.EvenRings(data).kept.tolist() == list(range(0, 128, 8))


def test_frames_of_a_simulated_sequence() -> None:
    assert frame_numbers("jam") == range(350)
    assert frame_numbers("jam", slice(10, 20)) == range(10, 20)
    with pytest.raises(InputError, match="no such simulated drive; there are loop, straight"):
        scene("jamm")
    assert all(not each.settings.camera for each in SCENES.values())


def test_a_small_run(street_drive: Street, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("kiss_icp")
    pytest.importorskip("small_gicp")
    monkeypatch.setattr(scenes, "in_own_process", lambda measure, *case, systems: measure(*case, systems))
    (drive,) = chosen_drives(options(str(street_drive()), frames="0:7"), images=True)
    found = {each: scenes.entry(drive, None, each) for each in ("full", "ray-segment", "lift")}
    assert found["lift"] == {"reason": "no images"}
    again = scenes.entry(drive, None, "full", ["ndt"], found["full"])  # the others keep their figures
    assert again["systems"]["gicp"] == found["full"]["systems"]["gicp"]
    assert again["systems"]["ndt"]["ate_m"] == pytest.approx(found["full"]["systems"]["ndt"]["ate_m"], abs=1e-6)
    for each in ("full", "ray-segment"):
        assert list(found[each]["systems"]) == list(IN_SCENES)
        for system in (*OURS, REFERENCE, "vgicp", "gicp"):
            figures = found[each]["systems"][system]
            assert figures["error"] is None
            assert 1 <= figures["worst_frame"] <= 6
        for system in GENZ:
            error = found[each]["systems"][system]["error"]
            assert error is None or "not installed" in error
        assert found[each]["systems"]["ndt"]["ate_m"] < 0.1
        assert abs(found[each]["systems"]["ndt"]["along_track_m"]) < 0.1
    about = surroundings(()) | {"command": "", "uncounted": 5}
    about["datasets"] = {drive.name: scenes.facts(drive)}
    told = page({"about": about, drive.name: found})
    assert f"## {drive.name}\n\n7 frames, 0 to 6; hdl64, 64 rings; 8.4 m" in told


def one_of_them_crashes(systems: Sequence[str]) -> scenes.Measured:
    if "gicp" in systems:
        os._exit(1)
    return {system: Run(seconds=[0.1]) for system in systems}, [2.0]


def test_a_system_that_takes_its_process_along_is_told_and_the_others_go_on() -> None:
    runs, milliseconds = scenes.in_own_process(one_of_them_crashes, systems=("gicp", "ndt"))
    assert milliseconds == [2.0]
    assert runs["ndt"].error is None
    assert "its process ended" in str(runs["gicp"].error)
