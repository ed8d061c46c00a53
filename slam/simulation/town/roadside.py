"""Objects along a street: houses and gardens, trees, parked cars, lamps, signs and others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from slam.data.cloud import Array
from slam.simulation.course import Road
from slam.simulation.mesh import Mesh
from slam.simulation.terrain import Terrain
from slam.simulation.town import furniture, vegetation, vehicles
from slam.simulation.town.buildings import building
from slam.simulation.town.plots import Plots
from slam.simulation.town.streets import HALF_WIDTH, PAVEMENT, Streets

GARDEN = HALF_WIDTH + PAVEMENT  # metres from the middle of the road to where gardens and houses begin
PARKED = HALF_WIDTH - 1.1  # metres from there to the middle of the parked cars


@dataclass(frozen=True)
class Stock:
    """Stock of objects that are placed many times: a few variants of each are created."""

    trees: list[Mesh]
    street_trees: list[Mesh]
    bushes: list[Mesh]
    cars: list[Mesh]
    people: list[Mesh]
    lamps: list[Mesh]
    signs: list[Mesh]
    small: list[Mesh]

    @staticmethod
    def of(rng: np.random.Generator) -> Stock:
        """Create the variants."""
        small = (furniture.bollard, furniture.wheelie_bin, furniture.electric_box, furniture.bench, vehicles.bicycle)
        return Stock(
            trees=[vegetation.tree(rng) for _ in range(14)],
            street_trees=[vegetation.deciduous(rng) for _ in range(6)],
            bushes=[vegetation.bush(rng) for _ in range(6)],
            cars=[vehicles.car(rng) for _ in range(18)],
            people=[vehicles.person(rng) for _ in range(6)],
            lamps=[furniture.lamp(rng) for _ in range(3)],
            signs=[furniture.sign(rng) for _ in range(10)],
            small=[make(rng) for make in small for _ in range(2)],
        )


class Roadside:
    """One side of a road, to be filled: side is 1 on the left of its direction, -1 on the right.

    `plots` is the ground behind the pavement, `kerbs` the street itself.
    """

    def __init__(
        self,
        road: Road,
        side: int,
        number: int,
        streets: Streets,
        terrain: Terrain,
        plots: Plots,
        kerbs: Plots,
        stock: Stock,
        rng: np.random.Generator,
    ) -> None:
        self._line, self._out = road.line, side * road.left
        self._side, self._number = side, number
        self._streets, self._terrain, self._plots, self._kerbs = streets, terrain, plots, kerbs
        self._stock, self._rng = stock, rng
        self.length = len(road.line) - 1.0

    def fill(self) -> Iterator[Mesh]:
        """Yield all objects: sections of one character, and the objects that every street has."""
        start = 3.0
        while start < self.length - 6:
            stop = min(start + self._rng.uniform(45, 120), self.length - 3)
            pick = self._rng.choice(4, p=[0.46, 0.34, 0.1, 0.1])
            yield from (self._row, self._villas, self._park, self._works)[pick](start, stop)
            yield from self._cars(start, stop, self._rng.uniform(0.1, 0.85))
            start = stop
        yield from self._kerbside()
        yield from self._backyards()

    def _row(self, start: float, stop: float) -> Iterator[Mesh]:
        """Houses wall to wall, right behind the pavement."""
        setback = self._rng.choice([0.05, 0.05, 1.2, 2.5])
        storeys = int(self._rng.integers(2, 6))
        while start < stop - 8:
            width, depth = self._rng.uniform(9, 17), self._rng.uniform(9, 13)
            if self._rng.random() < 0.12:
                yield from self._boundary(start, start + 4.0)
                start += 4.0
            own = int(np.clip(storeys + self._rng.integers(-1, 2), 1, 5))
            house = building(self._rng, width, depth, own)
            yield from self._stand(house, start + width / 2, GARDEN + setback, (width - 0.6, depth), depth / 2)
            start += width

    def _villas(self, start: float, stop: float) -> Iterator[Mesh]:
        """Houses apart from each other in gardens behind fences and hedges."""
        while start < stop - 12:
            width, depth, setback = self._rng.uniform(9, 14), self._rng.uniform(8, 12), self._rng.uniform(3, 8)
            lot = width + self._rng.uniform(4, 9)
            house = building(self._rng, width, depth, int(self._rng.integers(1, 4)))
            yield from self._stand(house, start + lot / 2, GARDEN + setback, (width, depth), depth / 2)
            yield from self._boundary(start, start + lot - self._rng.choice([0.0, 3.5]))
            for _ in range(self._rng.integers(1, 5)):
                at, out = start + self._rng.uniform(0, lot), GARDEN + self._rng.uniform(1.2, setback + 6)
                yield from self._plant(at, out)
            start += lot

    def _park(self, start: float, stop: float) -> Iterator[Mesh]:
        """Trees and bushes on a lawn, perhaps behind a hedge."""
        if self._rng.random() < 0.5:
            yield from self._boundary(start, stop)
        for _ in range(int((stop - start) / 3)):
            yield from self._plant(self._rng.uniform(start, stop), GARDEN + self._rng.uniform(1.5, 30))

    def _works(self, start: float, stop: float) -> Iterator[Mesh]:
        """A large building behind a yard with cars."""
        setback = self._rng.uniform(9, 14)
        yield from self._boundary(start, stop)
        middle, width = (start + stop) / 2, min(stop - start, 45.0) - 4
        depth = self._rng.uniform(14, 22)
        hall = building(self._rng, width, depth, int(self._rng.integers(2, 5)))
        yield from self._stand(hall, middle, GARDEN + setback, (width, depth), depth / 2)
        for at in np.arange(start + 3, stop - 3, 2.9):
            if self._rng.random() < 0.6:
                turn = self._rng.choice([-np.pi, np.pi]) / 2
                yield from self._stand(self._car(), at, GARDEN + 4.0, (4.8, 2.0), turn=turn)

    def _boundary(self, start: float, stop: float) -> Iterator[Mesh]:
        """A fence, a hedge, or nothing, at the end of the pavement."""
        kind, length = self._rng.choice(["fence", "hedge", "none"], p=[0.5, 0.35, 0.15]), 5.0
        if kind == "none":
            return
        make = furniture.fence if kind == "fence" else vegetation.hedge
        state = self._rng.integers(2**32)
        for at in np.arange(start, stop - length / 2, length):
            piece = make(np.random.default_rng(state), length).placed(-length / 2, 0, 0)
            yield from self._stand(piece, at + length / 2, GARDEN + 0.5, (length - 1.2, 0.8))

    def _cars(self, start: float, stop: float, share: float) -> Iterator[Mesh]:
        """Cars parked along the kerb, heading as the traffic on that side does."""
        heading = np.pi  # x runs along the road with the houses to the left
        for at in np.arange(start + 4, stop - 4, 6.2):
            slip = self._rng.normal(0, [0.25, 0.12, 0.02])
            if self._rng.random() < share and self._clear_of_others(at, PARKED) > HALF_WIDTH + 5:
                yield from self._on_street(self._car(), at + slip[0], PARKED + slip[1], (4.6, 1.9), heading + slip[2])

    def _kerbside(self) -> Iterator[Mesh]:
        """Lamps, street trees, signs, and small things on the pavement."""
        lamp = self._one(self._stock.lamps)
        for at in np.arange(6 + 14 * (self._side > 0), self.length, 28.0):
            yield from self._beside_kerb(lamp, at, 0.45)
        if self._rng.random() < 0.4:
            tree = self._one(self._stock.street_trees)
            for at in np.arange(10, self.length, self._rng.uniform(9, 13)):
                scaled = tree.placed(0, 0, 0, self._rng.uniform(0, 6.28), self._rng.uniform(0.55, 0.8))
                yield from self._beside_kerb(scaled, at, 0.8)
        facing = self._side * np.pi / 2
        for at in self._scattered(35.0):
            yield from self._beside_kerb(self._one(self._stock.signs), at, 0.4, facing)
        for at in self._scattered(13.0):
            yield from self._beside_kerb(self._one(self._stock.small), at, self._rng.choice([0.35, PAVEMENT - 0.4]))
        for at in self._scattered(26.0):
            person = self._one(self._stock.people)
            yield from self._beside_kerb(person, at, self._rng.uniform(0.6, 1.9), self._rng.uniform(0, 6.28))

    def _backyards(self) -> Iterator[Mesh]:
        """Trees and houses in the second row, where there is room."""
        for at in self._scattered(7.0):
            yield from self._plant(at, GARDEN + self._rng.uniform(16, 70), large=True)
        for at in self._scattered(13.0):
            width, depth, turn = self._rng.uniform(11, 20), self._rng.uniform(9, 12), self._rng.choice([0, 0.5, 1, 1.5])
            house = building(self._rng, width, depth, int(self._rng.integers(2, 6))).placed(0, -depth / 2, 0)
            out = GARDEN + self._rng.uniform(24, 75)
            yield from self._stand(house, at, out, (width + 2, depth + 2), turn=turn * np.pi)

    def _plant(self, at: float, out: float, large: bool = False) -> Iterator[Mesh]:
        """A tree or a bush where there is room."""
        tree = large or self._rng.random() < 0.55
        plant = self._one(self._stock.trees if tree else self._stock.bushes)
        scale = self._rng.uniform(0.6, 1.25)
        plant = plant.placed(0, 0, 0, self._rng.uniform(0, 6.28), scale)
        yield from self._stand(plant, at, out, (2.0, 2.0) if tree else (1.4, 1.4))

    def _stand(
        self, mesh: Mesh, at: float, out: float, size: tuple[float, float], beyond: float = 0.0, turn: float = 0.0
    ) -> Iterator[Mesh]:
        """The mesh, `out` from the middle of the road, if its ground is free: length and width around `beyond` it."""
        place, yaw = self._place(at, out + beyond)
        if self._plots.claim(place, yaw + turn, size):
            yield self._lay(mesh, at, out, turn)

    def _beside_kerb(self, mesh: Mesh, at: float, out: float, turn: float = 0.0) -> Iterator[Mesh]:
        """The mesh on the pavement, `out` from the kerb, where no other street runs."""
        if self._clear_of_others(at, HALF_WIDTH + out) > HALF_WIDTH + 0.3:
            yield from self._on_street(mesh, at, HALF_WIDTH + out, (0.7, 0.7), turn)

    def _on_street(self, mesh: Mesh, at: float, out: float, size: tuple[float, float], turn: float) -> Iterator[Mesh]:
        """The mesh, if nothing stands or drives there."""
        place, yaw = self._place(at, out)
        if self._kerbs.claim(place, yaw + turn, size):
            yield self._lay(mesh, at, out, turn)

    def _lay(self, mesh: Mesh, at: float, out: float, turn: float) -> Mesh:
        """The mesh on the ground, its -y towards the street, then turned."""
        place, yaw = self._place(at, out)
        rise = 0.04 if HALF_WIDTH < out < GARDEN else -0.06 if out < HALF_WIDTH else 0.0
        return mesh.placed(place[0], place[1], float(self._terrain.height(*place)) + rise, yaw + turn)

    def _place(self, at: float, out: float) -> tuple[Array, float]:
        """Where that is, and the direction [rad] in which x runs so that y points away from the road."""
        metre = int(np.clip(np.floor(at), 0, len(self._line) - 2))
        share = float(np.clip(at - metre, 0, 1))
        middle = (1 - share) * self._line[metre] + share * self._line[metre + 1]
        away = self._out[metre]
        return middle + out * away, float(np.arctan2(-away[0], away[1]))

    def _clear_of_others(self, at: float, out: float) -> float:
        """Metres to the middle of the nearest other road."""
        place, _ = self._place(at, out)
        return float(self._streets.distance_to_others(place[None], self._number, np.array([at]))[0])

    def _scattered(self, every: float) -> Array:
        return self._rng.uniform(2, max(self.length - 2, 3), self._rng.poisson(self.length / every))

    def _one(self, of: list[Mesh]) -> Mesh:
        return of[self._rng.integers(len(of))]

    def _car(self) -> Mesh:
        return self._one(self._stock.cars)
