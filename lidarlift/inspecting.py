"""What is in a data set, before anything is run."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from slam.data.cloud import Array, PointCloud
    from slam.data.dataset import Dataset
    from slam.data.point_files import Points
    from slam.data.problem import Problem

LOOKED_AT = 12  # scans, evenly spread
FEW_RINGS, MANY_RINGS = 32, 64  # that are worth filling in; of which 16 can be taken, and filled in, to compare
ALIKE = 0.6  # deg: a ring's median elevation from a sensor's line, at most as a median over the rings
HOLE = 1.5  # of the usual step between stamps


@dataclass(frozen=True)
class Info:
    """A data set in figures, and what would be assumed of it.

    Attributes:
        name: Of the data set.
        path: Its folder.
        scans: How many there are.
        first: Number of the first scan, and
        last: of the last.
        rate_hz: Scans a second, as is usual; None for a single scan.
        duration_s: From the first stamp to the last.
        stamps: Where these are from.
        holes: How many steps between stamps are much longer than usual, and
        longest_hole_s: the longest of them; 0 without any.
        looked_at: How many scans were read for what follows.
        points: Of a scan, the median.
        range_m: Of the points, the nearest, median and farthest (1, 50 and 99 %).
        fields: Of the points as the files have them, with type and values.
        rings: How many have returns; None where the rings are unknown.
        rings_from: How they are known, or why not.
        point_times: The verdict on the points' times.
        sensor: Name of the LiDAR, None where nobody said.
        looks_like: A built-in LiDAR whose lines the rings fit, None where one is named, or none fits.
        vertical_correction_deg: What elevations are raised by.
        motion_compensated: Whether the scans are deskewed already.
        images: How many scans have one, and
        image_size: width and height in pixels; None where none was read.
        calibrated: Whether the camera's calibration is there.
        truth: How many scans have ground truth, and
        truth_m: how long its way is, holes left out.
        problems: What would be noted in a run: each kind with its count, and the first message.
        commands: What to type next.
    """

    name: str
    path: Path
    scans: int
    first: int
    last: int
    rate_hz: float | None
    duration_s: float
    stamps: str
    holes: int
    longest_hole_s: float
    looked_at: int
    points: int
    range_m: tuple[float, float, float]
    fields: tuple[str, ...]
    rings: int | None
    rings_from: str
    point_times: str
    sensor: str | None
    looks_like: str | None
    vertical_correction_deg: float
    motion_compensated: bool
    images: int
    image_size: tuple[int, int] | None
    calibrated: bool
    truth: int
    truth_m: float
    problems: tuple[tuple[str, int, str], ...]
    commands: tuple[str, ...]


def info(
    path: str | Path,
    *,
    sequence: str | None = None,
    sensor: str | Path | None = None,
    columns: str | None = None,
    every_scan: bool = False,
) -> Info:
    """Look into a data set: open it and read some of its scans.

    Args:
        path: What `open_dataset` takes.
        sequence: Which sequence or drive, where the folder has several.
        sensor: The LiDAR's name or a YAML file with its beams, where the folder does not say.
        columns: What the numbers of .bin and .npy scans are, as `open_dataset` takes it.
        every_scan: Read all of its scans, so that all damage is found.

    Raises:
        InputError: As `open_dataset`.

    Example:
        >>> found = lidarlift.info("my_drive")
        >>> found.scans, found.rate_hz, found.rings, found.point_times
        (4541, 10.0, 16, 'field t, ns, relative, 0 to 99.9 ms of a 100 ms sweep, in 12 of 12 scans; stamp = start')
    """
    from slam.data.dataset import open_dataset
    from slam.data.stamps import usual_step

    data = open_dataset(path, sequence, sensor, columns=columns)
    chosen = np.arange(len(data)) if every_scan else np.linspace(0, len(data) - 1, LOOKED_AT).round().astype(int)
    looks = [_look(data, int(position)) for position in np.unique(chosen)]
    full = [look for look in looks if look.points] or looks[:1]
    usual, steps = usual_step(data.stamps), np.diff(data.stamps)
    holes = steps[steps > HOLE * usual] if usual else steps[:0]
    looks_like = None if data.sensor else _looks_like(full[0].elevations)
    rings, rings_from = _rings(data, full)
    truth, truth_m = _truth(data.ground_truth)
    return Info(
        name=data.name,
        path=data.path,
        scans=len(data),
        first=int(data.numbers[0]),
        last=int(data.numbers[-1]),
        rate_hz=1 / usual if usual else None,
        duration_s=float(data.stamps[-1] - data.stamps[0]),
        stamps=getattr(data, "stamps_from", None) or "of the data set",
        holes=len(holes),
        longest_hole_s=float(holes.max(initial=0)),
        looked_at=len(looks),
        points=int(np.median([look.points for look in full])),
        range_m=_ranges(full),
        fields=full[0].fields,
        rings=rings,
        rings_from=rings_from,
        point_times=_times(data, looks),
        sensor=data.sensor.name if data.sensor else None,
        looks_like=looks_like,
        vertical_correction_deg=float(np.rad2deg(data.sensor.vertical_correction)) if data.sensor else 0.0,
        motion_compensated=bool(data.sensor and data.sensor.motion_compensated),
        images=sum(image is not None for image in getattr(data, "images", ())),
        image_size=next((look.image_size for look in looks if look.image_size), None),
        calibrated=data.calibration is not None,
        truth=truth,
        truth_m=truth_m,
        problems=_kinds([*data.problems, *(problem for look in looks for problem in look.problems)]),
        commands=_commands(path, {"sequence": sequence, "sensor": sensor or looks_like, "columns": columns}, rings),
    )


@dataclass(frozen=True, eq=False)
class _Look:
    """What one scan shows: how many points, their ranges (1, 50, 99 %), whether they have times, the files' fields, the
    median elevation [deg] of each ring, top first, and what is wrong."""

    points: int
    ranges: Array
    timed: bool
    fields: tuple[str, ...]
    ring_field: bool
    elevations: Array
    image_size: tuple[int, int] | None
    problems: tuple[Problem, ...]


def _look(data: Dataset, position: int) -> _Look:
    from slam.data.images import found_in_reading

    frame = data[position]
    cloud, image = frame.cloud, frame.image
    range_ = np.linalg.norm(cloud.xyz, axis=1)
    raw = data.points(position) if hasattr(data, "points") else None
    return _Look(
        points=len(cloud),
        ranges=np.percentile(range_, [1, 50, 99]) if len(cloud) else np.zeros(3),
        timed=cloud.time is not None,
        fields=_fields(raw) if raw else (),
        ring_field=raw is not None and raw.ring is not None,
        elevations=_elevations(cloud),
        image_size=None if image is None else (image.shape[1], image.shape[0]),
        problems=(*frame.problems, *found_in_reading(frame)),
    )


def _fields(points: Points) -> tuple[str, ...]:
    """Each field of a file with its type and values."""
    columns = {"intensity": points.intensity, "ring": points.ring, **points.times}
    found = [_field(name, values) for name, values in columns.items() if values is not None and len(values)]
    return ("x y z", *found, *(["colour"] if points.colour is not None else []))


def _field(name: str, values: Array) -> str:
    digits = 4 if values.dtype.kind == "f" and np.nanmax(np.abs(values)) < 1e4 else 16  # all of a clock's
    return f"{name} ({values.dtype}, {np.nanmin(values):.{digits}g} to {np.nanmax(values):.{digits}g})"


def _elevations(cloud: PointCloud) -> Array:
    """(R,) degrees: the median of each ring with points, top first."""
    if cloud.ring is None:
        return np.zeros(0)
    elevation = np.rad2deg(np.arctan2(cloud.xyz[:, 2], np.hypot(cloud.xyz[:, 0], cloud.xyz[:, 1])))
    return np.array([np.median(elevation[cloud.ring == ring]) for ring in np.unique(cloud.ring)])


def _looks_like(elevations: Array) -> str | None:
    """The built-in LiDAR with as many rings, where these lie on its lines."""
    from slam.data.sensor_names import SENSORS

    for name in SENSORS.names():
        lines = np.rad2deg(SENSORS.load(name)().elevation)
        if len(lines) == len(elevations) and np.median(np.abs(lines - elevations)) < ALIKE:
            return name
    return None


def _rings(data: Dataset, looks: Sequence[_Look]) -> tuple[int | None, str]:
    """How many rings have returns, and how they are known."""
    count = max(len(look.elevations) for look in looks)
    if not count:
        return None, "unknown: to drop rings or to fill them in, name the LiDAR with --sensor"
    named = f"by the lasers of {data.sensor.name}" if data.sensor else "known to the data set"
    return count, "by the field ring" if looks[0].ring_field else named


def _times(data: Dataset, looks: Sequence[_Look]) -> str:
    verdict, timed = getattr(data, "point_times", None), sum(look.timed for look in looks)
    if verdict is None:
        return f"in {timed} of {len(looks)} scans"
    return str(verdict.verdict(timed, len(looks))).removeprefix("point times: ")


def _ranges(looks: Sequence[_Look]) -> tuple[float, float, float]:
    near, middle, far = np.median([look.ranges for look in looks], axis=0)
    return float(near), float(middle), float(far)


def _truth(poses: Array | None) -> tuple[int, float]:
    """How many poses (N, 4, 4) are known, and the way between those that follow each other [m]."""
    if poses is None:
        return 0, 0.0
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    return int(np.isfinite(poses[:, 0, 0]).sum()), float(np.nansum(steps))


def _kinds(problems: Sequence[Problem]) -> tuple[tuple[str, int, str], ...]:
    kinds: dict[str, list[str]] = {}
    for problem in problems:
        kinds.setdefault(problem.kind, []).append(problem.message)
    return tuple((kind, len(messages), messages[0]) for kind, messages in kinds.items())


def _commands(path: str | Path, options: Mapping[str, object], rings: int | None) -> tuple[str, ...]:
    """To run it, and to have it filled in where that can be done."""
    given = "".join(f" --{name} {shlex.quote(str(value))}" for name, value in options.items() if value)
    drive = f"{shlex.quote(str(path))}{given}"
    commands = [f"lidarlift run {drive}"]
    if rings is not None and rings <= FEW_RINGS:
        commands.append(f"lidarlift run {drive} --input enriched")
    elif rings == MANY_RINGS:
        commands.append(f"lidarlift compare {drive}")
    return tuple(commands)
