"""What of a recorded scan is measured input: all of its rings, or sixteen of them."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from slam.data.cloud import Array, Frame, History, PointCloud
from slam.data.ring_patterns import KEPT, drop_rings, kept_lines
from slam.data.scan_columns import usual_rings
from slam.data.sensor import Sensor
from slam.settings import FrontEndSettings


class FrontEnd(Protocol):
    """Makes the cloud that is registered, in the sensor's own geometry: before deskewing and vertical correction.

    It may keep what it learns from the scans, so each run has one of its own.
    """

    def __call__(self, frame: Frame, history: History) -> PointCloud: ...


class RingFrontEnd:
    """The scan as recorded (input full, or 64), or with the rings dropped that a 16-channel sensor would not have
    (input 16).

    The scan of a sensor that has 16 rings or fewer is taken as it is; so is, where it is to be enriched, that of any
    sensor but one of 64.

    Args:
        settings: What is asked for.
        sensor: The LiDAR, None where it is unknown.
        rings: How many rings it has, where that is known without it; else the first scan with rings tells.

    Raises:
        InputError: The pattern of what is dropped is made for another number of rings.
    """

    def __init__(self, settings: FrontEndSettings, sensor: Sensor | None = None, rings: int | None = None) -> None:
        self.settings, self.sensor = settings, sensor
        self.rings = rings if sensor is None else sensor.ring_count
        if self.rings is not None and not self.as_recorded:
            self._dropped(PointCloud(np.zeros((0, 3)), np.zeros(0), np.zeros(0)))  # refuses what cannot be done

    @property
    def as_recorded(self) -> bool:
        """Whether all rings stay: they are asked for, or there are no more than are kept."""
        if self.settings.input in ("full", "64"):
            return True
        rings = self.rings or 64
        return rings <= KEPT or (self.settings.input == "enriched" and rings != 64)

    def lines(self) -> tuple[Sensor, Array]:
        """The line of every ring id that it gives, and the ids that there are (K,), top first. The sensor is known."""
        assert self.sensor is not None
        if self.as_recorded:
            return self.sensor, np.arange(self.sensor.ring_count)
        return kept_lines(self.sensor, self.settings.drop, self.settings.phase)

    def __call__(self, frame: Frame, history: History) -> PointCloud:
        del history  # nothing is filled in here
        if self.rings is None and frame.cloud.ring is not None and len(frame.cloud):
            self.rings = usual_rings(int(frame.cloud.ring.max()))
        if self.as_recorded or len(frame.cloud) == 0:
            return frame.cloud
        if frame.cloud.ring is None and self.sensor is not None:  # a damaged scan among sound ones: nothing to keep
            return frame.cloud.select(np.zeros(len(frame.cloud), bool))
        return self._dropped(frame.cloud)

    def _dropped(self, cloud: PointCloud) -> PointCloud:
        return drop_rings(cloud, self.settings.drop, self.settings.phase, self.sensor, self.rings or 64)
