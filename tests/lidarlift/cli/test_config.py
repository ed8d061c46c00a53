"""`lidarlift config`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import lidarlift as package
from slam.config import load_config, preset_names

Command = Callable[..., Any]


@pytest.mark.parametrize("preset", preset_names())
def test_what_is_printed_is_read_back(lidarlift: Command, tmp_path: Path, preset: str) -> None:
    result = lidarlift("config", "--config", preset, "--set", "odometry.voxel_size=0.7")
    (tmp_path / "mine.yaml").write_text(result.out)
    assert load_config(tmp_path / "mine.yaml") == load_config(preset, ["odometry.voxel_size=0.7"])


def test_the_input_is_in_it(lidarlift: Command) -> None:
    assert "input: '16'" in lidarlift("config", "--input", "16").out


def test_a_preset_that_is_gone_says_what_is_instead(lidarlift: Command) -> None:
    lidarlift("config", "--config", "channels-16").refused("--input 16")


def test_sections_say_what_they_are_for(lidarlift: Command) -> None:
    assert "# Scan registration, frame by frame.\nodometry:\n" in lidarlift("config").out


def test_a_wrong_setting_is_refused(lidarlift: Command) -> None:
    lidarlift("config", "--set", "odometry.voxelsize=1").refused("odometry.voxel_size")


def test_the_version(lidarlift: Command) -> None:
    assert lidarlift("--version").out == f"lidarlift {package.__version__}\n"
