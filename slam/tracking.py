"""Front end and odometry, frame by frame: what is known of a frame at once."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, replace
from typing import Protocol

from slam.data import se3
from slam.data.cloud import HISTORY, Array, Frame, History, PointCloud
from slam.data.errors import InputError
from slam.front_end import FrontEnd
from slam.odometry import OdometryStep


class PoseSource(Protocol):
    """Poses scan by scan: our `Odometry`, or `RecordedSteps`, which has them from a file."""

    def predict(self, stamp: float) -> Array: ...
    def register(self, cloud: PointCloud, stamp: float) -> OdometryStep: ...
    def settle(self) -> tuple[OdometryStep, ...]: ...


@dataclass(frozen=True, eq=False)
class Tracked:
    """A frame whose pose is known.

    Attributes:
        cloud: What the front end made of the frame, as recorded.
        step: The odometry's answer.
        timed: Whether the cloud had times to be deskewed by.
        milliseconds: Of the stages 'front_end' and 'odometry'.
    """

    cloud: PointCloud
    step: OdometryStep
    timed: bool
    milliseconds: dict[str, float]


class Tracker:
    """Hands each frame to the front end, with the past as the odometry places it, and the cloud to the odometry.

    Args:
        front_end: Makes the cloud that is registered.
        odometry: Gives the poses.
        deskew: False: points are taken without their times; True: every scan has to have them; None: where they are.
    """

    def __init__(self, front_end: FrontEnd, odometry: PoseSource, deskew: bool | None = None) -> None:
        self._front_end, self._odometry, self._deskew = front_end, odometry, deskew
        self._past: deque[tuple[PointCloud, Array]] = deque(maxlen=HISTORY)

    def __call__(self, frame: Frame) -> Tracked:
        """Track the next frame. Raises InputError where deskewing was asked for and its points have no times."""
        begin = time.perf_counter()
        cloud = self._front_end(frame, self._history(frame.stamp))
        between = time.perf_counter()
        scan = self._with_times(cloud, frame)
        step = self._odometry.register(scan, frame.stamp)
        end = time.perf_counter()
        self._past.append((cloud, step.pose))
        self._revise(step.revised)
        laps = {"front_end": 1e3 * (between - begin), "odometry": 1e3 * (end - between)}
        return Tracked(cloud, step, scan.time is not None, laps)

    def settle(self) -> tuple[OdometryStep, ...]:
        """See `Odometry.settle`: no scan follows that could put the first poses right."""
        return self._odometry.settle()

    def _revise(self, steps: tuple[OdometryStep, ...]) -> None:
        """The poses of the past clouds before the last one, as they are now known to be."""
        for back, step in enumerate(reversed(steps), start=2):
            if back <= len(self._past):
                self._past[-back] = self._past[-back][0], step.pose

    def _history(self, stamp: float) -> History:
        """The past clouds, each with T_now_then, as the odometry predicts the pose at `stamp`."""
        now_world = se3.inverse(self._odometry.predict(stamp))
        return [(then, now_world @ pose) for then, pose in self._past]

    def _with_times(self, cloud: PointCloud, frame: Frame) -> PointCloud:
        if self._deskew is False:
            return replace(cloud, time=None)
        if self._deskew and cloud.time is None and len(cloud):
            raise InputError(f"frame {frame.index}: its points have no times to deskew by; leave front_end.deskew out")
        return cloud
