"""Runs over a data set that are resumed: each kind of odometry and front end has the same bits as without a stop."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lidarlift
from lidarlift.reporting import Quiet
from slam.config import load_config
from slam.data.cloud import Array
from slam.data.errors import InputError
from slam.identity import differences
from slam.journal import journal as journals
from slam.run import Run
from slam.session import RESULTS, UNFINISHED

Drive = Callable[..., Path]
SAME = [*(name for name in RESULTS if not name.endswith((".png", ".html", "run.json"))), "odometry_tum.txt"]

CASES: dict[str, dict[str, Any]] = {
    "ndt": {},
    "16 rings": {"input": "16"},
    "enriched": {"input": "enriched", "enricher": "ray-segment"},
    "icp": {"overrides": ["odometry.registration=icp-point-to-plane", "odometry.target=scan"]},
    "as in the paper": {"overrides": ["odometry.information_matrix=covariance", "odometry.target=scan"]},
    "points with times": {"times": True},
    "recorded poses": {"poses": True},
}


class StopError(BaseException):
    """Ends a run as a kill does, but in this process."""


def stopped_at(frame: int) -> Any:
    """A reporter that stops the run after so many frames."""

    class Stops(Quiet):
        def progress(self, title: str, total: int) -> Any:
            left = iter(range(frame - 1))

            def advance() -> None:
                if next(left, None) is None:
                    raise StopError

            return nullcontext(advance)

    return Stops()


@pytest.fixture(autouse=True)
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """A snapshot after every frame."""
    monkeypatch.setattr(journals, "SNAPSHOT_EVERY", 0.0)


def arguments(case: str, path: Path, tmp_path: Path, street_poses: Array) -> dict[str, Any]:
    given = dict(CASES[case])
    if given.pop("times", False):
        (path / "sensor.yaml").write_text("model: hdl64\n")
    if given.pop("poses", False):
        np.savetxt(tmp_path / "poses.txt", street_poses[:, :3].reshape(-1, 12))
        given["odometry"] = tmp_path / "poses.txt"
    return given


@pytest.mark.parametrize("case", CASES)
def test_a_resumed_run_has_the_same_files(case: str, street_drive: Drive, tmp_path: Path, street_poses: Array) -> None:
    """Equal bytes: two runs of the same code."""
    path = street_drive({5: b""})  # a damaged scan is a problem of the run, said once
    given = arguments(case, path, tmp_path, street_poses)
    whole = lidarlift.run(path, out=tmp_path / "whole", **given)
    for stop in (3, 4, 6, 7):
        with pytest.raises(StopError):
            lidarlift.run(path, out=tmp_path / "r", resume=True, reporter=stopped_at(stop), **given)
    assert (tmp_path / "r" / UNFINISHED / "state.npz").is_file()
    resumed = lidarlift.run(path, out=tmp_path / "r", resume=True, **given)
    check_same(whole, resumed, tmp_path)
    lidarlift.run(path, out=tmp_path / "r", resume=True, **given)  # a finished run is finished again
    check_same(whole, resumed, tmp_path)
    assert sorted(file.name for file in (tmp_path / "r").iterdir()) == sorted(
        file.name for file in (tmp_path / "whole").iterdir()
    )


def check_same(whole: Run, resumed: Run, tmp_path: Path) -> None:
    assert resumed.problems == whole.problems
    assert resumed.counts() == whole.counts()
    assert (resumed.timed, resumed.sizes, len(resumed.records)) == (whole.timed, whole.sizes, len(whole.records))
    for name in SAME:
        assert (tmp_path / "r" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name


def stop(path: Path, out: Path, **given: Any) -> None:
    with pytest.raises(StopError):
        lidarlift.run(path, out=out, reporter=stopped_at(4), **given)


def test_another_run_is_refused_with_the_differences(street_drive: Drive, tmp_path: Path) -> None:
    path, out = street_drive(), tmp_path / "r"
    stop(path, out)
    with pytest.raises(InputError, match=r"odometry.min_points was 5 and is 6\. "):
        lidarlift.run(path, out=out, resume=True, overrides=["odometry.min_points=6"])
    with pytest.raises(InputError, match=r"input.frames was \[0, 8, 1\] and is \[0, 5, 1\]"):
        lidarlift.run(path, out=out, resume=True, frames=slice(5))
    first, *others = (path / "velodyne" / f"{number:06d}.bin" for number in range(4))
    content = first.read_bytes()
    first.write_bytes(content[16:])
    with pytest.raises(InputError, match=r"input\.first scan was"):
        lidarlift.run(path, out=out, resume=True)
    first.write_bytes(content)
    for scan in others:
        scan.write_bytes(content)
    with pytest.raises(InputError, match=r"scan \d has changed since the run began"):
        lidarlift.run(path, out=out, resume=True)


def test_an_unfinished_run_is_not_overwritten(street_drive: Drive, tmp_path: Path) -> None:
    path, out = street_drive(), tmp_path / "r"
    stop(path, out)
    with pytest.raises(InputError, match="holds an unfinished run of 4 frames; add --resume"):
        lidarlift.run(path, out=out)
    shutil.rmtree(out / UNFINISHED)
    lidarlift.run(path, out=out)
    assert (out / "run.json").is_file()


def test_resume_needs_a_folder(street_drive: Drive) -> None:
    with pytest.raises(ValueError, match="give it as out"):
        lidarlift.run(street_drive(), resume=True)


def test_the_earlier_run_is_kept_until_there_are_new_results(street_drive: Drive, tmp_path: Path) -> None:
    path, out = street_drive(), tmp_path / "r"
    lidarlift.run(path, out=out, frames=slice(3))
    before = (out / "run.json").read_bytes()
    stop(path, out)
    assert (out / "run.json").read_bytes() == before
    assert (out / "session" / "session.sqlite").is_file()
    lidarlift.run(path, out=out, resume=True)
    assert (out / "run.json").read_bytes() != before
    assert not (out / UNFINISHED).exists()


def test_differences_are_named_by_their_settings() -> None:
    before, after = load_config().model_dump(), load_config(None, ["map.colour=false"]).model_dump()
    assert differences({"settings": before}, {"settings": before}) == []
    assert differences({"settings": before}, {"settings": after}) == ["map.colour was True and is False"]
    assert differences({"input": None}, {"input": {"path": "x"}}) == ["input was None and is {'path': 'x'}"]
    assert differences({}, {"version": 1}) == ["version was None and is 1"]
