"""Inspection of a data set, without a run."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import numpy as np

from lidarlift.inspecting_topics import TopicInfo, topics_of

if TYPE_CHECKING:
    from slam.data.cloud import Array, PointCloud
    from slam.data.dataset import Dataset, DatasetOptions
    from slam.data.point_files import Points
    from slam.data.problem import Problem

MAX_SCANS = 12  # that are read, evenly spaced
MAX_SPARSE_RINGS, DENSE_RINGS = 32, 64  # enrichment is useful; 16 rings can be selected, enriched and compared
MAX_DIFFERENCE = 0.6  # deg, median over the rings of the difference between a ring's elevation and a sensor's line
GAP = 1.5  # times the usual step between stamps


@dataclass(frozen=True)
class Info:
    """Properties of a data set, and the assumptions of a run.

    Attributes:
        name: Name of the data set.
        path: Folder of the data set.
        scans: Number of scans.
        first: Number of the first scan.
        last: Number of the last scan.
        rate_hz: Usual scan rate [Hz]; None for a single scan.
        duration_s: Time [s] from the first to the last stamp.
        stamps: Source of the stamps.
        holes: Number of gaps: steps between stamps that are much longer than usual.
        longest_hole_s: Longest gap [s]; 0 without gaps.
        looked_at: Number of scans that were read for the properties below.
        points: Median number of points per scan.
        range_m: Ranges [m] of the points: 1st, 50th and 99th percentile.
        fields: Fields of the points in the files, with type and values.
        rings: Number of rings with returns; None if the rings are unknown.
        rings_from: Source of the ring indices, or why they are unknown.
        point_times: How the points' times are interpreted.
        sensor: Name of the LiDAR, None if unknown.
        looks_like: The built-in LiDAR whose lines match the rings; None if the LiDAR is known or none matches.
        vertical_correction_deg: Angle [deg] added to each elevation.
        motion_compensated: Whether the scans are already deskewed.
        images: Number of scans with an image.
        image_size: Width and height of the images in pixels; None if no image was read.
        calibrated: Whether the camera's calibration is available.
        truth: Number of scans with ground truth.
        truth_m: Travelled distance [m] of the ground truth, without gaps.
        problems: Problems that a run would report: each kind with its count and first message.
        commands: Commands to run SLAM on the data set.
        topics: Topics of a recording; empty for other data sets.
        cameras: Number of calibrated cameras.
        positions_only: Whether the ground truth has positions and no rotations.
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
    topics: tuple[TopicInfo, ...] = ()
    cameras: int = 0
    positions_only: bool = False


def info(
    path: str | Path,
    *,
    sequence: str | None = None,
    sensor: str | Path | None = None,
    every_scan: bool = False,
    **options: Unpack[DatasetOptions],
) -> Info:
    """Inspect a data set: open it and read some of its scans.

    Args:
        path: A path that `open_dataset` takes.
        sequence: Name of the sequence, if the folder has several.
        sensor: Name of the LiDAR or a YAML file with its beams, if the folder does not say.
        every_scan: Read all scans, so that all damage is found.
        **options: Those of `open_dataset`.

    Raises:
        InputError: As `open_dataset`.

    Example:
        >>> found = lidarlift.info("my_sequence")
        >>> found.scans, found.rate_hz, found.rings, found.point_times
        (4541, 10.0, 16, 'field t, ns, relative, 0 to 99.9 ms of a 100 ms sweep, in 12 of 12 scans; stamp = start')
    """
    from slam.data.dataset import open_dataset
    from slam.data.stamps import usual_step

    data = open_dataset(path, sequence, sensor, **options)
    chosen = np.arange(len(data)) if every_scan else np.linspace(0, len(data) - 1, MAX_SCANS).round().astype(int)
    inspected = [_inspect_scan(data, int(position)) for position in np.unique(chosen)]
    full = [scan for scan in inspected if scan.points] or inspected[:1]
    usual, steps = usual_step(data.stamps), np.diff(data.stamps)
    gaps = steps[steps > GAP * usual] if usual else steps[:0]
    looks_like = None if data.sensor else _looks_like(full[0].elevations)
    rings, rings_from = _rings(data, full)
    positions: Array | None = getattr(data, "true_positions", None)
    truth, truth_m = _truth(data.ground_truth[:, :3, 3] if data.ground_truth is not None else positions)
    return Info(
        name=data.name,
        path=data.path,
        scans=len(data),
        first=int(data.numbers[0]),
        last=int(data.numbers[-1]),
        rate_hz=1 / usual if usual else None,
        duration_s=float(data.stamps[-1] - data.stamps[0]),
        stamps=getattr(data, "stamps_from", None) or "of the data set",
        holes=len(gaps),
        longest_hole_s=float(gaps.max(initial=0)),
        looked_at=len(inspected),
        points=int(np.median([scan.points for scan in full])),
        range_m=_ranges(full),
        fields=full[0].fields,
        rings=rings,
        rings_from=rings_from,
        point_times=_times(data, inspected),
        sensor=data.sensor.name if data.sensor else None,
        looks_like=looks_like,
        vertical_correction_deg=float(np.rad2deg(data.sensor.vertical_correction)) if data.sensor else 0.0,
        motion_compensated=bool(data.sensor and data.sensor.motion_compensated),
        images=sum(image is not None for image in getattr(data, "images", ())),
        image_size=next((scan.image_size for scan in inspected if scan.image_size), None),
        calibrated=data.calibration is not None,
        truth=truth,
        positions_only=data.ground_truth is None and positions is not None,
        truth_m=truth_m,
        topics=topics_of(data),
        cameras=max((scan.cameras for scan in inspected), default=0),
        problems=_kinds([*data.problems, *(problem for scan in inspected for problem in scan.problems)]),
        commands=_commands(path, {"sequence": sequence, "sensor": sensor or looks_like, **options}, rings),
    )


