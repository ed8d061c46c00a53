"""Moving objects along a drive."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from slam.data.cloud import Array
from slam.simulation.course import Course
from slam.simulation.drives import Drive
from slam.simulation.mesh import Mesh

SIGHT = 120.0  # metres: beyond, what moves is left out
OWN = 4.5  # metres: the length of the driven car
LANE_APART = 2.9  # metres between the middles of two that pass each other


@dataclass(frozen=True, eq=False)
class Mover:
    """One vehicle or person.

    Attributes:
        mesh: The mesh.
        way: (N,) distance along the drive's path in each frame [m].
        left: Lateral offset to the left of that path [m].
        reverse: Whether it moves against the drive.
        room: Minimum distance to others, between the centres of two with the same value [m].
    """

    mesh: Mesh
    way: Array
    left: float
    reverse: bool
    room: float


class Traffic:
    """Moving objects without collisions: those that hit an earlier one or the driven car are removed."""

    def __init__(self, drive: Drive, course: Course, movers: Iterable[Mover]) -> None:
        self.drive, self._course = drive, course
        self.movers: list[Mover] = []
        self.places: list[Array] = []
        for mover in movers:
            places = course.places(mover.way, mover.left)
            places[(mover.way < course.metres[0]) | (mover.way > course.metres[-1])] = np.nan
            if self.free(mover, places):
                self.movers.append(mover)
                self.places.append(places)

    def __len__(self) -> int:
        return len(self.movers)

    def at(self, frame: int) -> list[Mesh]:
        """Return all moving objects within SIGHT of the car in a frame."""
        here = self.drive.position[frame, :2]
        near = [
            (mover, places[frame])
            for mover, places in zip(self.movers, self.places, strict=True)
            if np.linalg.norm(places[frame] - here) < SIGHT  # never so for NaN
        ]
        if not near:
            return []
        yaw = [self._course.heading(mover.way[frame]) + np.pi * mover.reverse for mover, _ in near]
        places = np.array([place for _, place in near])
        poses = self._course.terrain.poses(places, np.array(yaw), 0.0, np.zeros((len(near), 3)))
        return [mover.mesh.moved(pose) for (mover, _), pose in zip(near, poses, strict=True)]

    def free(self, mover: Mover, places: Array) -> bool:
        """Check whether a mover keeps its distance in its lane in all frames; `places` (N, 2) are NaN out of sight."""
        others = [(other.way, other.left, other.room) for other in self.movers]
        for way, left, room in [(self.drive.way, 0.0, OWN + 1.0), *others]:
            apart = np.abs(mover.way - way).min()
            if abs(mover.left - left) < LANE_APART and apart < (mover.room + room) / 2:
                return False
        return True
