"""`lidarlift config`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import lidarlift as package
from slam.config import load_config
from slam.preset_files import preset_names

Command = Callable[..., Any]


@pytest.mark.parametrize("preset", preset_names())
def test_the_printed_settings_can_be_loaded(lidarlift: Command, tmp_path: Path, preset: str) -> None:
    result = lidarlift("config", "--config", preset, "--set", "odometry.voxel_size=0.7")
    (tmp_path / "mine.yaml").write_text(result.out)
    assert load_config(tmp_path / "mine.yaml") == load_config(preset, ["odometry.voxel_size=0.7"])


def test_the_input_is_printed(lidarlift: Command) -> None:
    assert "input: '16'" in lidarlift("config", "--input", "16").out


def test_a_removed_preset_names_its_replacement(lidarlift: Command) -> None:
    lidarlift("config", "--config", "channels-16").refused("--input 16")


def test_sections_have_a_comment(lidarlift: Command) -> None:
    assert "# Scan registration, frame by frame.\nodometry:\n" in lidarlift("config").out


def test_an_unknown_setting_is_an_error(lidarlift: Command) -> None:
    lidarlift("config", "--set", "odometry.voxelsize=1").refused("odometry.voxel_size")


def test_version_is_printed(lidarlift: Command) -> None:
    assert lidarlift("--version").out == f"lidarlift {package.__version__}\n"
