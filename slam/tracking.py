"""Tracking: front end and odometry, frame by frame."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, replace
from typing import Any, Protocol

from slam.cell_sizes import Sizes
from slam.data import se3
from slam.data.cloud import HISTORY, Array, Frame, History, PointCloud
from slam.data.errors import InputError
from slam.front_end import AdaptiveFrontEnd, FrontEnd
from slam.odometry import OdometryStep


class PoseSource(Protocol):
    """Source of the pose of each scan: `Odometry`, or `RecordedSteps` with poses from a file."""

    @property
    def sizes(self) -> Sizes | None:
        """Cell and voxel sizes; None before the first scan."""
        ...

    def predict(self, stamp: float) -> Array:
        """Return the predicted pose (4, 4) at `stamp` [s]."""
        ...

    def register(self, cloud: PointCloud, stamp: float) -> OdometryStep:
        """Register the next scan, with points as recorded, at `stamp` [s]."""
        ...

    def settle(self) -> tuple[OdometryStep, ...]:
        """End the beginning; return the revised steps in place of the provisional ones."""
        ...


@dataclass(frozen=True, eq=False)
class Tracked:
    """A frame with its pose.

    Attributes:
        cloud: The front end's cloud, as recorded.
        step: The odometry's result.
        timed: Whether the cloud had times and could be deskewed.
        milliseconds: Time [ms] of the stages 'front_end' and 'odometry'.
    """

    cloud: PointCloud
    step: OdometryStep
    timed: bool
    milliseconds: dict[str, float]


class Tracker:
    """Passes each frame to the front end, with the last clouds in the predicted frame, and the cloud to the odometry.

    Args:
        front_end: Makes the cloud that is registered.
        odometry: Source of the poses.
        deskew: True: deskew, and require times in every scan; False: do not deskew; None: deskew scans with times.
    """

    def __init__(self, front_end: FrontEnd, odometry: PoseSource, deskew: bool | None = None) -> None:
        self._front_end, self._odometry, self._deskew = front_end, odometry, deskew
        self._recent: deque[tuple[PointCloud, Array]] = deque(maxlen=HISTORY)

    def __call__(self, frame: Frame) -> Tracked:
        """Track the next frame.

        Raises:
            InputError: Deskewing is required and the points have no times.
        """
        begin = time.perf_counter()
        cloud = self._front_end(frame, self._history(frame.stamp))
        between = time.perf_counter()
        scan = self._with_times(cloud, frame)
        step = self._odometry.register(scan, frame.stamp)
        end = time.perf_counter()
        self._recent.append((cloud, step.pose))
        self._revise(step.revised)
        laps = {"front_end": 1e3 * (between - begin), "odometry": 1e3 * (end - between)}
        return Tracked(cloud, step, scan.time is not None, laps)

    @property
    def sizes(self) -> Sizes | None:
        """Cell and voxel sizes of the odometry; None before the first scan and for recorded poses."""
        return self._odometry.sizes

    def settle(self) -> tuple[OdometryStep, ...]:
        """End the beginning, as `Odometry.settle` does: no further scan follows."""
        return self._odometry.settle()

    def release(self) -> None:
        """Free the local map, the front end and the last clouds; no further scan follows."""
        del self._odometry, self._front_end
        self._recent.clear()

    def state(self) -> dict[str, Any]:
        """Return what later results depend on, for `restore`."""
        front_end = self._front_end.state() if isinstance(self._front_end, AdaptiveFrontEnd) else None
        return {"front_end": front_end, "odometry": self._odometry, "recent": self._recent}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from the state of another tracker with the same settings."""
        if isinstance(self._front_end, AdaptiveFrontEnd):
            self._front_end.restore(state["front_end"])
        self._odometry, self._recent = state["odometry"], state["recent"]

    def _revise(self, steps: tuple[OdometryStep, ...]) -> None:
        """Replace the poses of the history, except that of the last cloud, by the revised ones."""
        for back, step in enumerate(reversed(steps), start=2):
            if back <= len(self._recent):
                self._recent[-back] = self._recent[-back][0], step.pose

    def _history(self, stamp: float) -> History:
        """The last clouds, each with its T_now_then for the predicted pose at `stamp`."""
        now_world = se3.inverse(self._odometry.predict(stamp))
        return [(then, now_world @ pose) for then, pose in self._recent]

    def _with_times(self, cloud: PointCloud, frame: Frame) -> PointCloud:
        """The cloud with or without times, as `deskew` requires."""
        if self._deskew is False:
            return replace(cloud, time=None)
        if self._deskew and cloud.time is None and len(cloud):
            raise InputError(
                f"frame {frame.index}: the points have no times, so deskewing is impossible; omit front_end.deskew"
            )
        return cloud
