"""A town grown around a drive."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slam.data.cloud import Array
from slam.simulation.course import Road
from slam.simulation.drives import LANE, Drive
from slam.simulation.mesh import Mesh, grid, joined
from slam.simulation.parts import Parts
from slam.simulation.terrain import MARGIN, Terrain
from slam.simulation.town.ground import ground
from slam.simulation.town.plots import Plots
from slam.simulation.town.roadside import GARDEN, Roadside, Stock
from slam.simulation.town.streets import OUTSKIRTS, Streets


class Town(Parts):
    """All that stands still. The same drive and seed give the same town."""

    def __init__(self, drive: Drive, terrain: Terrain, seed: int) -> None:
        rng = np.random.default_rng([seed, 1])
        self.terrain, self.streets, self.stock = terrain, Streets(drive, rng), Stock.of(rng)
        parts = [*self.streets.surface(terrain), *ground(terrain, self.streets, seed)]
        super().__init__([*parts, *self._built(drive, rng)])

    def _built(self, drive: Drive, rng: np.random.Generator) -> Iterator[Mesh]:
        low, high = (bound(drive.position[:, :2], axis=0) for bound in (np.min, np.max))
        plots, kerbs = (Plots(low - MARGIN, high + MARGIN) for _ in range(2))
        for road in self.streets.roads:
            plots.block(road.line, GARDEN)
        plots.block(self.streets.path, GARDEN - LANE)
        kerbs.block(self.streets.path, 1.4)
        if drive.tunnel:
            first, last = (int(OUTSKIRTS + way) for way in drive.tunnel)
            line = self.streets.roads[0].line[first:last]
            for taken in (plots, kerbs):
                taken.block(line, 2 * GARDEN)
            yield _tunnel(line, self.terrain)
        for number, road in enumerate(self.streets.roads):
            for side in (-1, 1):
                roadside = Roadside(road, side, number, self.streets, self.terrain, plots, kerbs, self.stock, rng)
                yield from roadside.fill()


def _tunnel(line: Array, terrain: Terrain) -> Mesh:
    """A smooth concrete tube over a road's line (M, 2), with a wall around each end."""
    angle = np.linspace(0, np.pi, 19)
    wide, high = GARDEN + 0.1, 5.2
    outline = np.column_stack([wide * np.cos(angle), high * np.sin(angle) ** 0.7 + 0.6])
    outline = np.concatenate([[[wide, -1.0]], outline, [[-wide, -1.0]]])
    left, foot = Road(line).left, terrain.lifted(line)

    def around(index: int, scale: float) -> Array:
        across = np.append(left[index], 0.0)
        return np.asarray(foot[index] + scale * outline[:, :1] * across + scale * outline[:, 1:] * [0, 0, 1.0])

    tube = grid(np.stack([around(index, 1.0) for index in range(len(line))]), "concrete")
    ends = [grid(np.stack([around(index, 1.0), around(index, 1.8)]), "concrete", (120, 118, 112)) for index in (0, -1)]
    return joined([tube, *ends])
