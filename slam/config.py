"""Settings, typed, with a reason beside each default. The presets in configs/ say only what differs."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from slam.data.errors import InputError


class Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class FrontEndSettings(Settings):
    """From the recorded scan to the cloud that is registered."""

    input: Literal["64", "16"] = "64"  # 64: the scan as recorded; 16: rings dropped
    drop: Literal["every-4th", "vlp16", "average-pool"] = "every-4th"  # which 16 of 64 rings; the literature's default
    phase: int = Field(0, ge=0, le=3)  # of every-4th: the first ring that stays
    deskew: bool | None = None  # None: where the scans have times and are not motion-compensated already
    vertical_correction_deg: float | None = None  # None: the sensor's own (KITTI: 0.205)

    @field_validator("input", mode="before")
    @classmethod
    def _as_text(cls, value: Any) -> Any:
        return str(value) if isinstance(value, int) else value  # YAML reads a bare 16 as a number


class OdometrySettings(Settings):
    """Scan registration, frame by frame."""

    registration: Literal["ndt", "icp-point-to-point", "icp-point-to-plane"] = "ndt"
    target: Literal["map", "scan"] = "map"  # scan: the one before, as the paper has it; drifts 3 to 7 times more
    min_range: float = Field(2.5, ge=0)  # m; nearer is the car itself
    max_range: float = Field(80.0, gt=0)  # m
    map_voxel_size: float = Field(0.4, ge=0.01)  # m, thinning of what enters the map: evens out near and far
    voxel_size: float = Field(1.5, ge=0.01)  # m, thinning of what is registered; near a cell's size it aliases
    cell_sizes: tuple[float, ...] = (2.0, 1.0)  # m: the coarse cells reach further, the fine ones decide
    neighbours: Literal[1, 7] = 1  # Gaussians a point is held against; 7 where the target is a single scan
    min_points: int = Field(5, ge=3)  # a cell with fewer has no Gaussian
    max_points: int = Field(1000, ge=3)  # a cell with so many is left as it is: bounds time, and a standing car's
    floor: float = Field(0.003, gt=0)  # of a cell's covariance, share of its trace: flat cells must not be too sure
    kernel: float = Field(1.0, gt=0)  # Cauchy's, on the Mahalanobis distance; hardly matters between 0.5 and 3
    max_iterations: int = Field(12, ge=1)  # at the finest level; 3 are usual
    map_radius: float = Field(100.0, gt=0)  # m around the sensor: the map forgets the rest
    min_inlier_ratio: float = Field(0.25, ge=0, le=1)  # below it a registration has failed
    max_position_sigma: float = Field(0.5, gt=0)  # m, standard deviation along the worst direction: degenerate above it
    search_radius: float = Field(5.0, ge=0)  # m around the prediction, at start-up, after a gap and in a retry
    min_gate: float = Field(0.5, gt=0)  # m between prediction and registration that is never a jump

    @model_validator(mode="after")
    def _consistent(self) -> OdometrySettings:
        if self.registration != "ndt" and self.target != "scan":
            raise ValueError("ICP registers from scan to scan: set odometry.target=scan")
        if not self.cell_sizes or min(self.cell_sizes) <= 0 or list(self.cell_sizes) != sorted(self.cell_sizes)[::-1]:
            raise ValueError("odometry.cell_sizes are positive and fall, coarse to fine")
        if self.min_range >= self.max_range:
            raise ValueError("odometry.min_range must be below odometry.max_range")
        return self


class MapSettings(Settings):
    """The global map."""

    voxel_size: float = Field(0.2, ge=0.01)  # m: one averaged point a voxel
    min_range: float = Field(2.5, ge=0)  # m; nearer is the car itself, which would leave a trail
    max_range: float = Field(60.0, gt=0)  # m; further points are sparse and less exact


class Config(Settings):
    front_end: FrontEndSettings = FrontEndSettings()
    odometry: OdometrySettings = OdometrySettings()
    map: MapSettings = MapSettings()
    seed: int = 0  # of every random draw


def load_config(source: str | Path | None = None, overrides: Sequence[str] = (), **front_end: Any) -> Config:
    """Defaults, then the preset of the input, then `source`, then `overrides` ('odometry.voxel_size=1.0').

    `source` is a YAML file or a preset's name (see `preset_names`); keywords set front-end values, such as input='16',
    and beat the file's. The preset of the input ('16' has one) comes before the file, so that a file need not repeat
    it. Raises InputError on an unknown key, with the nearest right one, or on a value that makes no sense.
    """
    name = str(source) if source else "the command line"
    values = _read(source) if source else {}
    for override in overrides:
        _set(values, override)
    _check_keys(values, Config, name, "")
    values.setdefault("front_end", {}).update({key: value for key, value in front_end.items() if value is not None})
    preset = f"channels-{values['front_end'].get('input', '64')}"
    base = _read(preset) if preset in preset_names() else {}
    try:
        return Config.model_validate(_merged(base, values))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{name}: {where + ': ' if where else ''}{first['msg']}") from error


def preset_names() -> list[str]:
    """Names of the presets that are shipped."""
    return sorted(file.name.removesuffix(".yaml") for file in _presets() if file.name.endswith(".yaml"))


def _presets() -> Iterator[Any]:
    return resources.files("slam.presets").iterdir()


def _read(source: str | Path) -> dict[str, Any]:
    path = Path(source)
    preset = next((file for file in _presets() if file.name == f"{source}.yaml"), None)
    if not path.is_file() and preset is None:
        raise InputError(f"{source}: no such file and no preset; presets are {', '.join(preset_names())}")
    try:
        text = path.read_text(encoding="utf-8") if path.is_file() or preset is None else preset.read_text("utf-8")
        values = yaml.safe_load(text) or {}
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{source}: not YAML: {' '.join(str(error).split())}") from error
    if not isinstance(values, dict):
        raise InputError(f"{source}: sections such as 'odometry:' expected, found {type(values).__name__}")
    return values


def _set(values: dict[str, Any], override: str) -> None:
    key, equals, text = override.partition("=")
    *sections, leaf = key.strip().split(".")
    try:
        for section in sections:
            values = values.setdefault(section, {})
        values[leaf] = yaml.safe_load(text)
    except (yaml.YAMLError, AttributeError, TypeError) as error:
        raise InputError(f"--set {override}: write section.key=value, as in odometry.voxel_size=1.0") from error
    if not equals or not leaf:
        raise InputError(f"--set {override}: write section.key=value, as in odometry.voxel_size=1.0")


def _check_keys(values: dict[str, Any], model: type[Settings], source: str, prefix: str) -> None:
    """InputError that names the nearest right key, before pydantic sees a wrong one."""
    for key, value in values.items():
        field = model.model_fields.get(key)
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


def _merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    result = dict(base)
    for key, value in over.items():
        result[key] = (
            _merged(result[key], value) if isinstance(value, dict) and isinstance(result.get(key), dict) else value
        )
    return result
