"""Shared fixtures: recorded data, unpacked once; a short sequence along a street of planes; the command lidarlift."""

from __future__ import annotations

import os

# Read by numpy and torch as they are imported: the workers of a run share the cores, and threads that wait spin.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import fcntl
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import settings

from lidarlift.cli import main
from slam.data import se3
from slam.data.cloud import Array
from slam.data.machine import cache_folder
from slam.data.sensor import load_sensor

# No test fails by the clock: on a busy machine, or where a kernel is compiled on its first call, examples take longer.
settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")

DEFAULT_ARCHIVES = Path(__file__).resolve().parents[1] / ".." / "shared" / "data"
FRAMES, SPEED, HEADING, COLUMNS = 8, 1.4, 0.01, 600  # m and rad a frame
TR = np.array([[0, -1, 0, 0.1], [0, 0, -1, 0.2], [1, 0, 0, 0.3], [0, 0, 0, 1.0]])


@pytest.fixture(scope="session")
def archives() -> Path:
    """The folder with the archives and their unpack.py: $LIDARLIFT_TEST_DATA, else ../shared/data."""
    folder = Path(os.environ.get("LIDARLIFT_TEST_DATA", DEFAULT_ARCHIVES))
    if not (folder / "unpack.py").is_file():
        pytest.skip(f"no real data in {folder}; set LIDARLIFT_TEST_DATA to the folder with unpack.py and the archives")
    return folder


