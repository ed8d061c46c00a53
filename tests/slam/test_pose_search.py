"""The search for a pose beside an implausible registration."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from slam.data.cloud import Array
from slam.pose_search import search
from slam.registration.result import RegistrationResult

POINTS = np.zeros((10, 3), np.float32), np.ones(10, np.float32)


class Storeys:
    """A target with walls alone: from guesses 0.9 m ahead and more, registrations end at another height."""

    convergence_radius = 1.0

    def __init__(self, height: float) -> None:
        self.height = height

    def scorer(self, xyz: Array, weight: Array, centre: Array) -> Callable[[Array], float]:
        return lambda pose: 2.0 if pose[2, 3] == self.height else 1.0

    def align(self, xyz: Array, weight: Array, guess: Array) -> RegistrationResult:
        return registered(self.height if guess[0, 3] > 0.9 else 0.0)


def registered(height: float) -> RegistrationResult:
    pose, one = np.eye(4), np.eye(6)
    pose[2, 3] = height
    return RegistrationResult(
        pose, one, one, one, overlap=1.0, inlier_ratio=1.0, upright_inlier_ratio=1.0, converged=True
    )


@pytest.mark.parametrize(("height", "reached"), [(0.5, 0.5), (3.0, 0.0), (-3.0, 0.0)])
def test_a_registration_is_not_replaced_by_one_a_storey_above_or_below(height: float, reached: float) -> None:
    found = search(Storeys(height), POINTS, [np.eye(4)], 5.0, registered(0.0))  # type: ignore[arg-type]
    assert found.pose[2, 3] == reached


def test_at_the_beginning_and_after_a_gap_any_height_is_possible() -> None:
    assert search(Storeys(3.0), POINTS, [np.eye(4)], 5.0).pose[2, 3] == 3.0  # type: ignore[arg-type]