@dataclass(frozen=True, eq=False)
class _ScanInfo:
    """Properties of one scan.

    Attributes:
        points: Number of points.
        ranges: Ranges [m] at the 1st, 50th and 99th percentile.
        timed: Whether the points have times.
        fields: Fields of the file.
        ring_field: Whether one of them is the ring.
        elevations: Median elevation [deg] of each ring, top first.
        image_size: Width and height of the image, None without one.
        cameras: Number of calibrated cameras.
        problems: Problems of the scan.
    """

    points: int
    ranges: Array
    timed: bool
    fields: tuple[str, ...]
    ring_field: bool
    elevations: Array
    image_size: tuple[int, int] | None
    cameras: int
    problems: tuple[Problem, ...]


def _inspect_scan(data: Dataset, position: int) -> _ScanInfo:
    """Read a scan, and return its properties."""
    from slam.data.images import found_in_reading

    frame = data[position]
    cloud, image = frame.cloud, frame.image
    range_ = np.linalg.norm(cloud.xyz, axis=1)
    raw = data.points(position) if hasattr(data, "points") else None
    return _ScanInfo(
        points=len(cloud),
        ranges=np.percentile(range_, [1, 50, 99]) if len(cloud) else np.zeros(3),
        timed=cloud.time is not None,
        fields=_fields(raw) if raw else (),
        ring_field=raw is not None and raw.ring is not None,
        elevations=_elevations(cloud),
        image_size=None if image is None else (image.shape[1], image.shape[0]),
        cameras=len(frame.views),
        problems=(*frame.problems, *found_in_reading(frame)),
    )


def _fields(points: Points) -> tuple[str, ...]:
    """The fields of a file, each with its type and range of values."""
    columns = {"intensity": points.intensity, "ring": points.ring, **points.times}
    found = [_field(name, values) for name, values in columns.items() if values is not None and len(values)]
    return ("x y z", *found, *(["colour"] if points.colour is not None else []))


def _field(name: str, values: Array) -> str:
    """Name, type and range of values of a field."""
    digits = 4 if values.dtype.kind == "f" and np.nanmax(np.abs(values)) < 1e4 else 16  # all digits of clock times
    return f"{name} ({values.dtype}, {np.nanmin(values):.{digits}g} to {np.nanmax(values):.{digits}g})"


def _elevations(cloud: PointCloud) -> Array:
    """Median elevation (R,) [deg] of each ring with points, top first."""
    if cloud.ring is None:
        return np.zeros(0)
    elevation = np.rad2deg(np.arctan2(cloud.xyz[:, 2], np.hypot(cloud.xyz[:, 0], cloud.xyz[:, 1])))
    return np.array([np.median(elevation[cloud.ring == ring]) for ring in np.unique(cloud.ring)])


def _looks_like(elevations: Array) -> str | None:
    """The built-in LiDAR whose lines match the rings, None if none does."""
    from slam.data.sensor_names import SENSORS

    for name in SENSORS.names():
        lines = np.rad2deg(SENSORS.load(name)().elevation)
        if len(lines) == len(elevations) and np.median(np.abs(lines - elevations)) < MAX_DIFFERENCE:
            return name
    return None


def _rings(data: Dataset, inspected: Sequence[_ScanInfo]) -> tuple[int | None, str]:
    """Number of rings with returns, and the source of the ring indices."""
    count = max(len(scan.elevations) for scan in inspected)
    if not count:
        return None, "unknown: to drop rings or to enrich, name the LiDAR with --sensor"
    named = f"from the lasers of {data.sensor.name}" if data.sensor else "of the data set"
    return count, "from the field ring" if inspected[0].ring_field else named


def _times(data: Dataset, inspected: Sequence[_ScanInfo]) -> str:
    """How the points' times are interpreted."""
    verdict, timed = getattr(data, "point_times", None), sum(scan.timed for scan in inspected)
    if verdict is None:
        return f"in {timed} of {len(inspected)} scans"
    return str(verdict.verdict(timed, len(inspected))).removeprefix("point times: ")


def _ranges(inspected: Sequence[_ScanInfo]) -> tuple[float, float, float]:
    """Median over the scans of the near, median and far range [m]."""
    near, middle, far = np.median([scan.ranges for scan in inspected], axis=0)
    return float(near), float(middle), float(far)


def _truth(positions: Array | None) -> tuple[int, float]:
    """Number of known positions (N, 3), and the travelled distance [m] between successive ones."""
    if positions is None:
        return 0, 0.0
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    return int(np.isfinite(positions[:, 0]).sum()), float(np.nansum(steps))


def _kinds(problems: Sequence[Problem]) -> tuple[tuple[str, int, str], ...]:
    """The kinds of the problems, each with its count and first message."""
    kinds: dict[str, list[str]] = {}
    for problem in problems:
        kinds.setdefault(problem.kind, []).append(problem.message)
    return tuple((kind, len(messages), messages[0]) for kind, messages in kinds.items())


def _commands(path: str | Path, options: Mapping[str, object], rings: int | None) -> tuple[str, ...]:
    """Commands to run SLAM, and to enrich or compare where the rings allow it."""
    given = {name.replace("_", "-"): shlex.quote(str(value)) for name, value in options.items() if value}
    arguments = " ".join([shlex.quote(str(path)), *(f"--{name} {value}" for name, value in given.items())])
    commands = [f"lidarlift run {arguments}"]
    if rings is not None and rings <= MAX_SPARSE_RINGS:
        commands.append(f"lidarlift run {arguments} --input enriched")
    elif rings == DENSE_RINGS:
        commands.append(f"lidarlift compare {arguments}")
    return tuple(commands)