@pytest.fixture(scope="session")
def real_data(archives: Path) -> Callable[[str], Path]:
    """`real_data("kitti_raw_0013")` is the folder of that archive, unpacked on first use."""
    cache = cache_folder("data")

    def unpacked(name: str) -> Path:
        if not (archives / f"{name}.tar").is_file():
            pytest.skip(f"no {name}.tar in {archives}")
        cache.mkdir(parents=True, exist_ok=True)
        with (cache / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # one pytest worker unpacks, the others wait; freed when one dies
            if not (cache / name).exists():
                with tempfile.TemporaryDirectory(dir=cache) as temporary:
                    command = [sys.executable, str(archives / "unpack.py"), temporary, name]
                    subprocess.run(command, check=True, capture_output=True)
                    (Path(temporary) / name).rename(cache / name)
        return cache / name

    return unpacked


def _street() -> list[tuple[int, float, Array, Array]]:
    """Rectangles: the axis that they stand across, where, and their lowest and highest corner."""
    rng, far = np.random.default_rng(7), np.array([60.0, 30.0, 12.0])
    faces = [(2, -1.7, -far, far), (0, -30.0, -far, far), (0, 50.0, -far, far)]
    for side in (-1, 1):
        faces.append((1, side * 14.0, -far, far))  # behind all: no beam sees the sky
        x = -30.0
        while x < 50:
            end, y = x + rng.uniform(4, 9), side * rng.uniform(7, 12)
            low, high = np.array([x, min(y, 14 * side), -2.0]), np.array([end, max(y, 14 * side), 12.0])
            faces += [(1, y, low, high), (0, x, low, high), (0, end, low, high)]
            x = end + rng.uniform(1, 3)
    return faces


def _scan(pose: Array, seed: int) -> Array:
    """(N, 4) float32, ring after ring, top first, counter-clockwise from ahead, with 1 cm noise along the beams."""
    sensor, rng = load_sensor("hdl64"), np.random.default_rng(seed)
    azimuth = (np.arange(COLUMNS) + 0.5) / COLUMNS * 2 * np.pi
    elevation, azimuth = np.repeat(sensor.elevation, COLUMNS), np.tile(azimuth, len(sensor.elevation))
    beam = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)])
    start = np.zeros_like(beam)
    start[:, 2] = np.repeat(sensor.offset, COLUMNS)
    origin, direction = start @ pose[:3, :3].T + pose[:3, 3], beam @ pose[:3, :3].T
    reach = np.full(len(beam), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis, at, low, high in _street():
            t = (at - origin[:, axis]) / direction[:, axis]
            hit = origin + t[:, None] * direction
            others = [other for other in range(3) if other != axis]
            inside = ((low <= hit) & (hit <= high))[:, others].all(axis=1) & (t > 0)
            reach = np.where(inside, np.minimum(reach, t), reach)
    assert np.isfinite(reach).all()
    xyz = start + (reach + rng.normal(0, 0.01, len(reach)))[:, None] * beam
    return np.column_stack([xyz, rng.random(len(xyz))]).astype(np.float32)


@pytest.fixture(scope="session")
def street_poses() -> Array:
    """True T_world_lidar (N, 4, 4) of the street drive."""
    step, poses = se3.exp(np.array([0, 0, HEADING, SPEED, 0, 0])), [np.eye(4)]
    for _ in range(FRAMES - 1):
        poses.append(poses[-1] @ step)
    return np.array(poses)


@pytest.fixture(scope="session")
def street_scans(street_poses: Array) -> list[Array]:
    """Its scans, (N, 4) float32 as in a .bin."""
    return [_scan(pose, seed) for seed, pose in enumerate(street_poses)]


@pytest.fixture
def street_drive(tmp_path: Path, street_poses: Array, street_scans: list[Array]) -> Callable[..., Path]:
    """`street_drive({3: scan})` writes the drive with scan 3 replaced (an array or bytes) and returns its sequence."""

    def write(instead: dict[int, Array | bytes] | None = None) -> Path:
        folder = tmp_path / "kitti" / "sequences" / "77"
        (folder / "velodyne").mkdir(parents=True)
        for number, scan in enumerate(street_scans):
            content = (instead or {}).get(number, scan)
            data = content if isinstance(content, bytes) else content.astype(np.float32).tobytes()
            (folder / "velodyne" / f"{number:06d}.bin").write_bytes(data)
        (folder / "sensor.yaml").write_text("model: hdl64\nmotion_compensated: true\n")
        row = " ".join(str(value) for value in TR[:3].ravel())
        (folder / "calib.txt").write_text(f"P2: 700 0 600 0 0 700 180 0 0 0 1 0\nTr: {row}\n")
        (folder / "times.txt").write_text("".join(f"{0.1 * number:e}\n" for number in range(FRAMES)))
        poses = (TR @ street_poses @ se3.inverse(TR))[:, :3].reshape(-1, 12)
        (tmp_path / "kitti" / "poses").mkdir()
        np.savetxt(tmp_path / "kitti" / "poses" / "77.txt", poses)
        return folder

    return write


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str, dict[str, str]], Path]:
    """`installed("its-name", entry_points_txt, {"module.py": source})`: a package as pip would have installed it;
    returns the folder."""

    def install(name: str, entry_points: str, files: dict[str, str]) -> Path:
        site = tmp_path / f"site-{name}"
        about = site / f"{name.replace('-', '_')}-1.0.dist-info"
        about.mkdir(parents=True)
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (about / "entry_points.txt").write_text(entry_points)
        for file, source in files.items():
            (site / file).parent.mkdir(parents=True, exist_ok=True)
            (site / file).write_text(source)
            monkeypatch.delitem(sys.modules, file.partition("/")[0].removesuffix(".py"), raising=False)
        monkeypatch.syspath_prepend(str(site))
        return site

    return install


class Result(NamedTuple):
    code: int
    out: str
    err: str

    def refused(self, *words: str) -> None:
        """Exit code 1 and one line on stderr with the words."""
        assert self.code == 1
        assert self.err.startswith("Error: ")
        assert self.err.count("\n") == 1
        for word in words:
            assert word in self.err

    @property
    def ate(self) -> float:
        """The aligned ATE's rmse in the printed table."""
        found = re.search(r"ATE, SE\(3\) Umeyama-aligned +\S+ +\d+ +m +(\S+)", self.out)
        assert found, self.out
        return float(found[1])


@pytest.fixture
def lidarlift(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path, request: pytest.FixtureRequest
) -> Callable[..., Result]:
    """`lidarlift("run", path)`: the command in this process, for each start takes seconds. Exceptions are bugs.

    Runs write no report, which takes seconds, unless the test has the mark `report`.
    """
    monkeypatch.chdir(tmp_path)
    if request.node.get_closest_marker("report") is None:
        monkeypatch.setattr("eval.report.writing.write_report", lambda folder, _: folder / "report.html")

    def command(*arguments: object) -> Result:
        monkeypatch.setattr(sys, "argv", ["lidarlift", *map(str, arguments)])
        capfd.readouterr()
        code = 0
        try:
            main()
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 1
        out, err = capfd.readouterr()
        assert "Traceback" not in out + err
        return Result(code, out, err)

    return command
