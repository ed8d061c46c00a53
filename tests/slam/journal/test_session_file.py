"""Sessions: rows that are appended, checked and cut; damaged and hostile files."""

from __future__ import annotations

import math
import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from slam.data.errors import InputError
from slam.journal.session_file import SessionFile
from slam.journal.tables import KEYFRAME, PLACE, PROBLEM, RowError, array_of, text_of

POSE = text_of(np.eye(4))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A session of two keyframes and three problems."""
    path = tmp_path / "session.sqlite"
    with SessionFile.create(path, {"version": {"lidarlift": "1"}}) as file:
        for number in range(2):
            file.append(KEYFRAME, number, (5 * number, 0.5 * number, POSE, bytes([number]) * 100))
        for number in range(3):
            file.append(PROBLEM, number, ("kind", f"message {number}"))
        file.append(PLACE, 0, (math.nan, b""))
        file.seal()
    return path


def test_rows_are_read_as_written(path: Path) -> None:
    with SessionFile.open(path) as file:
        assert file.about == {"version": {"lidarlift": "1"}}
        assert [message for _, message in file.rows(PROBLEM)] == ["message 0", "message 1", "message 2"]
        assert list(file.keyframes()) == [(0, 0.0, POSE), (5, 0.5, POSE)]
        assert file.cloud(1) == b"\x01" * 100
        assert file.count(PROBLEM) == 3
        assert math.isnan(next(file.rows(PLACE))[0])


def test_negative_zero_is_kept_as_zero(tmp_path: Path) -> None:
    with SessionFile.create(tmp_path / "s", {}) as file:
        file.append(PLACE, 0, (-0.0, b""))
        file.commit()
        assert [row[0] for row in file.rows(PLACE)] == [0.0]


def test_arrays_keep_their_bits() -> None:
    values = np.random.default_rng(1).normal(size=(4, 4))
    assert array_of(text_of(values), 4, 4).tobytes() == values.tobytes()
    for text in ("[1]", "[[1, 2], [3]]", "{}", "x", "[" * 100_000, str([[math.nan] * 4] * 4), '"1"'):
        with pytest.raises(RowError):
            array_of(text, 4, 4)


def test_a_session_is_cut_and_continued(path: Path) -> None:
    with SessionFile.open(path, write=True) as file:
        file.cut({"problem": 1, "keyframe": 2})
        file.append(PROBLEM, 1, ("kind", "again"))
        file.commit()
        assert [message for _, message in file.rows(PROBLEM)] == ["message 0", "again"]
        with pytest.raises(InputError, match="rows of table keyframe are missing"):
            file.cut({"keyframe": 3})


def test_a_reader_cannot_write(path: Path) -> None:
    with SessionFile.open(path) as file, pytest.raises(sqlite3.Error, match="readonly"):
        file.append(PROBLEM, 3, ("kind", "message"))


def test_rows_that_were_not_committed_are_lost_without_damage(path: Path) -> None:
    with SessionFile.open(path, write=True) as file:
        file.append(PROBLEM, 3, ("kind", "message"))
    with SessionFile.open(path) as file:
        assert file.count(PROBLEM) == 3


HOSTILE: dict[str, Callable[[sqlite3.Connection], object]] = {
    "changed value": lambda db: db.execute("UPDATE problem SET message = 'other' WHERE number = 1"),
    "missing row": lambda db: db.execute("DELETE FROM problem WHERE number = 1"),
    "wrong type": lambda db: db.execute("UPDATE problem SET message = 7 WHERE number = 1"),
    "no text": lambda db: db.execute("UPDATE problem SET message = NULL WHERE number = 1"),
    "negative number": lambda db: db.execute("UPDATE problem SET number = -4 WHERE number = 0"),
    "more tables": lambda db: db.execute("CREATE TABLE more (x)"),
    "a trigger": lambda db: db.execute("CREATE TRIGGER t AFTER INSERT ON problem BEGIN DELETE FROM frame; END"),
    "a view": lambda db: db.executescript("DROP TABLE edge; CREATE VIEW edge AS SELECT load_extension('x')"),
    "other columns": lambda db: db.executescript("DROP TABLE edge; CREATE TABLE edge (number INTEGER)"),
    "a later format": lambda db: db.execute("PRAGMA user_version = 2"),
    "another program's": lambda db: db.execute("PRAGMA application_id = 1"),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_sessions_that_lie_are_refused(path: Path, kind: str) -> None:
    database = sqlite3.connect(path)
    HOSTILE[kind](database)
    database.commit()
    database.close()
    with pytest.raises(InputError, match=r"session\.sqlite: "), SessionFile.open(path) as file:
        list(file.rows(PROBLEM))


def test_huge_values_are_refused(path: Path) -> None:
    database = sqlite3.connect(path)
    database.execute("UPDATE keyframe SET cloud = zeroblob(300000000) WHERE number = 1")
    database.commit()
    database.close()
    with SessionFile.open(path) as file, pytest.raises(InputError, match="damaged"):
        file.cloud(1)


@pytest.mark.parametrize("content", [b"", b"x" * 5000, b"SQLite format 3\0" + b"\xff" * 5000])
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "session.sqlite").write_bytes(content)
    with pytest.raises(InputError, match=r"session\.sqlite: "):
        SessionFile.open(tmp_path / "session.sqlite")


def test_links_are_not_followed(path: Path, tmp_path: Path) -> None:
    link = tmp_path / "link.sqlite"
    link.symlink_to(path)
    before = path.read_bytes()
    with pytest.raises(InputError, match="no session"):
        SessionFile.open(link)
    with pytest.raises(InputError, match="cannot be written"):
        SessionFile.create(link, {})
    assert path.read_bytes() == before


def read_all(path: Path) -> None:
    with SessionFile.open(path) as file:
        list(file.rows(PROBLEM))
        file.cloud(1)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_file_that_was_cut_off_is_an_error(path: Path, share: float) -> None:
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(InputError, match=r"session\.sqlite: "):
        read_all(path)
