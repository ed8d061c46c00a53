"""The command as its users meet it: exit codes, stdout, stderr."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from lidarlift.cli import main
from slam.simulation.simulation import SimulationConfig


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
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> Callable[..., Result]:
    """`lidarlift("run", path)`: the command in this process, for each start takes seconds. Exceptions are bugs."""
    monkeypatch.chdir(tmp_path)

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


@pytest.fixture(scope="session")
def earlier_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the run of the street drive is kept for `finished`, once there is one."""
    return tmp_path_factory.mktemp("finished") / "r"


@pytest.fixture
def finished(lidarlift: Callable[..., Result], street_drive: Callable[..., Path], earlier_run: Path) -> Path:
    """A sequence whose run is in ./r."""
    path = street_drive()
    if not earlier_run.exists():
        assert lidarlift("run", path, "--out", "r").code == 0
        shutil.copytree("r", earlier_run)
    shutil.copytree(earlier_run, "r", dirs_exist_ok=True)
    return path


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch, street_drive: Callable[..., Path]) -> list[SimulationConfig]:
    """Simulations are copies of the street drive, for a town takes minutes; the list gets the settings of each."""
    sequence, seen = street_drive(), list[SimulationConfig]()

    class Street:
        def __init__(self, settings: SimulationConfig) -> None:
            seen.append(settings)

        def __len__(self) -> int:
            return 8

        def matches(self, folder: Path) -> bool:
            return not folder.exists() or (folder / "sequences").is_dir()

        def missing(self, folder: Path, frames: int) -> list[int]:
            return [number for number in range(frames) if not list(folder.rglob(f"{number:06d}.bin"))]

        def write(self, folder: Path, frames: int, on_frame: Callable[[], None]) -> None:
            shutil.copytree(sequence.parent.parent, folder, dirs_exist_ok=True)
            for scan in (folder / "sequences" / "77" / "velodyne").iterdir():
                scan.unlink() if int(scan.stem) >= frames else on_frame()

    monkeypatch.setattr("slam.simulation.simulation.Simulation", Street)
    return seen
