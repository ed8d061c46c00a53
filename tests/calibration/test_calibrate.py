"""`lidarlift calibrate`: a file that the data set reads, a picture, and errors in one line."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lidarlift as package
from slam.calibration.observations import Parameters
from slam.data.calibration_file import calibration_text, camera_named, read_cameras
from slam.data.cloud import Array, Calibration
from slam.data.errors import InputError

CHANGE = np.array([*np.deg2rad([1.0, -1.5, 0.5]), 0.03, -0.05, 0.05, 0.0, 0.0, 0.0])


def wrong(calibration: Calibration) -> Calibration:
    return Calibration(calibration.K, Parameters(calibration.T_camera_lidar).changed(CHANGE).T)


def test_the_command(
    lidarlift: Callable[..., Any], recorded: Path, off: Callable[[Array, Array], tuple[float, float]]
) -> None:
    truth = read_cameras(recorded / "calib.yaml")[0].calibration
    Path("guess.yaml").write_text(calibration_text(wrong(truth)))
    result = lidarlift("calibrate", recorded, "--guess", "guess.yaml", "--delay", "0", "--out", "found.yaml")
    assert result.code == 0
    assert "standard deviations: pitch " in result.out
    found = read_cameras(Path("found.yaml"))[0].calibration
    before, after = (off(each.T_camera_lidar, truth.T_camera_lidar)[0] for each in (wrong(truth), found))
    assert after < 0.4 < before
    assert Path("found_overlay.png").stat().st_size > 10_000
    again = lidarlift("calibrate", recorded, "--out", "found.yaml")
    assert again.code == 1
    assert "found.yaml: already exists" in again.err


def copied(recorded: Path, folder: Path) -> Path:
    shutil.copytree(recorded, folder)
    return folder


def test_no_calibration(recorded: Path, tmp_path: Path) -> None:
    data = copied(recorded, tmp_path / "data")
    (data / "calib.yaml").unlink()
    with pytest.raises(InputError, match="give --guess"):
        package.calibrate(data)


def test_no_images(recorded: Path, tmp_path: Path) -> None:
    data = copied(recorded, tmp_path / "data")
    shutil.rmtree(data / "images")
    with pytest.raises(InputError, match="0 scans with an image"):
        package.calibrate(data)


def test_too_few_frames(recorded: Path) -> None:
    with pytest.raises(InputError, match="5 scans with an image and a known motion, at least 10"):
        package.calibrate(recorded, frames=slice(5))


def test_a_camera_that_has_no_name(recorded: Path) -> None:
    with pytest.raises(InputError, match="no camera 'left'; its one camera has no name"):
        package.calibrate(recorded, camera="left")


def test_other_cameras_are_kept(tmp_path: Path) -> None:
    file, K = tmp_path / "calib.yaml", [[100.0, 0, 50], [0, 100.0, 40], [0, 0, 1]]
    T = [[0, -1, 0, 0.1], [0, 0, -1, 0.2], [1, 0, 0, 0.3], [0, 0, 0, 1]]
    file.write_text(
        f"cameras:\n  front: {{K: {K}, T_camera_lidar: {T}, images: a}}\n  7: {{K: {K}, T_camera_lidar: {T}}}\n"
    )
    front = camera_named(file, "front").calibration
    moved = Calibration(front.K, Parameters(front.T_camera_lidar).changed(CHANGE).T, (0.1, 0.0, 0.0, 0.0), fisheye=True)
    file.write_text(calibration_text(moved, file, "front", ["a comment"]))
    found = {camera.name: camera for camera in read_cameras(file)}
    assert set(found) == {"front", "7"}
    np.testing.assert_allclose(found["front"].calibration.T_camera_lidar, moved.T_camera_lidar)
    assert found["front"].calibration.fisheye
    assert found["front"].images == tmp_path / "a"
    np.testing.assert_allclose(found["7"].calibration.T_camera_lidar, T)
    with pytest.raises(InputError, match="no camera 'frnt'; did you mean 'front'"):
        camera_named(file, "frnt")
