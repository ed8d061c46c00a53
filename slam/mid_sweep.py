"""Poses at the scans' stamps, from scans that are registered where they are surest: in the middle of their points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slam.cell_sizes import Sizes
from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.odometry import Odometry, OdometryStep

OUTER = 1.0  # percent of a scan's points that are earlier, and later, than those that its middle is reckoned from
AT_MIDDLE = 0.05  # of what they span: a stamp so near to the middle is there


class MidSweepOdometry:
    """An odometry for stamps of any instant of the sweep.

    Scans are deskewed to, and registered at, the middle of their sweep; each pose is moved from there to its stamp by
    the velocity that was then found. Were they deskewed to the start of the sweep by the velocity that is predicted,
    its error would go into the pose, and from there with the other sign into the next velocity, on and on undiminished.

    The world is the first scan's frame at its stamp, but how fast the sensor was there shows only with the second scan:
    until then the first step is provisional, unless its stamp is of the middle.
    """

    def __init__(self, odometry: Odometry) -> None:
        self._odometry = odometry
        self._middle: float | None = None  # s from the stamps, once a scan has had times
        self._first: OdometryStep | None = None  # of the middle, while it waits
        self._T_world_middle: Array | None = None  # of the first scan
        self._velocity = np.zeros(6)

    @property
    def sizes(self) -> Sizes | None:
        """Of cells and thinning, once the first scan has told them."""
        return self._odometry.sizes

    def predict(self, stamp: float) -> Array:
        """Pose (4, 4) at `stamp` if the velocity has stayed as it was at the last registered scan."""
        middle = self._middle or 0.0
        pose = self._odometry.predict(stamp + middle)
        if not middle or self._T_world_middle is None:
            return pose
        return np.asarray(self._T_world_middle @ pose @ se3.exp(-middle * self._velocity))

    def register(self, cloud: PointCloud, stamp: float) -> OdometryStep:
        """Pose of the next scan at its `stamp` [s]: points as recorded, their times from there."""
        if self._middle is None and cloud.time is not None and len(cloud):
            self._middle = middle_of(cloud.time)
        if not self._middle:
            return self._odometry.register(cloud, stamp)
        if cloud.time is not None:
            cloud = replace(cloud, time=cloud.time - np.float32(self._middle))
        step = self._odometry.register(cloud, stamp + self._middle)
        self._velocity = step.velocity
        if self._T_world_middle is not None:
            return self._moved(step, self._T_world_middle)
        if self._first is None:
            self._first = step
            return replace(step, provisional=True)
        if step.provisional:
            return self._moved(step, se3.exp(self._middle * step.velocity))
        *earlier, last = self._begun((self._first, *step.revised, step))
        return replace(last, revised=tuple(earlier))

    def settle(self) -> tuple[OdometryStep, ...]:
        """End the beginning: the steps that were provisional, as they are now known to be."""
        steps = self._odometry.settle()
        if self._first is None or self._T_world_middle is not None:
            return steps
        return self._begun((self._first, *steps))

    def _begun(self, steps: Sequence[OdometryStep]) -> tuple[OdometryStep, ...]:
        """The drive's first steps at their stamps; the very first moved as the second has it."""
        first, *later = steps
        velocity = later[0].velocity if later else first.velocity
        self._T_world_middle = se3.exp((self._middle or 0.0) * velocity)
        steps = (replace(first, velocity=velocity), *later)
        begin, *others = (self._moved(step, self._T_world_middle) for step in steps)
        return (replace(begin, pose=first.pose), *others)  # the identity, to the last bit

    def _moved(self, step: OdometryStep, T_world_middle: Array) -> OdometryStep:
        """A step from the middle of its sweep to its stamp."""
        T_middle_stamp = se3.exp(-(self._middle or 0.0) * step.velocity)
        T_stamp_middle = se3.inverse(T_middle_stamp)
        adjoint = se3.adjoint(T_stamp_middle)
        return replace(
            step,
            pose=T_world_middle @ step.pose @ T_middle_stamp,
            covariance=adjoint @ step.covariance @ adjoint.T,
            cloud=step.cloud.transformed(T_stamp_middle),
            unobserved=(step.unobserved.reshape(-1, 2, 3) @ T_stamp_middle[:3, :3].T).reshape(-1, 6),
        )


def middle_of(time: Array) -> float:
    """The middle of what points' times (N,) span [s], 0 where the stamp is all but there."""
    first, last = np.percentile(time, [OUTER, 100 - OUTER])
    middle = float(first + last) / 2
    return middle if abs(middle) > AT_MIDDLE * float(last - first) else 0.0
