"""Streets between walls: one past parked lorries, and an avenue full of traffic."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import ClassVar

import numpy as np

from slam.simulation.course import Course
from slam.simulation.driven_scene import DrivenScene
from slam.simulation.mesh import Mesh
from slam.simulation.palette import pick
from slam.simulation.parts import Parts
from slam.simulation.roads import lorries
from slam.simulation.roads.surface import Node, carriageway, stripe, swept
from slam.simulation.town import furniture, vegetation, vehicles
from slam.simulation.town.buildings import building
from slam.simulation.traffic import SIGHT, Mover, Traffic

BEYOND = 150.0  # metres of street before and after the drive
STEP = 2.0
PAVEMENT = 2.6  # metres wide
KERB = 0.12  # metres high
#: From the asphalt's edge to the houses and behind them: metres out, height [m], and what there is up to the next.
PROFILE = ((0.0, 0.0, "kerb"), (0.02, KERB, "kerb"), (0.16, KERB, "paving"), (PAVEMENT, KERB + 0.03, "soil"),
           (PAVEMENT + 14, KERB, "grass"), (60.0, KERB, ""))  # fmt: skip


class StreetScene(DrivenScene):
    """A street with rows of objects along both sides. Lateral offsets are to the left of the centre of the car's lane.

    Attributes:
        kerbs: Offsets of the left and the right kerb.
        lines: Offsets of the markings, and whether they are dashed.
    """

    kerbs: ClassVar[tuple[float, float]]
    lines: ClassVar[tuple[tuple[float, bool], ...]]

    @cached_property
    def course(self) -> Course:
        """The middle of the car's lane."""
        return Course.of(self.drive, self.terrain, BEYOND)

    @cached_property
    def standing(self) -> Parts:
        """The street, what is along it, and what is parked."""
        rng = np.random.default_rng([self.seed, 1])
        return Parts([*self._surface(), *self.alongside(rng), *self.parked(rng)])

    @cached_property
    def traffic(self) -> Traffic:
        """All that moves."""
        return Traffic(self.drive, self.course, self.movers(np.random.default_rng([self.seed, 2])))

    def alongside(self, rng: np.random.Generator) -> Iterator[Mesh]:
        """Yield the objects behind the kerbs."""
        yield from ()

    def parked(self, rng: np.random.Generator) -> Iterator[Mesh]:
        """Yield the parked vehicles on the carriageway."""
        yield from ()

    def movers(self, rng: np.random.Generator) -> Iterator[Mover]:
        """Yield the moving vehicles."""
        yield from ()

    def _surface(self) -> Iterator[Mesh]:
        way = np.arange(self.course.metres[0], self.course.metres[-1], STEP)
        yield from carriageway(self.course, self.kerbs, way)
        for left, dashed in self.lines:
            yield from stripe(self.course, left, way, dashed)
        for kerb, out in zip(self.kerbs, (1, -1), strict=True):
            section = [Node(kerb + out * x, z, name) for x, z, name in PROFILE]
            yield from swept(self.course, section, way)


class LorriesScene(StreetScene):
    """A `Scene` with a row of parked lorries on the right, their sides ASIDE from the car's centre, and a few cars.

    Both sides end at a plain wall: only the gaps between vehicles constrain the position along the road.
    """

    ASIDE = 3.7
    WALL = 6.0  # metres high
    kerbs = (7.2, -6.6)
    lines = ((1.75, True), (-2.1, False))

    def alongside(self, rng: np.random.Generator) -> Iterator[Mesh]:
        """The walls."""
        way = np.arange(self.course.metres[0], self.course.metres[-1], STEP)
        for kerb, out in zip(self.kerbs, (1, -1), strict=True):
            near, far = kerb + out * PAVEMENT, kerb + out * (PAVEMENT + 0.4)
            section = [(near, 0.0), (near, self.WALL), (far, self.WALL), (far, 0.0)]
            nodes = [Node(left, height, "concrete") for left, height in section]
            yield from swept(self.course, nodes, way)

    def parked(self, rng: np.random.Generator) -> Iterator[Mesh]:
        """The row of lorries, and cars along the left kerb."""
        way = self.course.metres[0] + 4
        while way < self.course.metres[-1] - 20:
            lorry = lorries.lorry(rng)
            length = lorries.length_of(lorry)
            yield self.course.laid(lorry, way + length / 2, -self.ASIDE - lorries.WIDTH / 2)
            way += length + rng.uniform(1.2, 3.0)
        way = self.course.metres[0] + 4
        while way < self.course.metres[-1] - 6:
            if rng.random() < 0.5:
                yield self.course.laid(vehicles.car(rng), way + 2.5, self.kerbs[0] - 1.15, np.pi + rng.normal(0, 0.02))
            way += rng.uniform(5.8, 8.0)

    def movers(self, rng: np.random.Generator) -> Iterator[Mover]:
        """A car ahead, and oncoming ones."""
        yield Mover(vehicles.car(rng), self.drive.way + 17.0, 0.0, False, 5.0)
        way, speed = 30.0, 9.0
        while way < self.drive.way[-1] * 2.2 + BEYOND:
            yield Mover(vehicles.car(rng), way - speed * self.drive.stamps, 3.6, True, 6.0)
            way += rng.uniform(35, 70)


