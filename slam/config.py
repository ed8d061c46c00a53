"""Settings from presets, files and the command line; the presets in configs/ say only what differs."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from slam.data.errors import InputError
from slam.data.yaml_text import parsed
from slam.settings import Config, Settings

#: Presets and settings of earlier versions, and what is instead.
GONE_PRESETS = {f"channels-{name}": f"leave it out, --input {name} does" for name in ("16", "enriched")}
GONE_SETTINGS = {
    "odometry.unseen_tilt_deg": "leave it out, the covariance comes from the registration alone",
    "pose_graph.held_back": "leave it out, the odometry sees the pitch of sparse scans itself",
}


def load_config(source: str | Path | None = None, overrides: Sequence[str] = (), **front_end: Any) -> Config:
    """Defaults, then `source`, then `overrides` ('odometry.voxel_size=1.0').

    `source` is a YAML file or a preset's name (see `preset_names`); keywords set front-end values, such as input='16',
    and beat the file's. Raises InputError on an unknown key, with the nearest right one, or on a value that makes no
    sense.
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
    """All settings as YAML that `load_config` reads back, each section under a comment that says what it is for."""
    lines = ["# Settings of lidarlift: slam/settings.py gives the reason beside each default."]
    for name, section in config:
        content = yaml.dump({name: section.model_dump(mode="json")}, Dumper=_ListsInline, sort_keys=False)
        lines += ["", f"# {inspect.cleandoc(type(section).__doc__ or name)}", content.rstrip()]
    return "\n".join(lines) + "\n"


def preset_names() -> list[str]:
    """Names of the presets that are shipped."""
    return sorted(file.name.removesuffix(".yaml") for file in _presets() if file.name.endswith(".yaml"))


class _ListsInline(yaml.SafeDumper):
    """[4.0, 2.0, 1.0] in one line; sections a line a key."""


_ListsInline.add_representer(
    list, lambda dumper, values: dumper.represent_sequence("tag:yaml.org,2002:seq", values, flow_style=True)
)


def _presets() -> Iterator[Any]:
    return resources.files("slam.presets").iterdir()


def _read(source: str | Path) -> dict[str, Any]:
    path = Path(source)
    preset = next((file for file in _presets() if file.name == f"{source}.yaml"), None)
    if not path.is_file() and str(source) in GONE_PRESETS:
        raise InputError(f"{source}: this preset is gone, one rule serves all inputs; {GONE_PRESETS[str(source)]}")
    if not path.is_file() and preset is None:
        raise InputError(f"{source}: no such file and no preset; presets are {', '.join(preset_names())}")
    try:
        text = path.read_text(encoding="utf-8") if path.is_file() or preset is None else preset.read_text("utf-8")
        values = parsed(text) or {}
    except ValueError as error:  # of text that is not UTF-8 too
        raise InputError(f"{source}: not YAML: {error}") from error
    if not isinstance(values, dict):
        raise InputError(f"{source}: sections such as 'odometry:' expected, found {type(values).__name__}")
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
    """InputError that names the nearest right key, before pydantic sees a wrong one."""
    for key, value in values.items():
        field = model.model_fields.get(key)
        if f"{prefix}{key}" in GONE_SETTINGS:
            raise InputError(f"{source}: the setting '{prefix}{key}' is gone; {GONE_SETTINGS[f'{prefix}{key}']}")
        if field is None:
            right = difflib.get_close_matches(str(key), _all_keys(Config, ""), 1, 0.0)
            near = difflib.get_close_matches(str(key), list(model.model_fields), 1, 0.5)
            best = prefix + near[0] if near else right[0]
            raise InputError(f"{source}: unknown setting '{prefix}{key}'; did you mean '{best}'?")
        if isinstance(field.annotation, type) and issubclass(field.annotation, Settings):
            if not isinstance(value, dict):
                raise InputError(f"{source}: '{prefix}{key}' is a section; set a key in it, as in {key}.NAME: value")
            _check_keys(value, field.annotation, source, f"{prefix}{key}.")


def _all_keys(model: type[Settings], prefix: str) -> list[str]:
    keys: list[str] = []
    for name, field in model.model_fields.items():
        section = isinstance(field.annotation, type) and issubclass(field.annotation, Settings)
        keys += _all_keys(field.annotation, f"{prefix}{name}.") if section else [prefix + name]  # type: ignore[arg-type]
    return keys
