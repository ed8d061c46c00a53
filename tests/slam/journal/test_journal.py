"""The thread that writes a session, its snapshots, and the lock of the run folder."""

from __future__ import annotations

import multiprocessing
import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from slam.data.errors import InputError
from slam.journal.journal import Journal, has_snapshot
from slam.journal.lock import locked
from slam.journal.session_file import SessionFile
from slam.journal.state import freeze
from slam.journal.tables import KEYFRAME, PROBLEM, text_of

POSE = text_of(np.eye(4))


def test_a_journal_continues_from_its_snapshot(tmp_path: Path) -> None:
    folder = tmp_path / "unfinished"
    with Journal.begin(folder, {"version": 1}) as journal:
        journal.append(PROBLEM, "kind", "kept")
        journal.snapshot(journal.counts(), {"own": freeze({"centres": np.eye(3)})})
        journal.append(PROBLEM, "kind", "later")
    assert has_snapshot(folder)
    with Journal.resume(folder) as journal:
        assert journal.state is not None
        assert journal.state["own"]["centres"].tolist() == np.eye(3).tolist()
        assert journal.counts()["problem"] == 1
        journal.append(PROBLEM, "kind", "again")
    with SessionFile.open(folder / "session.sqlite") as file:
        assert [message for _, message in file.rows(PROBLEM)] == ["kept", "again"]
    assert sorted(path.name for path in folder.iterdir()) == ["session.sqlite", "state.npz"]


def test_clouds_are_read_while_the_journal_is_written(tmp_path: Path) -> None:
    with Journal.begin(tmp_path / "unfinished", {}) as journal:
        for number in range(3):
            journal.append(KEYFRAME, number, 0.0, POSE, bytes([number]))
        assert [journal.cloud(number) for number in range(3)] == [b"\0", b"\1", b"\2"]
        journal.move(tmp_path / "session")
        assert journal.cloud(2) == b"\2"
    assert not (tmp_path / "unfinished").exists()


@contextmanager
def full_disk(size: int) -> Iterator[None]:
    """No file grows beyond `size` bytes; Python ignores the signal of such a write, which then fails."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_is_an_error_of_the_next_call_and_loses_nothing_before(tmp_path: Path) -> None:
    folder = tmp_path / "unfinished"
    with Journal.begin(folder, {}) as journal:
        journal.append(PROBLEM, "kind", "kept")
        journal.snapshot(journal.counts(), {"own": freeze(1)})
        journal.flush()
        with full_disk(300_000):
            for _ in range(20):
                journal.append(KEYFRAME, 0, 0.0, POSE, bytes(100_000))
            with pytest.raises(InputError, match="free space, then continue with --resume"):
                journal.flush()
            with pytest.raises(InputError, match="free space"):
                journal.append(PROBLEM, "kind", "lost")
    with Journal.resume(folder) as journal:
        assert journal.counts()["problem"] == 1
        assert journal.counts()["keyframe"] == 0


def test_damaged_snapshots_are_errors(tmp_path: Path) -> None:
    folder = tmp_path / "unfinished"
    with Journal.begin(folder, {}) as journal:
        journal.snapshot({**journal.counts(), "keyframe": 5}, {"own": freeze(1)})
    with pytest.raises(InputError, match="rows of table keyframe are missing"):
        Journal.resume(folder)
    (folder / "state.npz").write_bytes(b"")
    with pytest.raises(InputError, match=r"state\.npz: missing or damaged"):
        Journal.resume(folder)


def test_the_second_run_in_a_folder_is_refused(tmp_path: Path) -> None:
    with locked(tmp_path / "run"):
        with (
            pytest.raises(InputError, match=f"process {os.getpid()} on .* writes a run into this folder"),
            locked(tmp_path / "run"),
        ):
            pass
        (tmp_path / "run" / "map.pcd").touch()
    with locked(tmp_path / "run"):
        pass
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["map.pcd"]


def hold(folder: Path, ready: multiprocessing.synchronize.Event) -> None:
    with locked(folder):
        ready.set()
        os.kill(os.getpid(), 9)


def test_the_lock_of_a_process_that_was_killed_is_free(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    ready = context.Event()
    process = context.Process(target=hold, args=(tmp_path, ready))
    process.start()
    process.join()
    assert (tmp_path / ".lock").read_text().startswith(f"process {process.pid} on ")
    with locked(tmp_path):
        pass
    assert not (tmp_path / ".lock").exists()


def test_a_link_in_place_of_the_lock_is_refused(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("mine")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / ".lock").symlink_to(victim)
    with pytest.raises(InputError, match="cannot be written"), locked(tmp_path / "run"):
        pass
    assert victim.read_text() == "mine"
