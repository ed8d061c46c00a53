"""The building and the walk through it."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from slam.data.cloud import Array
from slam.simulation.camera import Look
from slam.simulation.drives import Drive
from slam.simulation.indoors.furnishing import furnished
from slam.simulation.indoors.plan import EAST, OPENINGS, ROOMS, STOREY, WEST
from slam.simulation.indoors.shell import Style, opening_parts, room_shell
from slam.simulation.indoors.stairs import stairs_mesh
from slam.simulation.indoors.walk import HAND
from slam.simulation.mesh import Mesh, joined


class BuildingScene:
    """A `Scene` in a building: the plan is constant, surfaces and furniture depend on the seed."""

    def __init__(self, drive: Drive, seed: int, rng: np.random.Generator) -> None:
        assert drive.path is not None
        self._drive, self._seed, self._path = drive, seed, drive.path

    @cached_property
    def mesh(self) -> Mesh:
        """The whole building."""
        upstairs = np.round(self._drive.position[:, 2] / STOREY)
        parts = [stairs_mesh(stairs) for stairs in (WEST, EAST)]
        for index, room in enumerate(ROOMS):
            rng = np.random.default_rng([self._seed, 1, index])
            parts.append(room_shell(room, Style.of(room, rng)))
            parts.append(furnished(room, self._drive.position[upstairs == room.floor, :2], rng))
        for index, opening in enumerate(OPENINGS):
            parts.append(opening_parts(opening, np.random.default_rng([self._seed, 2, index])))
        return joined(parts)

    def poses(self, height: float) -> Array:
        """Return the poses (N, 4, 4) T_world_lidar, on average `height` [m] above the floor (HAND: the path itself)."""
        poses = np.array(self._path(self._drive.stamps))
        poses[:, 2, 3] += height - HAND
        return poses

    def look(self, rng: np.random.Generator) -> Look:
        """Draw diffuse light of lamps and daylight, with a random colour temperature; corners are darker."""
        warmth = float(rng.uniform(-0.03, 0.05))
        white = (1.0 + warmth, 1.0, 1.0 - 1.5 * warmth)
        return Look(
            sun=(0.0, 0.0, 1.0),
            sunlight=(0.0, 0.0, 0.0),
            zenith=white,
            horizon=white,
            haze=0.0,
            cover=0.0,
            exposure=1.25,
            seed=0,
            ground=(0.55, 0.54, 0.51),
            reach=2.5,
        )

    def around(self, place: Array, radius: float) -> Mesh:
        """Return the whole building, since it is small."""
        return self.mesh

    def moving(self, index: int) -> list[Mesh]:
        """Return no moving objects."""
        return []
