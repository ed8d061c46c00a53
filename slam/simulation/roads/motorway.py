"""A motorway with two lanes per direction and a median, outside of towns."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from slam.data.cloud import Array
from slam.simulation.course import Course
from slam.simulation.driven_scene import DrivenScene
from slam.simulation.drives import Drive
from slam.simulation.mesh import Colour, Mesh, box, joined, quads
from slam.simulation.palette import pick
from slam.simulation.parts import Parts
from slam.simulation.roads import lorries
from slam.simulation.roads.surface import Node, carriageway, guard_rail, stripe, swept, verge
from slam.simulation.terrain import noise
from slam.simulation.town import vegetation, vehicles
from slam.simulation.town.buildings import building
from slam.simulation.traffic import Mover, Traffic

BEYOND = 185.0  # metres of motorway before and after the drive
STEP = 2.0  # metres between nodes of surfaces
# Seen from the middle of the car's lane, the left one: metres to the left.
LANES = {-3.75: False, 0.0: False, 9.2: True, 12.95: True}  # of the four lanes, and whether they are oncoming
OWN_ROAD, OTHER_ROAD = (2.6, -8.4), (17.6, 6.6)  # asphalt with the hard shoulders
RAILS = ((3.1, -1), (6.1, 1), (-9.0, 1), (18.2, -1))  # and to which side their beams look
EDGES = ((1.95, False), (-1.875, True), (-5.7, False), (7.25, False), (11.075, True), (14.9, False))
BARRIER = (0.62, 0.86)  # shares of the travelled distance between which a noise barrier is on the right
CUTTING = (0.15, 0.4)  # and between which the road lies in a cutting
GANTRIES = (0.08, 0.5, 0.92)
SPEEDS = {-3.75: (23.0, 26.0), 0.0: (30.0, 30.0), 9.2: (30.0, 37.0), 12.95: (22.5, 26.0)}  # m/s
SIDES = ((OWN_ROAD[1], -1), (OTHER_ROAD[0], 1))  # where the asphalt ends, and the land to the right and to the left
OUT = np.array([0.0, 0.9, 1.7, 4.0, 8.0, 12.0, 20.0, 28.0, 40.0, 56.0, 76.0, 100.0, 130.0])  # metres from there
FALL = np.array([-0.02, -0.03, -0.1, -0.7, -1.3, -1.4, -1.3, -1.2, -1.0, -0.6, 0.0, 0.8, 1.5])
PANEL: Colour = (24, 62, 140)


class MotorwayScene(DrivenScene):
    """A `Scene` on a motorway; gentle grades come from the heights of the drive and from low hills."""

    hills = 0.5

    @cached_property
    def course(self) -> Course:
        """The middle of the car's lane."""
        return Course.of(self.drive, self.terrain, BEYOND)

    @cached_property
    def standing(self) -> Parts:
        """Roads, rails and signs, and the country beside them."""
        rng = np.random.default_rng([self.seed, 1])
        length = float(self.drive.way[-1])
        parts = [*_roads(self.course), *_country(self.course, length, self.seed), *_barrier(self.course, length)]
        return Parts([*parts, *_signs(self.course, length, rng), *_beside(self.course, length, rng)])

    @cached_property
    def traffic(self) -> Traffic:
        """Cars and lorries in all lanes."""
        return Traffic(self.drive, self.course, _movers(self.drive, np.random.default_rng([self.seed, 2])))


def _roads(course: Course) -> Iterator[Mesh]:
    way = np.arange(course.metres[0], course.metres[-1], STEP)
    for edges in (OWN_ROAD, OTHER_ROAD):
        yield from carriageway(course, edges, way)
    for left, dashed in EDGES:
        yield from stripe(course, left, way, dashed)
    for left, facing in RAILS:
        yield from guard_rail(course, left, facing, way)


