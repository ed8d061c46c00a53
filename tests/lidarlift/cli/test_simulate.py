"""`lidarlift simulate`: what is asked for is simulated, and the next command is told."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from slam.data.sensor_names import SENSORS
from slam.simulation.drive_names import DRIVES
from slam.simulation.simulation import SimulationConfig

Command = Callable[..., Any]


def test_the_output_can_be_run(lidarlift: Command, simulated: list[SimulationConfig]) -> None:
    result = lidarlift("simulate", "my town", "--frames", "3")
    assert result.code == 0, result.err
    assert simulated == [SimulationConfig()]
    assert len(list(Path("my town/sequences/77/velodyne").iterdir())) == 3
    assert "3 frames of hdl64" in result.out
    assert "frames/s" in result.err
    following = shlex.split(result.out.partition("Next: ")[2])
    assert following == ["lidarlift", "run", "my town", "--out", "runs/my town"]
    assert lidarlift(*following[1:]).code == 0
    assert Path("runs/my town/metrics.json").exists()


def test_every_option_reaches_the_simulation(lidarlift: Command, simulated: list[SimulationConfig]) -> None:
    options = ["--drive", "jam", "--sensor", "vlp16", "--spacing", "0.5", "--distort", "--seed", "3", "--with-depth"]
    assert lidarlift("simulate", "town", *options).code == 0
    assert lidarlift("simulate", "town", "--trajectory", "poses.txt").code == 0
    mounted = ["--sensor", "os1-128", "--rate", "20", "--height", "1.2", "--tilt", "-90"]
    assert lidarlift("simulate", "town", *mounted, "--distort", "--format", "folder", "--stamp", "end").code == 0
    assert simulated == [
        SimulationConfig("jam", spacing=0.5, sensor="vlp16", distort=True, seed=3, depth=True),
        SimulationConfig(trajectory=Path("poses.txt")),
        SimulationConfig(
            sensor="os1-128", distort=True, rate=20, height=1.2, tilt=-math.pi / 2, format="folder", stamp="end"
        ),
    ]


@pytest.mark.usefixtures("simulated")
def test_frames_are_limited_by_the_length_of_the_sequence(lidarlift: Command) -> None:
    assert "8 frames" in lidarlift("simulate", "town", "--frames", "100").out


@pytest.mark.parametrize(
    "options",
    [
        ("--drive", "loop", "--trajectory", "poses.txt"),
        ("--drive", "circle"),
        ("--sensor", "vlp32"),
        ("--format", "rosbag"),
        ("--stamp", "never"),
        ("--frames", "0"),
    ],
)
def test_invalid_options_are_usage_errors(
    lidarlift: Command, simulated: list[SimulationConfig], options: tuple[str, ...]
) -> None:
    result = lidarlift("simulate", "town", *options)
    assert result.code == 2
    assert "Usage" in result.err
    assert options[-2] in result.err
    assert not simulated


def test_conflicting_options_are_an_error_in_one_line(lidarlift: Command) -> None:
    lidarlift("simulate", "town", "--stamp", "end").refused("--stamp end", "add --format folder")
    assert not Path("town").exists()


def test_help_lists_scenes_and_lidars(lidarlift: Command) -> None:
    words = " ".join(lidarlift("simulate", "--help").out.replace("│", " ").split())
    for name in (*DRIVES.names(), *SENSORS.names()):
        assert name in words


def test_a_missing_trajectory_is_an_error(lidarlift: Command) -> None:
    lidarlift("simulate", "town", "--trajectory", "nowhere.txt").refused("nowhere.txt")
    assert not Path("town").exists()


def test_a_file_in_place_of_the_folder_is_an_error(lidarlift: Command) -> None:
    Path("town").write_text("mine")
    lidarlift("simulate", "town").refused("town")
    assert Path("town").read_text() == "mine"
