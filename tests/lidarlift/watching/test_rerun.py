"""Recordings for the viewer rerun, read again; and what is said without it or without a display."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lidarlift.watching.rerun_log import by_height, image_of, thinned
from slam.data.cloud import Array, Frame, PointCloud
from slam.data.images import ImageFile

Drive = Callable[..., Path]
Command = Callable[..., Any]


def entities(file: Path) -> dict[str, int]:
    """Number of rows of each entity in a recording, by rerun's own command, which also verifies it."""
    rerun = shutil.which("rerun", path=str(Path(sys.executable).parent))
    assert rerun
    subprocess.run([rerun, "rrd", "verify", str(file)], check=True, capture_output=True)
    text = subprocess.run([rerun, "rrd", "print", str(file)], check=True, capture_output=True, text=True).stdout
    found: Counter[str] = Counter()
    for count, name in re.findall(r"with (\d+) rows .*? - (/\S+) - ", text):
        found[name] += int(count)
    return found


def test_a_run_is_recorded(lidarlift: Command, street_drive: Drive) -> None:
    pytest.importorskip("rerun")
    result = lidarlift(
        "run",
        street_drive(),
        "--input",
        "enriched",
        "--enricher",
        "ray-segment",
        "--record",
        "deep/r.rrd",
        "--out",
        "r",
    )
    assert result.code == 0, result.err
    found = entities(Path("deep/r.rrd"))
    assert found["/world/lidar/measured"] == found["/world/lidar/enriched"] == 8
    assert {"/world/map", "/world/local_map", "/world/corrected", "/world/loops", "/world/ground_truth"} <= set(found)


def test_a_finished_run_is_recorded(lidarlift: Command, street_drive: Drive) -> None:
    pytest.importorskip("rerun")
    drive = street_drive()
    assert lidarlift("run", drive, "--input", "16", "--frames", "1:7", "--out", "r").code == 0
    result = lidarlift("view", "r", "--record", "r.rrd", "--frames", "::2")
    assert result.code == 0, result.err
    assert "rerun r.rrd" in result.out
    found = entities(Path("r.rrd"))
    assert found["/world/lidar/measured"] == 3
    assert {"/world/map", "/world/corrected", "/world/ground_truth"} <= set(found)
    lidarlift("view", "r", "--record", "x.rrd", "--frames", "50:60").refused("--frames", "none of the 6 frames")


@pytest.mark.parametrize("gone", ["the data set", "a scan's stamp", "a setting's name", "an option"])
def test_a_run_whose_scans_cannot_be_read_as_before_is_shown_without(
    lidarlift: Command, street_drive: Drive, gone: str
) -> None:
    pytest.importorskip("rerun")
    drive = street_drive()
    assert lidarlift("run", drive, "--input", "16", "--frames", "0:3", "--out", "r").code == 0
    if gone == "the data set":
        shutil.rmtree(drive)
    elif gone == "a scan's stamp":
        (drive / "times.txt").write_text("".join(f"{0.2 * number}\n" for number in range(8)))
    elif gone == "a setting's name":
        report = json.loads(Path("r/run.json").read_text())
        report["protocol"]["config"]["front_end"]["old_name"] = 1
        Path("r/run.json").write_text(json.dumps(report))
    wrong = ("--columns", "x,y") if gone == "an option" else ()
    result = lidarlift("view", "r", "--record", "r.rrd", *wrong)
    assert result.code == 0, result.err
    assert "shown without scans" in result.err
    found = entities(Path("r.rrd"))
    assert "/world/lidar/measured" not in found
    assert {"/world/map", "/world/corrected"} <= set(found)


def test_without_a_display_the_remedy_is_said(
    lidarlift: Command, street_drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    drive = street_drive()
    lidarlift("run", drive, "--live", "--out", "r").refused("no display", "--record FILE.rrd", "--serve 8080")
    assert not Path("r").exists()
    assert lidarlift("run", drive, "--input", "16", "--frames", "0:2", "--out", "r").code == 0
    lidarlift("view", "r").refused("no display", "--record FILE.rrd")


def test_a_viewer_that_does_not_start_is_an_error(
    lidarlift: Command, street_drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    rerun = pytest.importorskip("rerun")

    def refuse(**_: object) -> None:
        raise RuntimeError("Failed to find Rerun Viewer\n\nInstall it.")

    monkeypatch.setattr(rerun, "spawn", refuse)
    monkeypatch.setenv("DISPLAY", ":0")
    result = lidarlift("run", street_drive(), "--live", "--out", "r")
    result.refused("cannot be started (Failed to find Rerun Viewer)", "--record FILE.rrd")


def test_without_the_package_the_remedy_is_said(
    lidarlift: Command, street_drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    lidarlift("run", street_drive(), "--record", "r.rrd", "--out", "r").refused("rerun-sdk", "pip install")
    assert not Path("r.rrd").exists()


def test_a_file_that_cannot_be_written_is_an_error(lidarlift: Command, street_drive: Drive) -> None:
    pytest.importorskip("rerun")
    Path("taken").write_text("")
    lidarlift("run", street_drive(), "--record", "taken/r.rrd", "--out", "r").refused(
        "taken/r.rrd", "cannot be written"
    )


def test_a_recording_does_not_enter_the_data_set(lidarlift: Command, street_drive: Drive) -> None:
    drive = street_drive()
    lidarlift("run", drive, "--record", drive / "r.rrd", "--out", "r").refused("77", "belongs to the data set")
    assert not (drive / "r.rrd").exists()


def test_a_folder_without_a_run_is_an_error(lidarlift: Command) -> None:
    lidarlift("view", "nothing").refused("nothing", "give a folder written by `lidarlift run`")


def test_clouds_are_thinned_evenly() -> None:
    cloud = PointCloud(np.arange(30.0).reshape(10, 3), np.zeros(10))
    assert thinned(cloud, 10) is cloud
    assert thinned(cloud, 4).xyz[:, 0].tolist() == [0, 9, 18, 27]
    colours = by_height(np.array([0.0, 1.0, 2.0]))
    assert colours.shape == (3, 3)
    assert len({tuple(colour) for colour in colours.tolist()}) == 3
    assert by_height(np.zeros(0)).shape == (0, 3)


def test_reading_a_damaged_image_adds_no_problem(tmp_path: Path) -> None:
    (tmp_path / "0.png").write_text("no picture")
    reader = ImageFile(tmp_path / "0.png")
    frame = Frame(0, 0.0, PointCloud(np.zeros((0, 3)), np.zeros(0)), read_image=reader)
    assert image_of(frame) is None
    assert reader.problem is None
    picture: Array = np.zeros((2, 2, 3), np.uint8)
    assert image_of(Frame(0, 0.0, frame.cloud, read_image=lambda: picture)) is picture
