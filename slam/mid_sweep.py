"""Odometry at the middle of the sweep, with poses at the scans' stamps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from slam.cell_sizes import Sizes
from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.odometry import Odometry, OdometryStep

OUTER_PERCENTILE = 1.0  # of the points' times, excluded at both ends when computing the middle
MIDDLE_TOLERANCE = 0.05  # of the sweep; a stamp this close to the middle counts as the middle


class MidSweepOdometry:
    """Odometry for stamps that refer to any instant of the sweep.

    Scans are deskewed to the middle of their sweep and registered there; each pose is then moved to its stamp by the
    estimated velocity. If scans were deskewed to the start of the sweep by the predicted velocity, the error of the
    prediction would enter the pose and, with the opposite sign, the next velocity: an undamped oscillation.

    The world is the first scan's frame at its stamp. The velocity at the first scan is known only with the second scan;
    until then the first step is provisional, unless its stamp refers to the middle.

    Args:
        odometry: Odometry that registers the scans at the middle of their sweeps.
    """

    def __init__(self, odometry: Odometry) -> None:
        self._odometry = odometry
        self._middle: float | None = None  # s after the stamp; None until a scan has times
        self._first: OdometryStep | None = None  # first step, at the middle, until the second
        self._T_world_middle: Array | None = None  # of the first scan
        self._velocity = np.zeros(6)

    @property
    def sizes(self) -> Sizes | None:
        """Cell and voxel sizes; None before the first scan."""
        return self._odometry.sizes

    def predict(self, stamp: float) -> Array:
        """Return the pose (4, 4) at `stamp` for a constant velocity since the last registered scan."""
        middle = self._middle or 0.0
        pose = self._odometry.predict(stamp + middle)
        if not middle or self._T_world_middle is None:
            return pose
        return np.asarray(self._T_world_middle @ pose @ se3.exp(-middle * self._velocity))

    def register(self, cloud: PointCloud, stamp: float) -> OdometryStep:
        """Register the next scan.

        Args:
            cloud: Points as recorded, with times relative to the stamp.
            stamp: Time of the scan [s].

        Returns:
            The step at the stamp.
        """
        if self._middle is None and cloud.time is not None and len(cloud):
            self._middle = middle_of(cloud.time)
        if not self._middle:
            return self._odometry.register(cloud, stamp)
        if cloud.time is not None:
            cloud = replace(cloud, time=cloud.time - np.float32(self._middle))
        step = self._odometry.register(cloud, stamp + self._middle)
        self._velocity = step.velocity
        if self._T_world_middle is not None:
            return self._at_stamp(step, self._T_world_middle)
        if self._first is None:
            self._first = step
            return replace(step, provisional=True)
        if step.provisional:
            return self._at_stamp(step, se3.exp(self._middle * step.velocity))
        *earlier, last = self._first_steps((self._first, *step.revised, step))
        return replace(last, revised=tuple(earlier))

    def settle(self) -> tuple[OdometryStep, ...]:
        """End the beginning; return the revised steps in place of the provisional ones."""
        steps = self._odometry.settle()
        if self._first is None or self._T_world_middle is not None:
            return steps
        return self._first_steps((self._first, *steps))

    def _first_steps(self, steps: Sequence[OdometryStep]) -> tuple[OdometryStep, ...]:
        """The first steps of a sequence at their stamps; the first step has the velocity of the second one."""
        first, *later = steps
        velocity = later[0].velocity if later else first.velocity
        self._T_world_middle = se3.exp((self._middle or 0.0) * velocity)
        steps = (replace(first, velocity=velocity), *later)
        begin, *others = (self._at_stamp(step, self._T_world_middle) for step in steps)
        return (replace(begin, pose=first.pose), *others)  # exactly the identity

    def _at_stamp(self, step: OdometryStep, T_world_middle: Array) -> OdometryStep:
        """A step moved from the middle of its sweep to its stamp."""
        T_middle_stamp = se3.exp(-(self._middle or 0.0) * step.velocity)
        T_stamp_middle = se3.inverse(T_middle_stamp)
        adjoint = se3.adjoint(T_stamp_middle)
        return replace(
            step,
            pose=T_world_middle @ step.pose @ T_middle_stamp,
            covariance=adjoint @ step.covariance @ adjoint.T,
            correction=replace(step.correction, T=T_stamp_middle),
            unobserved=(step.unobserved.reshape(-1, 2, 3) @ T_stamp_middle[:3, :3].T).reshape(-1, 6),
        )


def middle_of(time: Array) -> float:
    """Return the middle of the interval of the points' times (N,) [s]; 0 if the stamp is close to the middle."""
    first, last = np.percentile(time, [OUTER_PERCENTILE, 100 - OUTER_PERCENTILE])
    middle = float(first + last) / 2
    return middle if abs(middle) > MIDDLE_TOLERANCE * float(last - first) else 0.0
