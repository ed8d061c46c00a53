"""A bridge high above a river, the same span again and again."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from slam.simulation.course import Course
from slam.simulation.driven_scene import DrivenScene
from slam.simulation.mesh import Mesh, box, cylinder, joined, quads
from slam.simulation.parts import Parts
from slam.simulation.roads.surface import Node, carriageway, stripe, swept
from slam.simulation.traffic import Traffic

BEYOND = 210.0  # metres of bridge before and after the drive: more than any LiDAR sees
POSTS = 2.0  # metres between the posts of the railings
HIGH = 70.0  # metres above the water, from where no echo comes
LEFT, RIGHT = 5.6, -2.1  # edges of the carriageway, seen from the middle of the car's lane
WALK = 1.6  # metres, of pavement on either side
STEP = 2.0


class BridgeScene(DrivenScene):
    """A `Scene` on a level, straight bridge with identical spans of length `Drive.period`."""

    hills = 0.0

    @cached_property
    def standing(self) -> Parts:
        """The deck with railings and lamps, the piers, and the water."""
        course = Course.of(self.drive, self.terrain, BEYOND)
        return Parts(part for make in (_deck, self._spans, _water) for part in make(course))

    @cached_property
    def traffic(self) -> Traffic:
        """No traffic."""
        return Traffic(self.drive, Course.of(self.drive, self.terrain, BEYOND), [])

    def _spans(self, course: Course) -> Iterator[Mesh]:
        assert self.drive.period is not None
        span = _span(self.drive.period)
        first = np.ceil(course.metres[0] / self.drive.period) * self.drive.period
        for way in np.arange(first, course.metres[-1] - self.drive.period, self.drive.period):
            yield course.laid(span, way, (LEFT + RIGHT) / 2)


def _deck(course: Course) -> Iterator[Mesh]:
    way = np.arange(course.metres[0], course.metres[-1], STEP)
    yield from carriageway(course, (LEFT, RIGHT), way, rough=False)
    for left, dashed in ((LEFT - 0.3, False), ((LEFT + RIGHT) / 2, True), (RIGHT + 0.3, False)):
        yield from stripe(course, left, way, dashed)
    for kerb, out in ((LEFT, 1), (RIGHT, -1)):
        edge = kerb + out * WALK
        side = [Node(kerb, 0.0, "kerb"), Node(kerb, 0.14, "kerb"), Node(kerb + out * 0.15, 0.14, "concrete"),
                Node(edge, 0.14, "concrete"), Node(edge, -1.8, "concrete"), Node(kerb, -2.6, "concrete")]  # fmt: skip
        yield from swept(course, side, way)
    yield from swept(course, [Node(LEFT, -2.6, "concrete"), Node(RIGHT, -2.6, "concrete")], way)


def _span(length: float) -> Mesh:
    """From a pier on the origin along +x: railings on both sides, a pair of lamps, the pier."""
    half = (LEFT - RIGHT) / 2 + WALK - 0.12
    parts = []
    for side in (-1, 1):
        post = box((0.08, 0.1, 1.1), "metal", (84, 96, 92)).placed(0, side * half, 0.14)
        parts += [post.placed(at, 0, 0) for at in np.arange(0.0, length, POSTS)]
        for high, thick in ((0.25, 0.04), (0.55, 0.04), (0.85, 0.04), (1.18, 0.08)):
            rail = box((length, thick, thick), "metal", (84, 96, 92))
            parts.append(rail.placed(length / 2, side * half, 0.14 + high - thick))
        mast = [(0.0, side * (half + 0.25), z) for z in (-0.4, 7.4)] + [(0.0, side * (half - 1.6), 8.1)]
        parts.append(cylinder([0.11, 0.07, 0.05], mast, 8, "metal"))
        parts.append(box((0.3, 0.8, 0.12), "metal").placed(0, side * (half - 1.9), 8.05))
    parts.append(box((2.2, 2 * half - 2, HIGH), "concrete").placed(0, 0, -2.6 - HIGH))
    return joined(parts)


def _water(course: Course) -> Iterator[Mesh]:
    """Flat to the horizon."""
    middle = course.places(np.array(course.metres.mean()), 0.0)
    corners = middle + 4000.0 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    yield quads(np.column_stack([corners, np.full(4, -HIGH)]), "glass", (64, 84, 92))
