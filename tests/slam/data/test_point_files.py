"""Point files held against Open3D's writer and reader, which share no code with ours; tests/inputs has the odd ones."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest

from slam.data.cloud import PointCloud
from slam.data.errors import InputError
from slam.data.point_files import points_of, read_cloud, read_points
from slam.data.point_writer import write_points

RNG = np.random.default_rng(0)
COUNT = 1000
XYZ = RNG.uniform(-50, 50, (COUNT, 3)).astype(np.float32)
INTENSITY = RNG.random(COUNT).astype(np.float32)
COLOUR = RNG.integers(0, 256, (COUNT, 3), np.uint8)


@pytest.mark.parametrize("suffix", ["pcd", "ply"])
@pytest.mark.parametrize("options", [{"write_ascii": True}, {"compressed": True}, {}], ids=["text", "packed", "binary"])
def test_what_open3d_writes_is_read(tmp_path: Path, suffix: str, options: dict[str, bool]) -> None:
    cloud = o3d.t.geometry.PointCloud(XYZ.copy())
    cloud.point["intensity"] = INTENSITY[:, None].copy()
    cloud.point["ring"] = np.arange(COUNT, dtype=np.int32)[:, None] % 16
    cloud.point["colors"] = COLOUR.copy()
    path = tmp_path / f"cloud.{suffix}"
    assert o3d.t.io.write_point_cloud(path, cloud, **options)
    points = read_points(path)
    assert points.problems == ()
    np.testing.assert_allclose(points.xyz, XYZ, rtol=1e-5, atol=1e-5)  # text has ten digits
    np.testing.assert_allclose(points.intensity, INTENSITY, rtol=1e-5)
    np.testing.assert_array_equal(points.ring, np.arange(COUNT) % 16)
    np.testing.assert_array_equal(points.colour, COLOUR)


@pytest.mark.parametrize("suffix", ["pcd", "ply"])
def test_open3d_reads_what_we_write(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"cloud.{suffix}"
    fields = {"ring": np.arange(COUNT, dtype=np.int32), "measured": np.arange(COUNT) % 2 == 0}
    write_points(path, PointCloud(XYZ, INTENSITY, colour=COLOUR), fields)
    found = o3d.t.io.read_point_cloud(path).point
    np.testing.assert_array_equal(found["positions"].numpy(), XYZ)
    np.testing.assert_array_equal(found["intensity"].numpy()[:, 0], INTENSITY)
    np.testing.assert_array_equal(found["colors"].numpy(), COLOUR)
    np.testing.assert_array_equal(found["ring"].numpy()[:, 0], fields["ring"])
    np.testing.assert_array_equal(found["measured"].numpy()[:, 0], fields["measured"])
    older = o3d.io.read_point_cloud(str(path))
    np.testing.assert_array_equal(np.asarray(older.points), XYZ)
    np.testing.assert_allclose(np.asarray(older.colors) * 255, COLOUR, atol=1e-6)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_comes_back_in_millimetres(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"cloud{suffix}"
    write_points(path, PointCloud(XYZ, INTENSITY, colour=COLOUR))
    points = read_cloud(path)
    np.testing.assert_allclose(points.xyz, XYZ, atol=6e-4)
    assert points.intensity is not None
    np.testing.assert_allclose(points.intensity / 65535, INTENSITY, atol=1e-5)
    np.testing.assert_array_equal(points.colour, COLOUR)


def test_las_without_laspy_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "cloud.las"
    write_points(path, PointCloud(XYZ, INTENSITY))
    monkeypatch.setitem(sys.modules, "laspy", None)
    with pytest.raises(InputError, match=r"pip install 'lidarlift\[las\]'"):
        read_points(path)
    with pytest.raises(InputError, match=r"pip install 'lidarlift\[las\]'"):
        write_points(tmp_path / "other.las", PointCloud(XYZ, INTENSITY))


def test_las_has_no_place_for_other_fields(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="have no ring"):
        write_points(tmp_path / "cloud.las", PointCloud(XYZ, INTENSITY), {"ring": np.zeros(COUNT)})


def test_a_map_keeps_what_a_scan_loses(tmp_path: Path) -> None:
    """Points at its origin, and far away."""
    xyz = np.array([[0, 0, 0], [20_000, 0, 0], [1, 2, 3]])
    write_points(tmp_path / "map.pcd", PointCloud(xyz, np.zeros(3)))
    assert read_cloud(tmp_path / "map.pcd").xyz.tolist() == xyz.tolist()
    scan = read_points(tmp_path / "map.pcd")
    assert scan.xyz.tolist() == [[1, 2, 3]]
    assert [problem.kind for problem in scan.problems] == ["non-finite points"]


def test_every_time_of_a_file_is_kept_in_its_type_and_order() -> None:
    stamps = 1_700_000_000_000_000_000 + np.arange(3, dtype=np.uint64)
    table = np.zeros(3, [("x", "f4"), ("y", "f4"), ("z", "f4"), ("GpsTime", "f8"), ("timestamp", "u8"), ("T", "u4")])
    table["x"], table["timestamp"] = [1, 0, 2], stamps
    points = points_of(table, Path("scan 0"))
    assert {name: values.dtype.str for name, values in points.times.items()} == {
        "t": "<u4",
        "timestamp": "<u8",
        "gpstime": "<f8",
    }
    assert list(points.times) == ["t", "timestamp", "gpstime"]
    assert points.times["timestamp"].tolist() == [stamps[0], stamps[2]]


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (np.zeros((5, 2)), "N x 3 or N x 4"),
        (np.zeros((3, 500)), r"points\.T"),
        (np.zeros(5, [("x", "f4"), ("y", "f4")]), "fields x, y and z are needed; it has x, y"),
    ],
)
def test_an_array_of_something_else_is_refused(table: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=f"^scan 7: .*{message}"):
        points_of(table, Path("scan 7"))


@pytest.mark.parametrize("name", ["none.pcd", "folder.ply", "words.txt", "empty.npy"])
def test_what_is_no_point_file_is_a_problem(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder.ply").mkdir()
    (tmp_path / "words.txt").write_text("words")
    (tmp_path / "empty.npy").touch()
    points = read_points(tmp_path / name)
    assert len(points.xyz) == 0
    assert [problem.kind for problem in points.problems] == ["missing scan"]
    assert points.problems[0].message.startswith(f"{tmp_path / name}: cannot be read (")


def test_reading_points_imports_no_open3d(tmp_path: Path) -> None:
    write_points(tmp_path / "cloud.pcd", PointCloud(XYZ, INTENSITY))
    program = (
        "import sys; from pathlib import Path; from slam.data.point_files import read_points; "
        "read_points(Path(sys.argv[1])); print(*{'open3d', 'laspy', 'scipy', 'numba'} & set(sys.modules))"
    )
    command = [sys.executable, "-c", program, str(tmp_path / "cloud.pcd")]
    assert subprocess.run(command, capture_output=True, check=True).stdout == b"\n"
