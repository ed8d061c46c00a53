"""Input selection: the full scan, or a subset of 16 rings."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from slam.data.cloud import Array, Frame, History, PointCloud
from slam.data.errors import InputError
from slam.data.ring_patterns import drop_rings, kept_lines
from slam.data.sensor import Sensor
from slam.settings import FrontEndSettings


class FrontEnd(Protocol):
    """Converts a frame into the cloud that is registered, in sensor geometry: before deskewing and vertical correction.

    A front end may adapt to the scans it receives, so each run needs its own.
    """

    def __call__(self, frame: Frame, history: History) -> PointCloud:
        """Return the cloud of a frame; `history` holds the clouds of earlier frames with their relative poses."""
        ...


class RingFrontEnd:
    """Returns the scan as recorded (input 64), or 16 of its 64 rings (inputs 16 and enriched).

    The scan of a sensor with 16 rings or fewer is returned unchanged, and for input enriched that of every sensor
    without 64 rings.

    Args:
        settings: Settings of the front end.
        sensor: The LiDAR, None if unknown.

    Raises:
        InputError: Rings would be dropped from a sensor that does not have 64: the patterns are defined for 64.
    """

    def __init__(self, settings: FrontEndSettings, sensor: Sensor | None = None) -> None:
        self.settings, self.sensor = settings, sensor
        rings = 64 if sensor is None else sensor.ring_count
        sparse = rings <= 16 or (settings.input == "enriched" and rings != 64)
        self.as_recorded = settings.input == "64" or sparse
        if not self.as_recorded and sensor is not None and rings != 64:
            raise InputError(
                f"rings can be dropped from 64-ring sensors only, and {sensor.name} has {sensor.ring_count}; "
                "use --input 64"
            )

    def lines(self) -> tuple[Sensor, Array]:
        """Return the laser lines by ring index, and the indices (K,) that are kept, top first; needs a known sensor."""
        assert self.sensor is not None
        if self.as_recorded:
            return self.sensor, np.arange(self.sensor.ring_count)
        return kept_lines(self.sensor, self.settings.drop, self.settings.phase)

    def __call__(self, frame: Frame, history: History) -> PointCloud:
        """Return the cloud of a frame, with the rings that are kept."""
        del history  # only enrichment uses it
        if self.as_recorded or len(frame.cloud) == 0:
            return frame.cloud
        if frame.cloud.ring is None and self.sensor is not None:  # a damaged scan without rings: drop all points
            return frame.cloud.select(np.zeros(len(frame.cloud), bool))
        return drop_rings(frame.cloud, self.settings.drop, self.settings.phase, self.sensor)
