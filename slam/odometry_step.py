"""The odometry's result for one scan."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from slam.data.cloud import Array, PointCloud
from slam.data.distortion import Correction
from slam.registration.result import RegistrationResult


@dataclass(frozen=True, eq=False)
class OdometryStep:
    """The odometry's result for one scan.

    Attributes:
        pose: T_world_lidar (4, 4); the world is the first scan's frame.
        covariance: Covariance (6, 6) of the motion since the last scan: of pose @ exp(xi), with xi = (rotation,
            translation).
        status: 'registered'; 'retried': registered after a search around the prediction; 'degenerate': the scan does
            not constrain the pose along `unobserved`, where the prediction was kept; 'failed': the prediction was kept.
        registration: Registration of the scan against the map; None for the first scan and for too few points.
        recorded: The scan as recorded.
        correction: Correction of the scan's distortion.
        unobserved: Unit vectors (K, 6) (rotation, translation) in the sensor's axes; empty unless degenerate.
        velocity: Velocity (6,) [rad/s, m/s] in the sensor's axes, since the last scan; 0 while it is unknown.
        provisional: The pose may still be revised, at the beginning of a sequence.
        restarted: The local map was restarted at this scan, whose pose is the prediction: a new segment begins.
        revised: The revised steps of the provisional scans, oldest first, at the end of the beginning.
    """

    pose: Array
    covariance: Array
    status: Literal["registered", "retried", "degenerate", "failed"]
    registration: RegistrationResult | None
    recorded: PointCloud
    correction: Correction = field(default_factory=Correction)
    unobserved: Array = field(default_factory=lambda: np.zeros((0, 6)))
    velocity: Array = field(default_factory=lambda: np.zeros(6))
    provisional: bool = False
    restarted: bool = False
    revised: tuple[OdometryStep, ...] = ()

    @cached_property
    def cloud(self) -> PointCloud:
        """The scan deskewed and vertically corrected, in the sensor's frame."""
        return self.correction.cloud(self.recorded)
