"""Known places: where earlier visits have mapped the surroundings, another keyframe adds nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.settings import KeyframeSettings

NEAR = 20.0  # m of travelled distance over which the odometry tells where keyframes are to each other
MAX_OFFSET, MAX_TURN_DEG = 0.5, 3.0  # between the loops of two keyframes and the odometry: of true loops a fifth


@dataclass(frozen=True, eq=False)
class _Visit:
    """A keyframe, and where it is relative to the keyframe `first` of the first visit of its place.

    `pose` is its T_world_keyframe by the odometry, `T_first` its T_first_keyframe.
    """

    travelled: float
    pose: Array
    first: int
    T_first: Array


class KnownPlaces:
    """Decides which keyframes are at known places.

    A keyframe revisits an earlier one if a verified loop puts it within the distance and the angle at which a new
    keyframe would begin. It is at a known place if that was visited `max_visits` times before, and if the odometry
    since the revisit before agrees with both loops. So a single false loop, or the first of several, makes no
    place known. The odometry is compared along the first visit; where that does not lead from one place to the other,
    as at a crossing, along the first visit that does.

    The decisions depend on keyframes and loops only, not on the optimised poses, so they can be repeated exactly.
    """

    def __init__(self, settings: KeyframeSettings) -> None:
        self.settings = settings
        self._kept: dict[int, _Visit] = {}  # keyframes at places that were not known
        self._visits: dict[int, int] = {}  # how often a place was visited, by the keyframe of its first visit
        self._before: _Visit | None = None  # the last revisit
        self._junctions: list[tuple[int, int, Array]] = []  # first visits a, b that a later one joined, T_a_b

    def add(self, number: int, pose: Array, travelled: float, loop: tuple[int, Array] | None) -> bool:
        """Add the next keyframe; return whether it is at a known place.

        Args:
            number: Its position in the run.
            pose: (4, 4) T_world_keyframe by the odometry.
            travelled: Travelled distance [m].
            loop: Position of a keyframe that was not at a known place, and T_match_keyframe (4, 4); None without one.
        """
        most = self.settings.max_visits
        here, known = _Visit(travelled, pose, number, np.eye(4)), False
        near = self._nearest(*loop) if loop and most is not None else None
        if near:
            match, T = near
            there = self._kept[match]
            here = _Visit(travelled, pose, there.first, there.T_first @ T)
            known = most is not None and self._visits[here.first] >= most and self._agrees(here)
            if not known:
                self._join(here)
            self._before = here
        if not known:
            self._kept[number] = here
            self._visits[here.first] = self._visits.get(here.first, 0) + 1
        return known

    def _nearest(self, match: int, T: Array) -> tuple[int, Array] | None:
        """The keyframe of the match's visit nearest to a pose in its frame, and the pose in the frame of that one."""
        matched, found = self._kept[match], []
        for step in (-1, 1):
            number = match if step > 0 else match - 1
            while (one := self._kept.get(number)) and abs(one.travelled - matched.travelled) <= NEAR / 2:
                T_one = se3.inverse(one.pose) @ matched.pose @ T
                found.append((float(np.linalg.norm(T_one[:3, 3])), number, T_one))
                number += step
        distance, number, T_one = min(found, key=lambda each: each[:2])
        turned = np.rad2deg(se3.angle(T_one))
        return (number, T_one) if distance < self.settings.distance and turned < self.settings.angle_deg else None

    def _agrees(self, here: _Visit) -> bool:
        """Whether the odometry since the last revisit agrees with the places of both."""
        before = self._before
        T = self._between(before, here) if before else None
        if before is None or T is None:
            return False
        expected = se3.inverse(before.T_first) @ T @ here.T_first
        error = se3.inverse(expected) @ se3.inverse(before.pose) @ here.pose
        return bool(np.linalg.norm(error[:3, 3]) < MAX_OFFSET and np.rad2deg(se3.angle(error)) < MAX_TURN_DEG)

    def _between(self, before: _Visit, here: _Visit) -> Array | None:
        """T_a_b (4, 4) of the first visits of two successive revisits; None where no visit led from a to b."""
        if here.travelled - before.travelled > NEAR:
            return None
        T = self._along(before.first, here.first, NEAR)
        for a, b, T_a_b in self._junctions if T is None else ():
            to_a, from_b = self._along(before.first, a, NEAR / 2), self._along(b, here.first, NEAR / 2)
            if to_a is not None and from_b is not None:
                return np.asarray(to_a @ T_a_b @ from_b)
        return T

    def _along(self, a: int, b: int, most: float) -> Array | None:
        """T_a_b (4, 4) of two keyframes by the odometry, if they are at most so far apart [m]."""
        one, other = self._kept[a], self._kept[b]
        near = abs(one.travelled - other.travelled) <= most
        return np.asarray(se3.inverse(one.pose) @ other.pose) if near else None

    def _join(self, here: _Visit) -> None:
        """Note how a revisit joins its place to that of the revisit before, if none did so far."""
        before = self._before
        if before and here.travelled - before.travelled <= NEAR and self._between(before, here) is None:
            T = before.T_first @ se3.inverse(before.pose) @ here.pose @ se3.inverse(here.T_first)
            self._junctions.append((before.first, here.first, T))
