"""Files that are complete or missing, and links that lead elsewhere."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from slam.data.atomic import remove_temporaries, require_no_links, write_text, written_beside
from slam.data.errors import InputError


def test_a_file_takes_the_place_of_a_link(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("mine")
    for name in ("file.txt", f".file.{os.getpid()}.txt"):  # the file, and its temporary name
        (tmp_path / name).symlink_to(victim)
    write_text(tmp_path / "file.txt", "new")
    assert victim.read_text() == "mine"
    assert (tmp_path / "file.txt").read_text() == "new"
    assert not (tmp_path / "file.txt").is_symlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file.txt", "victim"]


def test_leftovers_of_a_killed_process_are_removed_and_nothing_else(tmp_path: Path) -> None:
    for name in (".map.12.pcd", ".map.12.ply", ".map.x.pcd", "map.12.pcd", ".other.12.pcd", "map.pcd"):
        (tmp_path / name).touch()
    remove_temporaries(tmp_path, ["map.pcd"])
    remove_temporaries(tmp_path / "nowhere", ["map.pcd"])
    assert not (tmp_path / ".map.12.pcd").exists()
    assert len(list(tmp_path.iterdir())) == 5


def test_folders_that_are_links_are_refused(tmp_path: Path) -> None:
    (tmp_path / "figures").symlink_to(tmp_path.parent)
    require_no_links(tmp_path, ["session"])
    with pytest.raises(InputError, match="figures: is a link; remove it"):
        require_no_links(tmp_path, ["session", "figures"])


def test_an_exception_leaves_no_file(tmp_path: Path) -> None:
    def write() -> None:
        with written_beside(tmp_path / "file.txt") as temporary:
            temporary.write_text("half")
            raise ValueError

    with pytest.raises(ValueError):
        write()
    assert list(tmp_path.iterdir()) == []
