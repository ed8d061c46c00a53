"""A LiDAR that moves while it turns."""

from __future__ import annotations

from typing import Any

import numpy as np

from slam.data import se3
from slam.simulation.heads import Lidar
from slam.simulation.lidar import exact_scan
from slam.simulation.sweep import Sweep
from slam.simulation.world import StandingWorld, World

Courtyard = Any
PERIOD = 0.1


def shaken(courtyard: Courtyard, parts: int) -> Sweep:
    return Sweep.along(courtyard.path(1.0 + PERIOD * np.linspace(0, 1, parts + 1)))


def test_points_are_seen_from_the_path_at_their_times(courtyard: Courtyard) -> None:
    world, errors = World(StandingWorld(courtyard.mesh)), {}
    for parts in (1, 4, 12):
        seen = exact_scan(world, Lidar.of("os1-64"), shaken(courtyard, parts))
        placed = courtyard.placed(seen.xyz, courtyard.path(1.0 + PERIOD * seen.fraction))
        errors[parts] = np.percentile(courtyard.off_the_walls(placed), 99)
    assert errors[12] < 0.003
    assert errors[1] > 0.03  # half a nod is no constant velocity
    assert errors[4] < errors[1] / 4


def test_a_sweep_knows_where_the_lidar_is(courtyard: Courtyard) -> None:
    for fraction in (0.0, 0.25, 0.5, 1.0):
        (true,) = courtyard.path(np.array([1 + PERIOD * fraction]))
        np.testing.assert_allclose(shaken(courtyard, 12).at(fraction), true, atol=1e-3)


def test_a_steady_sweep_is_half_over_in_its_pose() -> None:
    motion = se3.exp(np.array([0.01, 0, 0.1, 1.0, 0.1, 0]))
    steady = Sweep.steady(np.eye(4), motion)
    np.testing.assert_allclose(steady.at(0.5), np.eye(4), atol=1e-12)
    np.testing.assert_allclose(se3.inverse(steady.at(0.0)) @ steady.at(1.0), motion, atol=1e-12)
