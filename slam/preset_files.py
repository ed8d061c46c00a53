"""The presets that come with lidarlift. Imports nothing heavy, so that the command line can name them in its help."""

from __future__ import annotations

from importlib import resources
from importlib.resources.abc import Traversable


def preset_files() -> dict[str, Traversable]:
    """Return the YAML file of each preset, by its name, in alphabetical order."""
    files = sorted(resources.files("slam.presets").iterdir(), key=lambda file: file.name)
    return {file.name.removesuffix(".yaml"): file for file in files if file.name.endswith(".yaml")}


def preset_names() -> list[str]:
    """Return the names of the presets."""
    return list(preset_files())
