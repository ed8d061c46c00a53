"""What of a recorded scan is measured input: all of its rings, or sixteen of them."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from slam.data.cloud import Array, Frame, History, PointCloud
from slam.data.errors import InputError
from slam.data.ring_patterns import drop_rings, kept_lines
from slam.data.sensor import Sensor
from slam.settings import FrontEndSettings


class FrontEnd(Protocol):
    """Makes the cloud that is registered, in the sensor's own geometry: before deskewing and vertical correction.

    It may keep what it learns from the scans, so each run has one of its own.
    """

    def __call__(self, frame: Frame, history: History) -> PointCloud: ...


class RingFrontEnd:
    """The scan as recorded (input 64), or with the rings dropped that a 16-channel sensor would not have (input 16).

    The scan of a sensor that has 16 rings or fewer is taken as it is; so is, where it is to be enriched, that of any
    sensor but one of 64. Raises InputError where else a sensor has not 64 rings: the patterns are made for these.
    """

    def __init__(self, settings: FrontEndSettings, sensor: Sensor | None = None) -> None:
        self.settings, self.sensor = settings, sensor
        rings = 64 if sensor is None else sensor.ring_count
        sparse = rings <= 16 or (settings.input == "enriched" and rings != 64)
        self.as_recorded = settings.input == "64" or sparse
        if not self.as_recorded and sensor is not None and rings != 64:
            raise InputError(f"rings are dropped from 64, and {sensor.name} has {sensor.ring_count}; use --input 64")

    def lines(self) -> tuple[Sensor, Array]:
        """The line of every ring id that it gives, and the ids that there are (K,), top first. The sensor is known."""
        assert self.sensor is not None
        if self.as_recorded:
            return self.sensor, np.arange(self.sensor.ring_count)
        return kept_lines(self.sensor, self.settings.drop, self.settings.phase)

    def __call__(self, frame: Frame, history: History) -> PointCloud:
        del history  # nothing is filled in here
        if self.as_recorded or len(frame.cloud) == 0:
            return frame.cloud
        if frame.cloud.ring is None and self.sensor is not None:  # a damaged scan among sound ones: nothing to keep
            return frame.cloud.select(np.zeros(len(frame.cloud), bool))
        return drop_rings(frame.cloud, self.settings.drop, self.settings.phase, self.sensor)
