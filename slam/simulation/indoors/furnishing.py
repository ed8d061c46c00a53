"""Furnishing of the rooms by their kind, with doors and the path of the walk kept free."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from slam.data.cloud import Array
from slam.simulation.indoors import furniture as make
from slam.simulation.indoors.plan import CEILING, FOOT, HALF, HEAD, RISE, RISERS, SOUTH, STOREY, Opening, Room
from slam.simulation.indoors.shell import openings_of
from slam.simulation.mesh import Mesh, joined

Make = Callable[[np.random.Generator], Mesh]

CLEAR = 0.5  # metres from the path of the walk to furniture
GAP = 0.04  # metres between two things, and between a thing and the wall
TRIES = 14  # places that are tried for a thing before it is left out


class Furnisher:
    """Places furniture in one room; `way` (N, 2) is the path of the walk on that floor."""

    def __init__(self, room: Room, way: Array, rng: np.random.Generator) -> None:
        self.room, self._way, self._rng = room, way, rng
        self._low = np.array([room.x[0], room.y[0]]) + HALF
        self._high = np.array([room.x[1], room.y[1]]) - HALF
        walls = [(across, line) for across in (0, 1) for line in (room.x, room.y)[across]]
        self._openings = [opening for wall in walls for opening in openings_of(room, *wall)]
        self._taken = [_before(o) for o in self._openings if o.kind != "window"]
        self._things: list[Mesh] = []

    @property
    def mesh(self) -> Mesh:
        """Return all placed furniture, at the height of the room's floor in the building."""
        return joined(self._things).placed(0, 0, self.room.floor * STOREY)

    def at_wall(self, thing: Make, count: int = 1, windows: bool = False, sides: Sequence[int] = (0, 1, 2, 3)) -> None:
        """Place `count` things at walls (east 0, north 1, west 2, south 3), with `windows` also below windows."""
        outer = 3 if self.room.y == SOUTH else 1
        allowed = [side for side in sides if windows or self.room.kind == "corridor" or side != outer]
        for _ in range(count):
            mesh = thing(self._rng)
            for _ in range(TRIES):
                side = allowed[int(self._rng.integers(len(allowed)))]
                across = side % 2
                along = self._rng.uniform(self._low[1 - across] + 0.4, self._high[1 - across] - 0.4)
                if self._put(self._against(mesh, side, along)):
                    break

    def on_grid(self, thing: Make, step: tuple[float, float]) -> None:
        """Place as many things as fit in rows, a walking space away from the walls."""
        low, high = self._low + 0.5, self._high - 0.5
        counts = np.maximum(((high - low) / step).astype(int), 1)
        for x in low[0] + (np.arange(counts[0]) + 0.5) * (high - low)[0] / counts[0]:
            for y in low[1] + (np.arange(counts[1]) + 0.5) * (high - low)[1] / counts[1]:
                self._put(thing(self._rng).placed(x, y, 0, self._rng.normal(0, 0.03)))

    def free(self, thing: Make, count: int = 1) -> None:
        """Place `count` things anywhere on the floor."""
        for _ in range(count):
            mesh = thing(self._rng)
            for _ in range(TRIES):
                x, y = self._rng.uniform(self._low + 0.3, self._high - 0.3)
                if self._put(mesh.placed(x, y, 0, self._rng.uniform(0, 2 * np.pi))):
                    break

    def below_windows(self, thing: Make) -> None:
        """Place one thing below each window."""
        for opening in self._openings:
            if opening.kind == "window" and opening.across == 1:
                self._put(self._against(thing(self._rng), 3 if self.room.y == SOUTH else 1, opening.at))

    def hang(self, thing: Make, side: int, along: float, height: float) -> None:
        """Hang a thing on a wall, `height` above the floor."""
        self._things.append(self._against(thing(self._rng), side, along).placed(0, 0, height))

    def lamps(self, thing: Make, step: float) -> None:
        """Place lamps in rows under the ceiling."""
        size = self._high - self._low
        counts = np.maximum(np.round(size / step).astype(int), 1)
        for x in self._low[0] + (np.arange(counts[0]) + 0.5) * size[0] / counts[0]:
            for y in self._low[1] + (np.arange(counts[1]) + 0.5) * size[1] / counts[1]:
                self._things.append(thing(self._rng).placed(x, y, CEILING))

    def _against(self, mesh: Mesh, side: int, along: float) -> Mesh:
        """Its back at the wall: east 0, north 1, west 2, south 3."""
        across = side % 2
        wall = self._high[across] - GAP / 2 if side < 2 else self._low[across] + GAP / 2
        x, y = (along, wall) if across else (wall, along)
        return mesh.placed(x, y, 0, (side - 1) * np.pi / 2)

    def _put(self, mesh: Mesh) -> bool:
        """It stays if it is in the room, out of the way, and in nothing else."""
        low, high = mesh.vertices[:, :2].min(axis=0), mesh.vertices[:, :2].max(axis=0)
        if (low < self._low).any() or (high > self._high).any():
            return False
        near = (self._way > low - CLEAR) & (self._way < high + CLEAR)
        if near.all(axis=1).any():
            return False
        if any((low < there[1] + GAP).all() and (high > there[0] - GAP).all() for there in self._taken):
            return False
        self._things.append(mesh)
        self._taken.append((low, high))
        return True


