"""Gathering: registered scans become keyframes, with the motion from one to the next."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from slam.data import se3
from slam.data.camera import with_colours
from slam.data.cloud import Array, Frame, PointCloud
from slam.data.growing import Growing
from slam.mapping.keyframes import Keyframe, Keyframes
from slam.odometry import OdometryStep
from slam.segments import GAP_COVARIANCE, SEGMENT_DISTANCE
from slam.settings import Config, PoseGraphSettings

MIN_TRAVELLED = 0.5  # m, lower bound of the distance in the drift model: a vehicle may turn on the spot
STATE = ("milliseconds", "_travelled", "_last", "_covariance", "_motion", "_lost")  # attributes in a snapshot


@dataclass(frozen=True, eq=False)
class Completed:
    """A complete keyframe, the last one so far.

    Attributes:
        count: Number of keyframes so far.
        motion: Its pose (4, 4) in the frame of the keyframe before, and the covariance (6, 6); None without one.
        radius: Travelled distance [m] behind it at which a keyframe can be searched for loops: its submap is complete.
    """

    count: int
    motion: tuple[Array, Array] | None
    radius: float


class Gatherer:
    """Gathers registered scans into keyframes.

    Args:
        config: The settings.
        keyframes: Receives the keyframes.

    Attributes:
        milliseconds: Run time per scan.
    """

    def __init__(self, config: Config, keyframes: Keyframes) -> None:
        self.config, self.keyframes = config, keyframes
        self.milliseconds = Growing()
        self._travelled, self._last = 0.0, np.zeros(3)
        self._covariance = np.zeros((6, 6))  # sum of the registration covariances since the last keyframe
        self._motion: tuple[Array, Array] | None = None  # of the keyframe that is not complete, since the one before
        self._lost = False  # whether the next keyframe begins a segment

    def add(self, position: int, frame: Frame, recorded: PointCloud, step: OdometryStep) -> list[Completed]:
        """Add the next scan, with arguments as in `Mapper.add`; return the keyframes that are complete with it."""
        begin = time.perf_counter()
        self._travelled += float(np.linalg.norm(step.pose[:3, 3] - self._last))
        self._last = step.pose[:3, 3]
        self._covariance = self._covariance + step.covariance
        completed = self._end_segment() if step.restarted else []
        if step.status == "failed":
            return completed
        begins = self.keyframes.begins(step.pose)
        cloud = _coloured(step.cloud, recorded, frame) if begins and self.config.map.colour else step.cloud
        if self.keyframes.add(cloud, step.pose, position, self._travelled) is not None:
            completed.append(self._completed())
        if begins:
            self._motion = self._motion_since(self.keyframes[-1], step.pose) if len(self.keyframes) else None
            self._covariance, self._lost = np.zeros((6, 6)), False
        self.milliseconds.append(1e3 * (time.perf_counter() - begin))
        return completed

    def finish(self) -> Completed:
        """Complete the last keyframe; no scan follows."""
        self.keyframes.finish()
        return replace(self._completed(), radius=0.0)

    def state(self) -> dict[str, Any]:
        """Return what later results depend on, for `restore`."""
        return {name: getattr(self, name) for name in STATE} | {"keyframes": self.keyframes.state()}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from the state of another one with the same settings."""
        for name in STATE:
            setattr(self, name, state[name])
        self.keyframes.restore(state["keyframes"])

    def _completed(self) -> Completed:
        return Completed(len(self.keyframes), self._motion, self.config.loops.verification.query_submap_radius)

    def _end_segment(self) -> list[Completed]:
        """Complete the current keyframe; the next one begins a new segment at an unknown place."""
        completed = [self._completed()] if self.keyframes.finish() is not None else []
        self._motion = None
        self._travelled += SEGMENT_DISTANCE
        self._lost = True
        return completed

    def _motion_since(self, before: Keyframe, pose: Array) -> tuple[Array, Array]:
        """Motion (4, 4) to `pose` since a keyframe, and its covariance (6, 6): registration plus drift."""
        distance = max(self._travelled - before.travelled, MIN_TRAVELLED)
        drift = GAP_COVARIANCE if self._lost else distance * drift_per_metre(self.config.pose_graph)
        return se3.normalized(se3.inverse(before.pose) @ pose), self._covariance + drift


def drift_per_metre(settings: PoseGraphSettings) -> Array:
    """Return the covariance (6, 6) that the odometry's drift adds per metre of travelled distance."""
    sigma = np.array([np.deg2rad(settings.rotation_drift_deg)] * 3 + [settings.translation_drift] * 3)
    return np.diag(sigma**2)


def _coloured(cloud: PointCloud, recorded: PointCloud, frame: Frame) -> PointCloud:
    """The registered cloud with the colours that the cameras saw; images are projected on the points as recorded."""
    colour = with_colours(recorded, frame.views).colour
    return cloud if colour is None else replace(cloud, colour=colour)
