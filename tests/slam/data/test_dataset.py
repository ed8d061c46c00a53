import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from slam.data.dataset import chosen_positions, open_dataset
from slam.data.errors import InputError


def test_a_sequence_is_found_from_any_level(odometry_root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = odometry_root / "sequences" / "04"
    for path in (odometry_root, odometry_root / "sequences", folder):
        dataset = open_dataset(path)
        assert dataset.name == "KITTI odometry 04"
        assert dataset.ground_truth is not None
    monkeypatch.chdir(folder)
    for path in (Path(), Path("velodyne/..")):
        dataset = open_dataset(path)
        assert dataset.name == "KITTI odometry 04"
        assert dataset.ground_truth is not None


def test_a_linked_sequence_keeps_the_poses_beside_the_link(odometry_root: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    (odometry_root / "sequences" / "04").rename(elsewhere)
    (odometry_root / "sequences" / "04").symlink_to(elsewhere)
    assert open_dataset(odometry_root).ground_truth is not None


def test_several_sequences_must_be_told_apart(odometry_root: Path) -> None:
    shutil.copytree(odometry_root / "sequences" / "04", odometry_root / "sequences" / "10")
    with pytest.raises(InputError, match=r"--sequence: 04, 10"):
        open_dataset(odometry_root)
    assert open_dataset(odometry_root, sequence="10").name == "KITTI odometry 10"
    assert open_dataset(odometry_root, sequence="4").name == "KITTI odometry 04"
    with pytest.raises(InputError, match=r"no sequence '11'; it has 04, 10"):
        open_dataset(odometry_root, sequence="11")


def test_a_drive_is_found_from_any_level(tmp_path: Path, hdl64_scan: Callable) -> None:
    date = tmp_path / "2011_09_26"
    for name in ("2011_09_26_drive_0005_sync", "2011_09_26_drive_0013_sync"):
        points = date / name / "velodyne_points"
        (points / "data").mkdir(parents=True)
        hdl64_scan(columns=10).tofile(points / "data" / "0000000000.bin")
        (points / "timestamps.txt").write_text("2011-09-26 13:04:32.335337762\n")
    for path in (tmp_path, date):
        with pytest.raises(InputError, match="several sequences"):
            open_dataset(path)
        for wanted in ("5", "0005", "2011_09_26_drive_0005", "2011_09_26_drive_0005_sync"):
            assert open_dataset(path, sequence=wanted).name == "KITTI raw 2011_09_26_drive_0005"
    assert open_dataset(date / "2011_09_26_drive_0013_sync").name == "KITTI raw 2011_09_26_drive_0013"
    shutil.rmtree(date / "2011_09_26_drive_0005_sync")
    assert open_dataset(tmp_path).name == "KITTI raw 2011_09_26_drive_0013"


def test_a_path_without_a_sequence_is_an_error_that_lists_the_known_layouts(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="looked for KITTI odometry"):
        open_dataset(tmp_path)
    with pytest.raises(InputError, match="no such folder"):
        open_dataset(tmp_path / "nothing")
    (tmp_path / "file.txt").touch()
    with pytest.raises(InputError, match="is a file"):
        open_dataset(tmp_path / "file.txt")


def test_a_sequence_folder_without_scans_is_refused(tmp_path: Path) -> None:
    (tmp_path / "sequences" / "00" / "velodyne").mkdir(parents=True)
    with pytest.raises(InputError, match="no scans in it"):
        open_dataset(tmp_path)


def test_a_folder_of_scans_has_no_sequences(tmp_path: Path) -> None:
    (tmp_path / "1.bin").write_bytes(bytes(16))
    with pytest.raises(InputError, match="leave --sequence out"):
        open_dataset(tmp_path, sequence="04")


def test_positions_past_the_end_end_a_loop(odometry_root: Path) -> None:
    dataset = open_dataset(odometry_root)
    assert [dataset[i].index for i in range(len(dataset))] == [0, 1, 2]
    with pytest.raises(IndexError):
        dataset[3]


def test_another_package_adds_a_kind_of_data_set(
    installed: Callable[[str, str, dict[str, str]], Path], tmp_path: Path
) -> None:
    """One whose sequences are files."""
    source = (
        "class Text:\n"
        "    LAYOUT = 'text files (*.text)'\n"
        "    @staticmethod\n"
        "    def sequences(path):\n"
        "        return {file.stem: file for file in sorted(path.glob('*.text'))}\n"
        "    def __init__(self, path, sensor):\n"
        "        self.name, self.path, self.sensor = path.stem, path, sensor\n"
    )
    site = installed(
        "text-sequences", "[lidarlift.datasets]\ntext = text_sequences:Text\n", {"text_sequences.py": source}
    )
    (tmp_path / "data").mkdir()
    for name in ("a", "b"):
        (tmp_path / "data" / f"{name}.text").touch()
    assert open_dataset(tmp_path / "data", "b").name == "b"
    with pytest.raises(InputError, match="several sequences; name one with --sequence: a, b"):
        open_dataset(tmp_path / "data")
    with pytest.raises(InputError, match=r"no sequence found; looked for KITTI .*, text files \(\*\.text\) and scans"):
        open_dataset(site)


def test_a_loader_of_version_0_2_is_refused(installed: Callable[[str, str, dict[str, str]], Path]) -> None:
    """Its method `sequences` was called `drives`."""
    source = "class Old:\n    LAYOUT = 'old files'\n    @staticmethod\n    def drives(path):\n        return {}\n"
    site = installed("old-loader", "[lidarlift.datasets]\nold = old_loader:Old\n", {"old_loader.py": source})
    with pytest.raises(InputError, match=r"data set 'old': its loader has no method 'sequences' .*; update"):
        open_dataset(site)


def test_a_range_without_frames_is_refused(odometry_root: Path) -> None:
    dataset = open_dataset(odometry_root)
    assert list(chosen_positions(dataset, slice(None))) == list(range(len(dataset)))
    assert list(chosen_positions(dataset, slice(None, None, -1)))[-1] == 0
    with pytest.raises(InputError, match=f"no frames in that range; the sequence has {len(dataset)}, from 0"):
        chosen_positions(dataset, slice(len(dataset), None))


def test_scans_one_folder_deeper_are_pointed_to(tmp_path: Path) -> None:
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "0.bin").write_bytes(bytes(48))
    with pytest.raises(InputError, match=r"no sequence found here, but scans in .*raw; name that folder"):
        open_dataset(tmp_path)
