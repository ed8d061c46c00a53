"""Static objects, stored in parts that can be selected by position."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from slam.data.cloud import Array
from slam.simulation.mesh import Mesh, joined


class Parts:
    """Meshes, each of objects that are close to each other."""

    def __init__(self, parts: Iterable[Mesh]) -> None:
        self._parts = list(parts)
        lowest = np.array([part.vertices[:, :2].min(axis=0) for part in self._parts])
        highest = np.array([part.vertices[:, :2].max(axis=0) for part in self._parts])
        self._middle, self._reach = (lowest + highest) / 2, np.linalg.norm(highest - lowest, axis=1) / 2

    def __len__(self) -> int:
        return sum(len(part) for part in self._parts)

    def around(self, place: Array, radius: float) -> Mesh:
        """Return all parts within `radius` [m] of a place (2,)."""
        near = np.linalg.norm(self._middle - place, axis=1) < radius + self._reach
        return joined(self._parts[index] for index in np.flatnonzero(near))