def furnished(room: Room, way: Array, rng: np.random.Generator) -> Mesh:
    """Return the furniture of a room."""
    one = Furnisher(room, way, rng)
    if room.kind not in ("corridor", "stairs"):
        one.below_windows(make.radiator)
    FURNISH[room.kind](one)
    return one.mesh


def _stairs(one: Furnisher) -> None:
    """Pictures along the flights; the lamps hang over the upper floor."""
    landing = RISERS * RISE
    if one.room.floor:
        one.lamps(make.panel_lamp, 4.0)
        return
    one.hang(make.picture, 0, FOOT + 0.9, 0.6)
    one.hang(make.picture, 0, HEAD + 0.8, landing - 0.25)
    one.hang(make.picture, 2, HEAD + 0.6, landing - 0.25)
    one.hang(make.picture, 2, FOOT + 1.0, 2.0)


def _corridor(one: Furnisher) -> None:
    one.at_wall(make.extinguisher, 3, sides=(1, 3))
    one.at_wall(make.lockers, 4, sides=(1, 3))
    one.at_wall(make.bench, 3, sides=(1, 3))
    one.at_wall(make.picture, 12, sides=(1, 3))
    one.at_wall(make.plant, 2, sides=(1, 3))
    one.at_wall(make.bin_, 2, sides=(1, 3))
    one.lamps(make.panel_lamp, 3.2)


def _office(one: Furnisher) -> None:
    one.at_wall(make.desk, 4)
    one.at_wall(make.shelf, 3)
    one.at_wall(make.cupboard, 2)
    one.at_wall(make.picture, 4)
    one.free(make.plant, 2)
    one.free(make.bin_, 1)
    one.lamps(make.panel_lamp, 2.6)


def _classroom(one: Furnisher) -> None:
    one.at_wall(make.whiteboard, 1, sides=(0, 2))
    one.at_wall(make.cupboard, 2)
    one.at_wall(make.picture, 5)
    one.on_grid(lambda rng: make.group(rng, 1.3, 2), (2.0, 2.1))
    one.free(make.bin_, 1)
    one.lamps(make.panel_lamp, 2.6)


def _lounge(one: Furnisher) -> None:
    one.at_wall(make.sofa, 3)
    one.at_wall(make.shelf, 4)
    one.at_wall(make.picture, 5)
    one.free(lambda rng: make.group(rng, 1.0, 1), 2)
    one.free(make.plant, 4)
    one.lamps(make.hanging_lamp, 3.0)


def _store(one: Furnisher) -> None:
    one.at_wall(make.shelf, 6)
    one.at_wall(make.cupboard, 2)
    one.free(make.carton, 7)
    one.lamps(make.panel_lamp, 3.5)


def _bedroom(one: Furnisher) -> None:
    one.at_wall(make.bed, 2)
    one.at_wall(make.cupboard, 2)
    one.at_wall(make.desk, 1)
    one.at_wall(make.shelf, 1)
    one.at_wall(make.picture, 3)
    one.free(make.plant, 1)
    one.lamps(make.hanging_lamp, 3.4)


def _canteen(one: Furnisher) -> None:
    one.on_grid(lambda rng: make.group(rng, 1.6, 3), (2.4, 2.3))
    one.at_wall(make.cupboard, 3)
    one.at_wall(make.picture, 4)
    one.at_wall(make.plant, 3, windows=True)
    one.lamps(make.panel_lamp, 2.8)


def _meeting(one: Furnisher) -> None:
    one.on_grid(lambda rng: make.group(rng, 2.4, 4), (9.0, 9.0))
    one.at_wall(make.whiteboard, 1, sides=(0, 2))
    one.at_wall(make.shelf, 2)
    one.at_wall(make.picture, 3)
    one.free(make.plant, 2)
    one.lamps(make.panel_lamp, 2.6)


FURNISH: dict[str, Callable[[Furnisher], None]] = {
    "corridor": _corridor,
    "stairs": _stairs,
    "office": _office,
    "classroom": _classroom,
    "lounge": _lounge,
    "store": _store,
    "bedroom": _bedroom,
    "canteen": _canteen,
    "meeting": _meeting,
}


def _before(opening: Opening) -> tuple[Array, Array]:
    """Low and high corner (2,) of what a door needs free on both sides of it, and beside it where its leaf lies."""
    beside = opening.width * (opening.leaf is not None and opening.leaf > np.pi / 2)
    half = np.empty(2)
    half[opening.across], half[1 - opening.across] = 1.1, opening.width / 2 + 0.05 + beside
    middle = np.array([opening.at, opening.line] if opening.across else [opening.line, opening.at])
    return middle - half, middle + half