class AvenueScene(StreetScene):
    """A `Scene` with three dense lanes in the car's direction, the car in the middle one, and two oncoming lanes."""

    kerbs = (14.3, -5.7)
    lines = ((1.75, True), (-1.75, True), (5.3, False), (5.6, False), (9.1, True))
    GAP = (5.0, 9.0)  # metres between bumpers
    DRIFT: ClassVar[dict[float, float]] = {3.5: 0.5, 0.0: 0.0, -3.5: -0.45}  # m/s that a lane is faster than the car
    BESIDE = 5.0  # metres ahead and behind that count as beside the car
    LORRIES = 0.45  # share of the vehicles elsewhere

    def alongside(self, rng: np.random.Generator) -> Iterator[Mesh]:
        """Houses, and what is on the pavements."""
        yield from self._houses(rng)
        yield from self._kerbside(rng)

    def movers(self, rng: np.random.Generator) -> Iterator[Mover]:
        """Lanes that move as the car does, and the oncoming ones."""
        for left in self.DRIFT:
            yield from self._lane(left, rng)
        stamps = self.drive.stamps
        for left, speed in ((7.4, 11.5), (10.9, 9.5)):
            way = rng.uniform(10, 60)
            while way < self.drive.way[-1] + speed * stamps[-1] + BEYOND:
                yield Mover(vehicles.car(rng), way - speed * stamps, left + rng.normal(0, 0.1), True, 8.0)
                way += rng.uniform(40, 120)

    def _lane(self, left: float, rng: np.random.Generator) -> Iterator[Mover]:
        """From behind the car to ahead of it, each vehicle swaying in its gap; next to it there are only cars."""
        stamps, way = self.drive.stamps, -SIGHT - rng.uniform(0, 10)
        while way < SIGHT:
            beside = left != 0.0 and -self.BESIDE - 16.5 < way < self.BESIDE
            mesh = lorries.lorry(rng) if rng.random() < self.LORRIES and not beside else vehicles.car(rng)
            length = lorries.length_of(mesh)
            way += length / 2
            wave = rng.uniform(0.3, 0.8) * np.sin(rng.uniform(0.2, 0.45) * stamps + rng.uniform(0, 2 * np.pi))
            moved = self.drive.way + self.DRIFT[left] * (stamps - stamps.mean()) + wave
            if left or abs(way) > length / 2 + 6.0:  # it is not where the car itself is
                yield Mover(mesh, moved + way, left + rng.normal(0, 0.1), False, length + 2.0)
            way += length / 2 + rng.uniform(*self.GAP)

    def _houses(self, rng: np.random.Generator) -> Iterator[Mesh]:
        """Wall to wall, but for a gap now and then."""
        for kerb, out in zip(self.kerbs, (1, -1), strict=True):
            way, storeys = self.course.metres[0] + 2, int(rng.integers(2, 5))
            while way < self.course.metres[-1] - 18:
                width, depth = rng.uniform(9, 16), rng.uniform(9, 13)
                house = building(rng, width, depth, int(np.clip(storeys + rng.integers(-1, 2), 1, 5)))
                turn = 0.0 if out > 0 else np.pi
                yield self.course.laid(house, way + width / 2, kerb + out * (PAVEMENT + 0.05), turn)
                way += width + (rng.uniform(4, 9) if rng.random() < 0.15 else 0.0)

    def _kerbside(self, rng: np.random.Generator) -> Iterator[Mesh]:
        """Lamps, trees and signs on both pavements."""
        lamp, tree = furniture.lamp(rng), vegetation.deciduous(rng)
        signs = [furniture.sign(rng) for _ in range(6)]
        for kerb, out in zip(self.kerbs, (1, -1), strict=True):
            turn = 0.0 if out > 0 else np.pi
            for way in np.arange(self.course.metres[0] + 5 + 15 * (out > 0), self.course.metres[-1] - 2, 30.0):
                yield self.course.laid(lamp, way, kerb + out * 0.5, turn, KERB)
            for way in np.arange(self.course.metres[0] + 12, self.course.metres[-1] - 2, 17.0):
                if rng.random() < 0.35:
                    grown = tree.placed(0, 0, 0, rng.uniform(0, 6.28), rng.uniform(0.5, 0.65))
                    yield self.course.laid(grown, way, kerb + out * 0.9, 0.0, KERB)
                elif rng.random() < 0.3:
                    yield self.course.laid(pick(rng, signs), way, kerb + out * 0.45, turn + out * np.pi / 2, KERB)
