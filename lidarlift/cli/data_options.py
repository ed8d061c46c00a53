"""Options by which commands open a data set, defined once for all of them."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import StrEnum
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from slam.data.errors import InputError
from slam.data.sensor_names import SENSORS

if TYPE_CHECKING:
    from slam.data.dataset import Dataset, DatasetOptions

LIDARS = ", ".join(SENSORS.names())
PANEL = "Reading of the data set"
TIME_UNITS = {"": 1.0, "s": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0}


class Stamp(StrEnum):
    """Instant of a sweep to which its stamp refers."""

    START = "start"
    MIDDLE = "middle"
    END = "end"


def _option(help: str, metavar: str | None = None) -> Any:
    return typer.Option(help=help, metavar=metavar, rich_help_panel=PANEL)


@dataclass(frozen=True)
class DataOptions:
    """Choices of the user on how a data set is read; see `slam.data.dataset.open_dataset`.

    A command has them by a parameter of this type and the decorator `with_data_options`.
    """

    sequence: Annotated[str | None, _option("Name of the sequence, if the folder has several.")] = None
    sensor: Annotated[
        str | None,
        _option(f"The LiDAR: {LIDARS}, a YAML file with its beams, or an Ouster's metadata (.json)."),
    ] = None
    stamp: Annotated[
        Stamp | None, _option("Instant of a sweep to which its stamp and pose refer. Default: from the points' times.")
    ] = None
    point_time: Annotated[
        str | None, _option("Field with the points' times: t:ns. Default: found by its values.", "FIELD[:UNIT]")
    ] = None
    columns: Annotated[
        str | None, _option("Columns of .bin and .npy scans, if not x,y,z,intensity: x,y,z,intensity,ring,t:u4")
    ] = None
    topic: Annotated[
        str | None, _option("Recordings only: topic of the scans. Default: one with times, rings, most points.")
    ] = None
    image_topic: Annotated[
        str | None, _option("Recordings only: topic of the images. Default: one with a CameraInfo.")
    ] = None
    truth_topic: Annotated[
        str | None, _option("Recordings only: topic of the true poses. Default: one that is called truth.")
    ] = None
    start: Annotated[str | None, _option("Recordings only: time skipped at the start, such as 120s or 2m.", "TIME")] = (
        None
    )
    duration: Annotated[str | None, _option("Recordings only: time that is used, such as 60s.", "TIME")] = None

    def opened(self, path: Path) -> Dataset:
        """Open the data set at a path.

        Raises:
            InputError: As `open_dataset`, or a time cannot be read.
        """
        from slam.data.dataset import open_dataset

        return open_dataset(path, self.sequence, self.sensor, **self.said())

    def given(self) -> dict[str, str]:
        """Return the options that the user gives, as on the command line."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {f"--{name.replace('_', '-')}": str(value) for name, value in values.items() if value is not None}

    def said(self) -> DatasetOptions:
        """Return the options of `open_dataset` other than sequence and sensor; None for what the user does not say.

        Raises:
            InputError: A time cannot be read.
        """
        return {
            "stamp": self.stamp and self.stamp.value,
            "point_time": self.point_time,
            "columns": self.columns,
            "topic": self.topic,
            "image_topic": self.image_topic,
            "truth_topic": self.truth_topic,
            "start": _seconds(self.start, "--start"),
            "duration": _seconds(self.duration, "--duration"),
        }


def with_data_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command an option for each field of `DataOptions`, in place of its parameter of that type."""
    parameters = inspect.signature(command, eval_str=True).parameters
    own = inspect.signature(DataOptions, eval_str=True).parameters
    (name,) = (name for name, parameter in parameters.items() if parameter.annotation is DataOptions)

    @wraps(command)
    def expanded(**given: Any) -> None:
        options = DataOptions(**{field: given.pop(field) for field in own})
        command(**{name: options}, **given)

    shown = [each for key, each in parameters.items() for each in (own.values() if key == name else (each,))]
    ordered = [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in shown]
    expanded.__signature__ = inspect.Signature(ordered)  # type: ignore[attr-defined]
    expanded.__annotations__ = {each.name: each.annotation for each in ordered}
    return expanded


def _seconds(text: str | None, option: str) -> float | None:
    """Convert a time such as 120s, 2m or 1.5h to seconds. Raises InputError if the text is not a time."""
    if text is None:
        return None
    found = re.fullmatch(r"([0-9]+\.?[0-9]*|\.[0-9]+) ?([a-z]*)", text.strip())
    if not found or found[2] not in TIME_UNITS:
        raise InputError(f"{option} {text}: write a time, as in 120s, 2m or 1.5h")
    return float(found[1]) * TIME_UNITS[found[2]]
