"""Writing of clouds, and reading them back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slam.data.atomic import write_text, written_beside
from slam.data.cloud import PointCloud
from slam.data.errors import InputError
from slam.data.point_files import read_points
from slam.data.point_writer import write_points


@pytest.fixture
def cloud() -> PointCloud:
    rng = np.random.default_rng(0)
    return PointCloud(rng.uniform(-50, 50, (100, 3)), rng.random(100), colour=rng.integers(0, 256, (100, 3)))


@pytest.mark.parametrize("suffix", ["pcd", "ply", "PLY"])
def test_points_intensity_and_colour_are_read_back_as_written(tmp_path: Path, cloud: PointCloud, suffix: str) -> None:
    import open3d as o3d

    path = tmp_path / "new" / f"map.{suffix}"
    write_points(path, cloud)
    points = read_points(path)
    np.testing.assert_array_equal(points.xyz, cloud.xyz)
    np.testing.assert_array_equal(points.intensity, cloud.intensity)
    assert points.problems == ()
    colours = o3d.t.io.read_point_cloud(path).point["colors"].numpy()
    np.testing.assert_array_equal(colours, cloud.colour)
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_a_cloud_without_colour_is_written_without_colour(tmp_path: Path) -> None:
    import open3d as o3d

    write_points(tmp_path / "map.pcd", PointCloud(np.ones((3, 3)), np.ones(3)))
    assert "colors" not in o3d.t.io.read_point_cloud(tmp_path / "map.pcd").point


def test_the_file_is_binary(tmp_path: Path, cloud: PointCloud) -> None:
    write_points(tmp_path / "map.pcd", cloud)
    assert b"DATA binary\n" in (tmp_path / "map.pcd").read_bytes()


@pytest.mark.parametrize("name", ["map.xyz", "map", "map.pcd.gz"])
def test_other_suffixes_are_refused(tmp_path: Path, cloud: PointCloud, name: str) -> None:
    with pytest.raises(InputError, match=r"\.pcd, \.ply, \.las or \.laz"):
        write_points(tmp_path / name, cloud)
    assert list(tmp_path.iterdir()) == []


def test_a_failed_write_leaves_the_old_file_unchanged(
    tmp_path: Path, cloud: PointCloud, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    (tmp_path / "map.pcd").write_bytes(b"old")
    monkeypatch.setattr("slam.data.point_writer._columns", full)
    with pytest.raises(InputError, match=r"map\.pcd: cannot be written"):
        write_points(tmp_path / "map.pcd", cloud)
    assert [(file.name, file.read_bytes()) for file in tmp_path.iterdir()] == [("map.pcd", b"old")]


def test_an_empty_cloud_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no points to write"):
        write_points(tmp_path / "map.pcd", PointCloud(np.zeros((0, 3)), np.zeros(0)))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt(), ValueError("x")])
def test_no_half_written_file_remains(tmp_path: Path, error: BaseException) -> None:
    def write() -> None:
        with written_beside(tmp_path / "a.txt") as temporary:
            temporary.write_text("half")
            raise error

    with pytest.raises(InputError if isinstance(error, OSError) else type(error)):
        write()
    assert list(tmp_path.iterdir()) == []


def test_writing_below_a_file_is_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_text(tmp_path / "taken" / "a.txt", "text")
    assert (tmp_path / "taken").read_text() == ""