def _country(course: Course, length: float, seed: int) -> Iterator[Mesh]:
    """The median, and the land on either side."""
    way = np.arange(course.metres[0], course.metres[-1], STEP)
    for edge, out in ((OTHER_ROAD[1], -1), (OWN_ROAD[0], 1)):
        half = edge + out * np.array([0.0, 1.0, 2.0])
        yield from verge(course, half, way, np.tile([-0.02, 0.08, 0.1], (len(way), 1)), seed)
    for edge, side in SIDES:
        yield from verge(course, edge + side * OUT, way, _land(way[:, None], OUT, length), seed + side)


def _land(way: Array | float, out: Array | float, length: float) -> Array:
    """Metres above the road, so far `out` from its asphalt: it falls from there, but rises to a cutting's slopes."""
    at = np.asarray(way) / length
    cutting = np.clip(10 * np.minimum(at - CUTTING[0], CUTTING[1] - at), 0, 1)
    swell = 0.9 * noise(np.asarray(way) / 60.0, np.zeros(np.shape(way)), 5)
    slope = np.clip(np.asarray(out) / 12.0, 0, 1)
    return np.asarray(np.interp(out, OUT, FALL) + slope * (6.0 * cutting + swell))


def _barrier(course: Course, length: float) -> Iterator[Mesh]:
    """Panels between steel posts every 5 m, 3.5 m high, behind the rail on the right."""
    left = OWN_ROAD[1] - 2.4
    post = box((0.2, 0.24, 4.2), "metal", (92, 98, 96)).placed(0, 0, -0.7)
    first, last = (round(share * length / 5) * 5 for share in BARRIER)
    for number, at in enumerate(np.arange(first, last + 1, 5.0)):
        yield course.laid(post, at, left)
        if at < last:
            tint: Colour = (132, 150, 128) if number % 4 else (150, 158, 150)
            panel = [Node(left + aside, z, "concrete", tint) for aside, z in ((0.07, -0.7), (0.07, 3.4), (-0.07, 3.4))]
            yield from swept(course, [*panel, Node(left - 0.07, -0.7, "concrete")], np.array([at, at + 5.0]))


def _signs(course: Course, length: float, rng: np.random.Generator) -> Iterator[Mesh]:
    """Gantries over the own road, a sign now and then, and reflector posts every 50 m."""
    for share in GANTRIES:
        yield course.laid(_gantry(rng), share * length, 0.0)
    marker = joined(
        [
            box((0.1, 0.12, 1.3), "plaster", (232, 232, 230)).placed(0, 0, -0.25),
            box((0.004, 0.06, 0.18), "sign").placed(-0.054, 0, 0.72),
            box((0.004, 0.06, 0.18), "sign").placed(0.054, 0, 0.72),
        ]
    )
    for way in np.arange(np.ceil(course.metres[0] / 50) * 50, course.metres[-1] - 1, 50.0):
        for left in (OWN_ROAD[1] - 1.0, OTHER_ROAD[0] + 1.0):
            yield course.laid(marker, way, left, rise=-0.05)
    for way in np.arange(course.metres[0] + 20, course.metres[-1] - 20, 1.0):
        if rng.random() < 0.012:
            yield course.laid(_board(rng), way, OWN_ROAD[1] - 1.6, rise=-0.1)
        if rng.random() < 0.012:
            yield course.laid(_board(rng), way, OTHER_ROAD[0] + 1.6, np.pi, -0.1)


def _gantry(rng: np.random.Generator) -> Mesh:
    """A beam over both lanes and the hard shoulder, on a post behind either rail, with panels that face those who come.

    x runs ahead; the car's lane is at y = 0.
    """
    left, right, low = 4.6, OWN_ROAD[1] - 1.4, 5.6
    middle, span = (left + right) / 2, left - right
    parts = [box((0.35, 0.35, low + 1.6), "metal").placed(0, y, -0.6) for y in (left, right)]
    parts += [box((0.18, span, 0.18), "metal").placed(x, middle, z) for x in (-0.3, 0.3) for z in (low, low + 0.9)]
    for y in np.arange(right + 0.6, left, 1.2):
        parts.append(box((0.7, 0.08, 0.98), "metal").placed(0, y, low + 0.05))
    for y, width in ((0.0, 3.2), (-3.75, 3.0), (-7.4, 2.4)):
        height = rng.uniform(2.0, 2.9)
        parts.append(_panel(width, height, low - 0.3).placed(-0.45, y, 0))
    return joined(parts)


