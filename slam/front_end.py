"""Input selection: the full scan, or a subset of its rings."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np

from slam.data.cloud import Array, Frame, History, PointCloud
from slam.data.ring_patterns import KEPT, drop_rings, kept_lines
from slam.data.scan_rings import usual_rings
from slam.data.sensor import Sensor
from slam.settings import FrontEndSettings


class FrontEnd(Protocol):
    """Converts a frame into the cloud that is registered, in sensor geometry: before deskewing and vertical correction.

    A front end may adapt to the scans it receives, so each run needs its own; such a front end is an
    `AdaptiveFrontEnd`, or a run that is resumed would differ from one that was not stopped.
    """

    def __call__(self, frame: Frame, history: History) -> PointCloud:
        """Return the cloud of a frame; `history` holds the clouds of earlier frames with their relative poses."""
        ...


@runtime_checkable
class AdaptiveFrontEnd(Protocol):
    """A front end whose results depend on earlier scans."""

    def state(self) -> Any:
        """Return what it learned: numbers, texts, arrays, lists, tuples and dicts."""
        ...

    def restore(self, state: Any) -> None:
        """Continue from the state of another one with the same settings."""
        ...


class RingFrontEnd:
    """Returns the scan as recorded (inputs full and 64), or some of its rings.

    Input N keeps N rings. Input enriched keeps `enriched_rings`, by default 16 of 64 and all of any other number. A
    scan that has no more rings than that is returned unchanged.

    Args:
        settings: Settings of the front end.
        sensor: The LiDAR, None if unknown.
        rings: Number of rings of the LiDAR, if known without the sensor; None: counted in the first scan with rings.

    Raises:
        InputError: The pattern of dropped rings is defined for another number of rings.
    """

    def __init__(self, settings: FrontEndSettings, sensor: Sensor | None = None, rings: int | None = None) -> None:
        self.settings, self.sensor = settings, sensor
        self.rings = rings if sensor is None else sensor.ring_count
        if self.rings is not None and self.kept is not None:
            self._dropped(PointCloud(np.zeros((0, 3)), np.zeros(0), np.zeros(0)))  # reports a wrong pattern at once

    @property
    def kept(self) -> int | None:
        """Number of rings that are kept, None if the scan is returned as recorded."""
        settings, rings = self.settings, self.rings or 64
        if settings.input == "enriched":
            wanted = settings.enriched_rings or (KEPT if rings == 64 else rings)
        else:
            wanted = rings if settings.input in ("full", "64") else int(settings.input)
        return None if wanted >= rings else wanted

    def lines(self) -> tuple[Sensor, Array]:
        """Return the laser lines by ring index, and the indices (K,) that are kept, top first; needs a known sensor."""
        assert self.sensor is not None
        if self.kept is None:
            return self.sensor, np.arange(self.sensor.ring_count)
        return kept_lines(self.sensor, self.settings.ring_selection, self.settings.phase, self.kept)

    def state(self) -> int | None:
        """Return the number of rings, which may be counted."""
        return self.rings

    def restore(self, state: int | None) -> None:
        """Continue with a number of rings."""
        self.rings = state

    def __call__(self, frame: Frame, history: History) -> PointCloud:
        """Return the cloud of a frame, with the rings that are kept."""
        del history  # only enrichment uses it
        if self.rings is None and frame.cloud.ring is not None and len(frame.cloud):
            self.rings = usual_rings(int(frame.cloud.ring.max()))
        if self.kept is None or len(frame.cloud) == 0:
            return frame.cloud
        if frame.cloud.ring is None and self.sensor is not None:  # a damaged scan without rings: drop all points
            return frame.cloud.select(np.zeros(len(frame.cloud), bool))
        return self._dropped(frame.cloud)

    def _dropped(self, cloud: PointCloud) -> PointCloud:
        assert self.kept is not None
        settings = self.settings
        return drop_rings(cloud, settings.ring_selection, settings.phase, self.sensor, self.rings or 64, self.kept)
