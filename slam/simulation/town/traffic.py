"""Traffic of the town: other cars, and people on the pavements."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array
from slam.simulation.course import Course
from slam.simulation.drives import LANE, Drive
from slam.simulation.mesh import Mesh
from slam.simulation.town.roadside import Stock
from slam.simulation.town.streets import HALF_WIDTH, OUTSKIRTS
from slam.simulation.town.town import Town
from slam.simulation.traffic import Mover, Traffic

CAR, PERSON = 5.0, 1.0  # metres that they keep from each other


class TownTraffic(Traffic):
    """Cars ahead, behind and oncoming, people walking; none of them runs into another or into the driven car."""

    @staticmethod
    def of(drive: Drive, town: Town, rng: np.random.Generator) -> TownTraffic:
        """The traffic of a town."""
        course = Course.of(drive, town.terrain, OUTSKIRTS)
        return TownTraffic(
            drive, course, [m for some in (_queue, _oncoming, _walkers) for m in some(drive, town.stock, rng)]
        )

    def free(self, mover: Mover, places: Array) -> bool:
        """Check whether a mover keeps its distance from all others, since the path may cross itself."""
        near = np.linalg.norm(places - self.drive.position[:, :2], axis=1) < mover.room - 2.2
        for other, there in zip(self.movers, self.places, strict=True):
            near |= np.linalg.norm(places - there, axis=1) < min(mover.room, other.room)
        return not near.any()


def _queue(drive: Drive, stock: Stock, rng: np.random.Generator) -> list[Mover]:
    """Cars in the same lane: they drive as the car itself does, a little sooner or later."""
    places = [-2, -1, 1, 2, 3, 4, 5, 6] if drive.jam else [place for place in (-1, 1, 2) if rng.random() < 0.7]
    movers = []
    for place in places:
        lead = place * (0.4 if drive.jam else rng.uniform(1.3, 2.2))  # seconds
        gap = place * (7.0 if drive.jam else 6.5)
        frames = np.clip(np.arange(len(drive)) + drive.rate * lead, 0, len(drive) - 1)
        way = np.interp(frames, np.arange(len(drive)), drive.way) + gap
        beyond = np.arange(len(drive)) + drive.rate * lead - frames  # frames before the first or after the last
        step = np.diff(drive.way)[[0, -1]]
        way += np.where(beyond < 0, step[0], step[1]) * beyond
        movers.append(Mover(_car(stock, rng), way, rng.normal(0, 0.1), False, CAR))
    return movers


def _oncoming(drive: Drive, stock: Stock, rng: np.random.Generator) -> list[Mover]:
    """Cars in the other lane."""
    speed = rng.uniform(1.5, 3.0) if drive.jam else rng.uniform(7.0, 11.0)
    last = drive.way[-1] + speed * drive.stamps[-1] + OUTSKIRTS
    movers, way = [], rng.uniform(10, 60)
    while way < last:
        movers.append(Mover(_car(stock, rng), way - speed * drive.stamps, 2 * LANE + rng.normal(0, 0.1), True, CAR))
        way += rng.uniform(8, 20) if drive.jam else rng.uniform(35, 150)
    return movers


def _walkers(drive: Drive, stock: Stock, rng: np.random.Generator) -> list[Mover]:
    """People on both pavements."""
    movers = []
    for way in rng.uniform(0, drive.way[-1], rng.poisson(drive.way[-1] / 40)):
        side, reverse = rng.choice([-1, 1]), bool(rng.random() < 0.5)
        pace = rng.uniform(0.9, 1.6) * (-1 if reverse else 1)
        left = LANE + side * (HALF_WIDTH + rng.uniform(1.0, 1.7))
        person = stock.people[rng.integers(len(stock.people))]
        movers.append(Mover(person, way + pace * (drive.stamps - drive.stamps.mean()), left, reverse, PERSON))
    return movers


def _car(stock: Stock, rng: np.random.Generator) -> Mesh:
    return stock.cars[rng.integers(len(stock.cars))]
