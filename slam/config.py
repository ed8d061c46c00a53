"""Settings from presets, files and the command line; the presets in configs/ contain only the differences."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from slam.data.errors import InputError
from slam.data.yaml_text import parsed
from slam.preset_files import preset_files
from slam.settings import Config, Settings

#: Presets and settings of earlier versions that were removed, with their replacement.
REMOVED_PRESETS = {f"channels-{name}": f"leave it out, --input {name} is enough" for name in ("16", "enriched")}
REMOVED_SETTINGS = {
    "odometry.unseen_tilt_deg": "leave it out, the covariance comes from the registration alone",
    "pose_graph.held_back": "leave it out, the odometry itself observes the pitch of sparse scans",
}
#: Settings of earlier versions that were renamed.
RENAMED_SETTINGS = {
    "front_end.drop": "front_end.ring_selection",
    "odometry.floor": "odometry.regularisation",
    "odometry.information": "odometry.information_matrix",
    "odometry.kernel": "odometry.kernel_scale",
    "loops.candidates": "loops.max_candidates",
    "loops.max_distance": "loops.max_descriptor_distance",
    "loops.scan_context.preselected": "loops.scan_context.max_preselected",
    "loops.scan_context.min_travelled": "loops.scan_context.min_travelled_distance",
    "loops.verification.match_reach": "loops.verification.match_submap_radius",
    "loops.verification.query_reach": "loops.verification.query_submap_radius",
    "loops.verification.registered_voxel_size": "loops.verification.registration_voxel_size",
    "loops.verification.distinct_radius": "loops.verification.distinctness_radius",
    "pose_graph.rotation_deg": "pose_graph.rotation_drift_deg",
    "pose_graph.translation": "pose_graph.translation_drift",
}


def load_config(source: str | Path | None = None, overrides: Sequence[str] = (), **front_end: Any) -> Config:
    """Load settings: the defaults, overridden by `source`, then by `overrides`, then by `front_end`.

    Args:
        source: A YAML file or the name of a preset (see `slam.preset_files`).
        overrides: Single settings, such as 'odometry.voxel_size=1.0'.
        **front_end: Front-end settings, such as input='16'; None leaves a setting unchanged.

    Raises:
        InputError: A key is unknown (the message names the most similar one), removed or renamed, or a value is
            invalid.
    """
    name = str(source) if source else "the command line"
    values = _read(source) if source else {}
    for override in overrides:
        _set(values, override)
    _check_keys(values, Config, name, "")
    values.setdefault("front_end", {}).update({key: value for key, value in front_end.items() if value is not None})
    try:
        return Config.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{name}: {where + ': ' if where else ''}{first['msg']}") from error


def yaml_text(config: Config) -> str:
    """Format all settings as YAML that `load_config` can read, with a comment above each section."""
    lines = ["# Settings of lidarlift: slam/settings.py gives the reason for each default."]
    for name, section in config:
        content = yaml.dump({name: section.model_dump(mode="json")}, Dumper=_ListsInline, sort_keys=False)
        lines += ["", f"# {inspect.cleandoc(type(section).__doc__ or name)}", content.rstrip()]
    return "\n".join(lines) + "\n"


class _ListsInline(yaml.SafeDumper):
    """Writes lists such as [4.0, 2.0, 1.0] on one line, and sections with one line per key."""


_ListsInline.add_representer(
    list, lambda dumper, values: dumper.represent_sequence("tag:yaml.org,2002:seq", values, flow_style=True)
)


def _read(source: str | Path) -> dict[str, Any]:
    path = Path(source)
    presets = preset_files()
    preset = presets.get(str(source))
    if not path.is_file() and str(source) in REMOVED_PRESETS:
        raise InputError(
            f"{source}: this preset was removed, the defaults apply to all inputs; {REMOVED_PRESETS[str(source)]}"
        )
    if not path.is_file() and preset is None:
        raise InputError(f"{source}: neither a file nor a preset; presets are {', '.join(presets)}")
    try:
        text = path.read_text(encoding="utf-8") if path.is_file() or preset is None else preset.read_text("utf-8")
        values = parsed(text) or {}
    except ValueError as error:  # of text that is not UTF-8 too
        raise InputError(f"{source}: not YAML: {error}") from error
    if not isinstance(values, dict):
        raise InputError(f"{source}: expected sections such as 'odometry:', found {type(values).__name__}")
    return values


def _set(values: dict[str, Any], override: str) -> None:
    key, equals, text = override.partition("=")
    *sections, leaf = key.strip().split(".")
    try:
        for section in sections:
            values = values.setdefault(section, {})
        values[leaf] = parsed(text)
    except (ValueError, AttributeError, TypeError) as error:
        raise InputError(f"--set {override}: write section.key=value, as in odometry.voxel_size=1.0") from error
    if not equals or not leaf or not text.strip():
        raise InputError(f"--set {override}: write section.key=value, as in odometry.voxel_size=1.0")


def _check_keys(values: dict[str, Any], model: type[Settings], source: str, prefix: str) -> None:
    """Raise InputError for a wrong key, with the most similar right one, before pydantic would."""
    for key, value in values.items():
        field, name = model.model_fields.get(key), f"{prefix}{key}"
        if name in REMOVED_SETTINGS:
            raise InputError(f"{source}: the setting '{name}' was removed; {REMOVED_SETTINGS[name]}")
        if name in RENAMED_SETTINGS:
            raise InputError(f"{source}: the setting '{name}' was renamed; use '{RENAMED_SETTINGS[name]}'")
        if field is None:
            right = difflib.get_close_matches(str(key), _all_keys(Config, ""), 1, 0.0)
            near = difflib.get_close_matches(str(key), list(model.model_fields), 1, 0.5)
            best = prefix + near[0] if near else right[0]
            raise InputError(f"{source}: unknown setting '{name}'; did you mean '{best}'?")
        if isinstance(field.annotation, type) and issubclass(field.annotation, Settings):
            if not isinstance(value, dict):
                raise InputError(f"{source}: '{name}' is a section; set a key in it, as in {key}.NAME: value")
            _check_keys(value, field.annotation, source, f"{name}.")


def _all_keys(model: type[Settings], prefix: str) -> list[str]:
    keys: list[str] = []
    for name, field in model.model_fields.items():
        section = isinstance(field.annotation, type) and issubclass(field.annotation, Settings)
        keys += _all_keys(field.annotation, f"{prefix}{name}.") if section else [prefix + name]  # type: ignore[arg-type]
    return keys
