"""Small recordings: ten sweeps of a LiDAR of 16 lines, and whatever a test adds, in any of the forms."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slam.data.recordings.writer import FORMS, RecordingWriter, recording_writer
from slam.simulation.drivers import DRIVERS, Timing
from slam.simulation.lidar import Scan

SCANS, RINGS, COLUMNS, EPOCH = 10, 16, 60, 1_700_000_000
Array = Any
#: Time of recording [s] since EPOCH, and what writes a message then.
Event = tuple[float, Callable[[RecordingWriter, int], None]]


def nanoseconds(seconds: float) -> int:
    return EPOCH * 10**9 + round(seconds * 1e9)


def sweep(number: int) -> Scan:
    """From the rear over the left; 16 rings from 15 to -15 deg, in a room of 20 x 12 m; others in each sweep."""
    ring, column = (grid.ravel() for grid in np.mgrid[:RINGS, :COLUMNS])
    fraction = (column + 0.5) / COLUMNS
    azimuth = np.pi - 2 * np.pi * fraction
    reach = np.minimum(10 / np.maximum(np.abs(np.cos(azimuth)), 1e-6), 6 / np.maximum(np.abs(np.sin(azimuth)), 1e-6))
    slope = np.tan(np.deg2rad(15 - 2.0 * ring))
    xyz = np.column_stack([reach * np.cos(azimuth) + 0.1 * number, reach * np.sin(azimuth), reach * slope])
    keep = (ring + column) % 7 != 0  # some see nothing
    shade = np.round((0.1 + 0.8 * column / COLUMNS), 2)
    return Scan(
        *(values[keep].astype(kind) for values, kind in ((xyz, "f4"), (shade, "f4"), (ring, "u2"), (fraction, "f4")))
    )


def clouds(
    driver: str = "velodyne", *, topic: str | None = None, ahead: float = 0.0, count: int = SCANS
) -> list[Event]:
    """Ten scans a second, recorded when they are complete, or `ahead` of their stamps [s] where that is not 0."""
    chosen = DRIVERS[driver]
    instant = {"start": 0.0, "end": 1.0}[chosen.stamp]

    def event(number: int) -> Event:
        begin = EPOCH + 0.1 * number
        points = chosen.fill(sweep(number), Timing(begin, instant, 0.1, RINGS, COLUMNS))
        stamp = nanoseconds(0.1 * number + 0.1 * instant)

        def write(writer: RecordingWriter, recorded: int) -> None:
            make = writer.livox if driver == "livox" else writer.cloud
            writer.write(topic or chosen.topic, recorded, make(stamp, chosen.frame, points))

        return 0.1 * number + 0.105 + ahead, write

    return [event(number) for number in range(count)]


def mounting(found: dict[tuple[str, str], Array], topic: str = "/tf_static") -> list[Event]:
    return [(0.0, lambda writer, recorded: writer.write(topic, recorded, writer.transforms(found)))]


@pytest.fixture
def record(tmp_path: Path) -> Callable[..., Path]:
    """`record(events, "mcap")` writes a recording and returns its file."""

    def write(events: list[Event], form: str = "bag", name: str = "drive") -> Path:
        with recording_writer(tmp_path / name, form) as writer:
            for at, event in sorted(events, key=lambda event: event[0]):
                event(writer, nanoseconds(at))
        return tmp_path / f"{name}{FORMS[form]}"

    return write
