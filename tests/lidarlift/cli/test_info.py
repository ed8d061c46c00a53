"""`lidarlift info`, and `lidarlift.info`: the content of a data set."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import lidarlift as package
from slam.data.cloud import PointCloud
from slam.data.errors import InputError
from slam.data.point_writer import write_points
from slam.data.sensor import load_sensor

Command = Callable[..., Any]
Drive = Callable[..., Path]


@pytest.fixture
def cheap(tmp_path: Path) -> Path:
    """Twenty scans of a VLP-16 in a round room, with ring and time, at 10 Hz from 5 s on; the folder's name has a
    blank."""
    folder = tmp_path / "my drive"
    (folder / "scans").mkdir(parents=True)
    lines = load_sensor("vlp16")
    azimuth = np.linspace(np.pi, -np.pi, 900, endpoint=False)
    ring, angle = np.repeat(np.arange(16), 900), np.tile(azimuth, 16)
    rho = 8.0 + 3 * np.cos(3 * angle)
    z = np.tan(lines.elevation[ring]) * rho + lines.offset[ring]
    xyz = np.column_stack([rho * np.cos(angle), rho * np.sin(angle), z]).astype(np.float32)
    cloud = PointCloud(xyz, np.linspace(0, 100, len(xyz)) / 255)
    for number in range(20):
        time = (0.5 - angle / (2 * np.pi)) * 0.1
        fields = {"ring": ring.astype(np.uint16), "time": time.astype(np.float32)}
        write_points(folder / "scans" / f"{number:06d}.pcd", cloud, fields)
    (folder / "times.txt").write_text("".join(f"{5 + 0.1 * number}\n" for number in range(20)))
    return folder


def test_a_folder_of_scans(cheap: Path) -> None:
    found = package.info(cheap)
    assert (found.scans, found.first, found.last, found.looked_at) == (20, 0, 19, 12)
    assert found.rate_hz == pytest.approx(10)
    assert found.duration_s == pytest.approx(1.9)
    assert found.points == 14_400
    assert found.range_m[0] == pytest.approx(5, abs=0.5)
    assert (found.rings, found.rings_from) == (16, "from the field ring")
    assert (found.sensor, found.looks_like) == (None, "vlp16")
    assert [field.partition(" (")[0] for field in found.fields] == ["x y z", "intensity", "ring", "time"]
    assert "field time, s, relative, 0 to 99.9 ms of a 100 ms sweep, in 12 of 12 scans" in found.point_times
    assert (found.images, found.calibrated, found.truth, found.problems) == (0, False, 0, ())
    assert found.commands == (
        f"lidarlift run '{cheap}' --sensor vlp16",
        f"lidarlift run '{cheap}' --sensor vlp16 --input enriched",
    )


def test_a_named_sensor_is_used(cheap: Path) -> None:
    found = package.info(cheap, sensor="vlp16")
    assert (found.sensor, found.looks_like) == ("vlp16", None)


def test_damage_and_gaps_are_reported(lidarlift: Command, cheap: Path) -> None:
    (cheap / "scans" / "000007.pcd").unlink()
    (cheap / "scans" / "000010.pcd").write_bytes(b"junk")
    (cheap / "images").mkdir()
    for number in range(20):
        cv2.imwrite(str(cheap / "images" / f"{number:06d}.png"), np.zeros((30, 40, 3), np.uint8))
    (cheap / "images" / "000003.png").write_bytes(b"no image")
    result = lidarlift("info", cheap, "--all")
    assert result.code == 0, result.err
    out = " ".join(result.out.split())
    assert "19, numbers 0 to 19, 10 Hz, 1.9 s in total" in out
    assert "a gap of 0.2 s" in out
    assert "images of 40 x 30 pixels for 19 of 19 scans, not calibrated" in out
    for line in (
        "- gap in numbering: scans: numbers missing: 7 (1 in all)",
        "- missing scan: scans/000010.pcd: cannot be read",
        "- damaged image: images/000003.png: neither PNG nor JPEG",
        "- no calibration: images, but no calib.yaml",
    ):
        assert line in out


def test_unknown_properties_are_reported(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    for number in range(3):
        np.save(tmp_path / f"{number}.npy", rng.uniform(-20, 20, (500, 3)))
    found = package.info(tmp_path)
    assert (found.rings, found.sensor, found.looks_like) == (None, None, None)
    assert "name the LiDAR with --sensor" in found.rings_from
    assert found.point_times.startswith("none (no time field)")
    assert [kind for kind, _, _ in found.problems] == ["no time stamps"]
    assert found.fields == ("x y z",)
    assert found.commands == (f"lidarlift run {tmp_path}",)


def test_columns_are_used_and_in_the_command(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    np.column_stack([rng.uniform(-20, 20, (500, 3)), rng.uniform(0, 1, (500, 2))]).astype("f4").tofile(
        tmp_path / "1.bin"
    )
    found = package.info(tmp_path, columns="x,y,z,intensity,_")
    assert found.points == 500
    assert found.rate_hz is None
    assert found.commands == (f"lidarlift run {tmp_path} --columns x,y,z,intensity,_",)


def test_sequences_of_kitti(lidarlift: Command, street_drive: Drive, tmp_path: Path) -> None:
    path = street_drive()
    page = " ".join(lidarlift("info", path).out.split())
    for words in (
        "kitti 77",
        "8, numbers 0 to 7, 10 Hz",
        "rings 64, from the lasers of hdl64",
        "none (the scans are motion-compensated already)",
        "camera calibrated, but no images",
        "ground truth of 8 of 8 scans, 9.8 m",
        f"lidarlift compare {path}",
    ):
        assert words in page
    shutil.copytree(path, path.parent / "78")
    (path.parent / "78" / "times.txt").unlink()
    listed = lidarlift("info", tmp_path / "kitti").out
    assert "2 sequences" in listed
    assert [line.split()[:3] for line in listed.splitlines() if " scans " in line] == [
        ["77", "8", "scans"],
        ["78", "8", "scans"],
    ]
    assert "--sequence 77" in listed
    assert "--sequence 78" in lidarlift("info", tmp_path / "kitti", "--sequence", "78").out
    lidarlift("info", tmp_path / "kitti", "--json").refused("several sequences")
    with pytest.raises(InputError, match="several sequences"):
        package.info(tmp_path / "kitti")


def test_json_output(lidarlift: Command, street_drive: Drive) -> None:
    found = json.loads(lidarlift("info", street_drive(), "--json").out)
    assert (found["scans"], found["truth"], found["sensor"]) == (8, 8, "hdl64")


def test_no_data_set_is_an_error(lidarlift: Command, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    lidarlift("info", tmp_path / "empty").refused("no sequence found")
    lidarlift("info", tmp_path / "nowhere").refused("no such folder")
