"""Folders of point files: what the first scans tell of all, what the user may say, and which faults end a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slam.data.dataset import open_dataset
from slam.data.errors import InputError

RNG = np.random.default_rng(0)
COUNT = 500
XYZ = (RNG.uniform(-20, 20, (COUNT, 3)) * [1, 1, 0.1]).astype(np.float32)
RING = np.arange(COUNT) % 16
WIDE = np.column_stack([XYZ, RNG.integers(1, 256, COUNT), RING, np.linspace(0, 0.1, COUNT)])


def kinds(problems: tuple) -> list[str]:
    return [problem.kind for problem in problems]


def folder_of(path: Path, *contents: bytes, suffix: str = ".bin") -> Path:
    path.mkdir(exist_ok=True)
    for number, content in enumerate(contents):
        (path / f"{number:06d}{suffix}").write_bytes(content)
    (path / "times.txt").write_text("".join(f"{number / 10}\n" for number in range(len(contents))))
    return path


def saved(path: Path, *arrays: np.ndarray) -> Path:
    path.mkdir(exist_ok=True)
    for number, array in enumerate(arrays):
        np.save(path / f"{number:06d}.npy", array)
    (path / "times.txt").write_text("".join(f"{number / 10}\n" for number in range(len(arrays))))
    return path


@pytest.mark.parametrize(("width", "named"), [(3, "x, y, z"), (5, "intensity, ring"), (6, "intensity, ring, time")])
def test_the_columns_of_bin_files_are_told_by_the_first_scans_and_said_once(
    tmp_path: Path, width: int, named: str
) -> None:
    data = open_dataset(folder_of(tmp_path / "d", *[WIDE[:, :width].astype("<f4").tobytes()] * 5))
    assert kinds(data.problems) == ["columns told by the numbers"]
    assert f"{named};" in data.problems[0].message
    for position in range(5):
        assert data[position].problems == ()
        np.testing.assert_array_equal(data[position].cloud.xyz, XYZ)
        assert (data[position].cloud.time is not None) == (width == 6)


def test_nothing_is_said_of_kittis_columns(tmp_path: Path) -> None:
    assert open_dataset(folder_of(tmp_path / "d", *[WIDE[:, :4].astype("<f4").tobytes()] * 2)).problems == ()


def test_the_first_scans_tell_by_their_majority(tmp_path: Path) -> None:
    """The first is cut short, the second empty."""
    content = WIDE[:, :5].astype("<f4").tobytes()
    data = open_dataset(folder_of(tmp_path / "d", content[:-7], b"", content, content))
    assert [len(data[position].cloud) for position in range(4)] == [COUNT - 1, 0, COUNT, COUNT]
    assert kinds(data[0].problems) == ["truncated scan"]
    assert kinds(data[1].problems) == ["empty scan"]


def test_bin_files_of_nothing_that_is_known_are_refused_with_the_remedy(tmp_path: Path) -> None:
    content = RNG.integers(0, 256, 30_000, np.uint8).tobytes()
    folder = folder_of(tmp_path / "d", content, content)
    with pytest.raises(InputError, match=r"000000\.bin: .*--columns") as error:
        open_dataset(folder)
    assert "\n" not in str(error.value)


def test_the_user_says_what_the_numbers_are(tmp_path: Path) -> None:
    table = np.rec.fromarrays([*XYZ.T, RING.astype("u1"), np.arange(COUNT, dtype="u4")])
    data = open_dataset(folder_of(tmp_path / "d", table.tobytes()), columns="X, Y, Z, ring:u1, t:u4")
    assert data.problems == ()
    cloud = data[0].cloud
    assert cloud.ring is not None
    assert cloud.time is not None
    np.testing.assert_array_equal(cloud.xyz, XYZ)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ("x,y,intensity", "x, y and z"),
        ("x,y,z,x", "each name once"),
        ("x,y,z,t:f5", "'t:f5' is no column"),
        ("x,y,,z", "'' is no column"),
    ],
)
def test_columns_that_make_no_sense_are_refused(tmp_path: Path, columns: str, message: str) -> None:
    folder = folder_of(tmp_path / "d", WIDE.astype("<f4").tobytes())
    with pytest.raises(InputError, match="--columns") as error:
        open_dataset(folder, columns=columns)
    assert message in str(error.value)


def test_files_that_name_their_columns_need_none(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "d", b"ply", suffix=".ply")
    with pytest.raises(InputError, match="name their columns"):
        open_dataset(folder, columns="x,y,z")


def test_a_data_set_of_its_own_layout_takes_no_columns(tmp_path: Path) -> None:
    folder_of(tmp_path / ["sequences", "00", "velodyne"][0])
    (tmp_path / "sequences/00/velodyne").mkdir(parents=True)
    WIDE[:, :4].astype("<f4").tofile(tmp_path / "sequences/00/velodyne/000000.bin")
    with pytest.raises(InputError, match="name the folder of its scans"):
        open_dataset(tmp_path, columns="x,y,z,i")


def test_kittis_layout_with_another_number_of_columns(tmp_path: Path) -> None:
    (tmp_path / "sequences/00/velodyne").mkdir(parents=True)
    WIDE[:, :5].astype("<f4").tofile(tmp_path / "sequences/00/velodyne/000000.bin")
    data = open_dataset(tmp_path, "00")
    assert "columns told by the numbers" in kinds(data.problems)
    np.testing.assert_array_equal(data[0].cloud.xyz, XYZ)


@pytest.mark.parametrize(
    "odd",
    [
        np.array([]),
        np.zeros((0, 4)),
        np.zeros(7),
        np.zeros((3, 7)),
        np.zeros((2, 2, 2, 2)),
        np.zeros((), np.float32),
        np.array([["a", "b", "c"]]),
        np.zeros(3, "V0,f4"),
        np.full((5, 3), np.nan),
        np.full((5, 4), np.inf),
        np.zeros((5, 3), complex),
        np.zeros(4, [("a", "f4"), ("b", "f4")]),
        np.zeros(4, [("x", "f4"), ("y", "f4"), ("z", "U3")]),
        np.zeros(4, [("x", "f4", 3), ("y", "f4"), ("z", "f4")]),
        np.ones((5, 3), bool),
    ],
    ids=lambda array: f"{array.dtype} {array.shape}".replace("[", "").replace("]", ""),
)
def test_one_odd_scan_never_ends_a_run(tmp_path: Path, odd: np.ndarray) -> None:
    data = open_dataset(saved(tmp_path / "d", XYZ, odd, WIDE[:, :4]))
    assert [len(data[position].cloud) for position in range(3)] == [COUNT, 0, COUNT]
    assert data[1].problems
    assert all("000001.npy" in problem.message and "\n" not in problem.message for problem in data[1].problems)


def test_coordinates_of_a_map_are_moved_by_the_same_offset_in_all_scans(tmp_path: Path) -> None:
    scans = [XYZ + np.array([457_000 + 3.0 * number, 5_428_000, 115]) for number in range(3)]
    data = open_dataset(saved(tmp_path / "d", *scans))
    assert kinds(data.problems) == ["map coordinates"]
    first, second = data[0].cloud, data[1].cloud
    assert data[1].problems == ()
    np.testing.assert_allclose(second.xyz - first.xyz, np.tile([3.0, 0, 0], (COUNT, 1)), atol=1e-4)
    assert np.abs(first.xyz).max() < 50