def _board(rng: np.random.Generator) -> Mesh:
    """A sign of one to three metres on two posts, facing those who come."""
    width, height, low = rng.uniform(0.9, 3.0), rng.uniform(0.9, 2.2), rng.uniform(1.3, 1.8)
    posts = [box((0.09, 0.09, low + height + 0.6), "metal").placed(0, y, -0.7) for y in (-0.3 * width, 0.3 * width)]
    return joined([*posts, _panel(width, height, low).placed(-0.07, 0, 0)])


def _panel(width: float, height: float, low: float) -> Mesh:
    """Facing -x: a white rim, the blue field, white strokes for writing; grey behind."""
    y, z = np.array([0.5, -0.5, -0.5, 0.5]), np.array([0.0, 0.0, 1.0, 1.0])

    def plate(x: float, across: float, up: float, centre: tuple[float, float]) -> Array:
        return np.column_stack([np.full(4, x), centre[0] + across * y, centre[1] + up * (z - 0.5)])

    middle = low + height / 2
    rows = np.linspace(-0.28, 0.28, 3) * height
    writing = [plate(-0.05, 0.62 * width, 0.09 * height, (0.0, middle + row)) for row in rows]
    return joined(
        [
            box((0.04, width, height), "metal").placed(0, 0, low),
            quads(plate(-0.03, width, height, (0.0, middle)), "sign"),
            quads(plate(-0.04, width - 0.12, height - 0.12, (0.0, middle)), "sign", PANEL),
            quads(np.array(writing), "sign"),
        ]
    )


def _beside(course: Course, length: float, rng: np.random.Generator) -> Iterator[Mesh]:
    """Bushes on the slopes, and a few trees and houses."""
    trees, bushes = [vegetation.tree(rng) for _ in range(8)], [vegetation.bush(rng) for _ in range(4)]
    for way in np.arange(course.metres[0] + 5, course.metres[-1] - 5, 4.0):
        for edge, side in SIDES:
            chance = rng.random()
            if chance < 0.4:
                tall = chance < 0.14
                plant, out = pick(rng, trees if tall else bushes), rng.uniform(26, 75) if tall else rng.uniform(6, 24)
                rise = float(_land(way, out, length)) - 0.1
                turn, size = rng.uniform(0, 2 * np.pi), rng.uniform(0.7, 1.4)
                yield course.laid(plant.placed(0, 0, 0, 0.0, size), way, edge + side * out, turn, rise)
    for way in rng.uniform(course.metres[0] + 20, course.metres[-1] - 20, 6):
        edge, side = pick(rng, SIDES)
        house = building(rng, rng.uniform(10, 16), rng.uniform(9, 12), int(rng.integers(1, 4)))
        out = rng.uniform(70, 95)
        turn = 0.0 if side > 0 else np.pi
        yield course.laid(house, way, edge + side * out, turn, float(_land(way, out, length)))


def _movers(drive: Drive, rng: np.random.Generator) -> Iterator[Mover]:
    """Each lane at its own speed, a vehicle every 25 to 80 m; lorries keep to the right."""
    stock = [vehicles.car(rng) for _ in range(14)]
    trucks = [lorries.lorry(rng) for _ in range(8)]
    span = drive.stamps[-1] * 40.0
    for left, oncoming in LANES.items():
        outer = left in (-3.75, 12.95)
        speed = rng.uniform(*SPEEDS[left])
        way = -span - BEYOND
        while way < drive.way[-1] + span + BEYOND:
            mesh = pick(rng, trucks if outer and rng.random() < 0.55 else stock)
            sign = -1 if oncoming else 1
            yield Mover(mesh, way + sign * speed * drive.stamps, left + rng.normal(0, 0.12), oncoming,
                        lorries.length_of(mesh) + 8.0)  # fmt: skip
            way += rng.uniform(28, 75)
