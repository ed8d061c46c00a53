"""Runs and simulations that tests of the command start from."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from slam.simulation.simulation import SimulationConfig


@pytest.fixture(scope="session")
def earlier_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the run of the street drive is kept for `finished`, once there is one."""
    return tmp_path_factory.mktemp("finished") / "r"


@pytest.fixture
def finished(lidarlift: Callable[..., Any], street_drive: Callable[..., Path], earlier_run: Path) -> Path:
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
