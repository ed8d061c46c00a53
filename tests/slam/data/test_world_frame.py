"""Scans that move in their own coordinates while the LiDAR seems to stand."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array
from slam.data.world_frame import centre, world_frame_problem

STANDING = np.tile(np.eye(4), (50, 1, 1))


def moving(to: float) -> Array:
    """Centres (50, 2) that go there along x."""
    return np.column_stack([np.linspace(0, to, 50), np.zeros(50)])


def test_centres_that_drive_while_the_odometry_stands() -> None:
    (problem,) = world_frame_problem(moving(100.0), STANDING)
    assert problem.kind == "world frame"
    assert "moves 100 m" in problem.message


def test_what_is_no_sign_of_it() -> None:
    driving = STANDING.copy()
    driving[:, 0, 3] = np.arange(50)
    opened = np.where(np.arange(50)[:, None] < 25, [0.0, 0], [60, 0])  # a door
    for centres, poses in (
        (moving(100.0), driving),
        (moving(20.0), STANDING),
        (opened, STANDING),
        (np.full((50, 2), np.nan), STANDING),
        (np.zeros((0, 2)), np.zeros((0, 4, 4))),
    ):
        assert world_frame_problem(centres, poses) == ()


def test_scans_without_points_are_left_out() -> None:
    centres = moving(100.0)
    centres[::7] = centre(np.zeros((0, 3)))
    assert len(world_frame_problem(centres, STANDING)) == 1
