"""Known places: later visits of a street that was driven twice."""

from __future__ import annotations

import numpy as np
import pytest

from slam.data import se3
from slam.data.cloud import Array
from slam.loops.known_places import KnownPlaces
from slam.settings import KeyframeSettings

COUNT, SPACING = 10, 2.0  # keyframes of a visit, m between them
WAY = 500.0  # m of travelled distance from visit to visit


def at(x: float, y: float = 0.0, yaw: float = 0.0) -> Array:
    pose = se3.exp(np.array([0, 0, yaw, 0, 0, 0]))
    pose[:2, 3] = x, y
    return pose


class Street:
    """A street of ten keyframes, driven again and again in the same direction, by an odometry without drift."""

    def __init__(self, max_visits: int | None = 2) -> None:
        self.places = KnownPlaces(KeyframeSettings(max_visits=max_visits))
        self.poses: list[Array] = []

    def visit(self, y: float = 0.0, yaw: float = 0.0, found: tuple[int, ...] = tuple(range(COUNT))) -> list[bool]:
        """Drive a visit; those keyframes `found` have a loop with the first visit's keyframe of the same number."""
        number, first = len(self.poses), not self.poses
        known = []
        for k in range(COUNT):
            pose = at(SPACING * k + 0.3, y, yaw)
            loop = (k, se3.inverse(self.poses[k]) @ pose) if k in found and not first else None
            self.poses.append(pose)
            known.append(self.places.add(number + k, pose, WAY * (number // COUNT) + SPACING * k, loop))
        return known


def test_the_third_visit_is_known_but_for_its_first_keyframe() -> None:
    street = Street()
    assert not any(street.visit())
    assert not any(street.visit(y=0.5))
    assert street.visit(y=-0.5) == [False] + [True] * (COUNT - 1)
    assert street.visit() == [False] + [True] * (COUNT - 1)


@pytest.mark.parametrize(("y", "yaw"), [(2.5, 0.0), (0.0, 0.5), (0.0, np.pi)])
def test_another_lane_or_direction_is_another_place(y: float, yaw: float) -> None:
    street = Street(max_visits=1)
    street.visit()
    assert not any(street.visit(y, yaw))


def test_without_a_limit_no_place_is_known() -> None:
    street = Street(max_visits=None)
    assert not any(known for _ in range(4) for known in street.visit())


def test_a_keyframe_without_a_loop_is_kept_and_the_next_is_known() -> None:
    street = Street(max_visits=1)
    street.visit()
    assert street.visit(found=(0, 1, 2, 4, 5)) == [k in (1, 2, 4, 5) for k in range(COUNT)]


def test_a_loop_that_contradicts_the_one_before_makes_no_place_known() -> None:
    street = Street(max_visits=1)
    street.visit()
    known = []
    for k, match in enumerate((0, 1, 5, 3)):  # the third says that the sensor jumped 6 m
        known.append(street.places.add(COUNT + k, at(SPACING * k), WAY + SPACING * k, (match, np.eye(4))))
    assert known == [False, True, False, False]


def test_a_crossing_is_known_once_it_was_driven() -> None:
    """Two streets that no visit joined: the first turn from one into the other is kept, the second is known."""
    places = KnownPlaces(KeyframeSettings(max_visits=1))
    for street in range(2):
        for k in range(COUNT):
            places.add(COUNT * street + k, at(SPACING * k), WAY * street + SPACING * k, None)
    for turn, expected in ((0, False), (1, True)):
        known = []
        for k in range(6):  # three keyframes at the end of the first street, three at the beginning of the second
            match = COUNT - 3 + k
            known.append(
                places.add((2 + turn) * COUNT + k, at(SPACING * k), WAY * (2 + turn) + SPACING * k, (match, np.eye(4)))
            )
        assert known == [False, True, True, expected, True, True]
