"""Streets along a drive: their centre lines, and their surface of asphalt, markings, kerbs and pavements."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from slam.data.cloud import Array
from slam.simulation.course import Road, driven_line
from slam.simulation.drives import LANE, Drive
from slam.simulation.mesh import Mesh, joined, quads
from slam.simulation.terrain import Terrain, noise

HALF_WIDTH = 5.4  # metres from the middle of a road to its kerbs: a lane and a row of parked cars
PAVEMENT = 2.3  # metres from the kerb to the gardens and houses
OUTSKIRTS = 70.0  # metres that a street goes on before and after the drive
PIECE = 24  # metres of street in one mesh

#: Across a road from left to right: offset [m], height [m], and the material up to the next point.
_SIDE = (
    (HALF_WIDTH + PAVEMENT, 0.04, "paving"),
    (HALF_WIDTH + 0.15, 0.04, "kerb"),
    (HALF_WIDTH, 0.04, "kerb"),
    (HALF_WIDTH, -0.08, "asphalt"),
    (3.25, -0.03, "marking"),
    (3.15, -0.03, "asphalt"),
)
_MIRRORED = [(-_SIDE[i][0], _SIDE[i][1], _SIDE[i - 1][2]) for i in range(len(_SIDE) - 1, 0, -1)]
PROFILE = (*_SIDE, (0.06, 0.0, "marking"), (-0.06, 0.0, "asphalt"), *_MIRRORED, (-_SIDE[0][0], _SIDE[0][1], ""))
ROUGH = 0.012  # metres that the surface is uneven by
DASH = 3  # metres of the middle line, and of the gap after it


class Streets:
    """The roads of a town, and how far a place is from them."""

    def __init__(self, drive: Drive, rng: np.random.Generator) -> None:
        self.path = driven_line(drive, OUTSKIRTS)
        self.roads = _without_repeats(Road(self.path).left * LANE + self.path)
        self.roads += _side_streets(self.roads, rng, drive.tunnel)
        self._points = np.concatenate([road.line for road in self.roads])
        self._road = np.repeat(np.arange(len(self.roads)), [len(road.line) for road in self.roads])
        self._metre = np.concatenate([np.arange(len(road.line)) for road in self.roads])
        self._tree = cKDTree(self._points)

    def distance(self, places: Array) -> Array:
        """Return the distance (N,) [m] of places (N, 2) to the nearest centre line."""
        return np.asarray(self._tree.query(places)[0])

    def distance_to_others(self, places: Array, road: int, metre: Array, before: bool = False) -> Array:
        """Return the distance (N,) [m] of places on a road to other roads, and to distant parts of the same road.

        Args:
            places: (N, 2).
            road: Number of the road.
            metre: (N,) position of the places along it [m].
            before: Consider earlier roads of the list only.
        """
        distances, found = self._tree.query(places, k=60, distance_upper_bound=HALF_WIDTH + 1.0)
        found = np.minimum(found, len(self._points) - 1)
        own = (self._road[found] == road) & (np.abs(self._metre[found] - metre[:, None]) < 6 * HALF_WIDTH)
        if before:
            own |= self._road[found] >= road
        return np.asarray(np.where(own, np.inf, distances).min(axis=1))

    def surface(self, terrain: Terrain) -> Iterator[Mesh]:
        """The roads' meshes, each PIECE long; where roads meet, kerbs and pavements stop."""
        for number, road in enumerate(self.roads):
            for start in range(0, len(road.line) - 1, PIECE):
                mesh = self._piece(number, road, range(start, min(start + PIECE, len(road.line) - 1)), terrain)
                if len(mesh):
                    yield mesh

    def _piece(self, number: int, road: Road, metres: range, terrain: Terrain) -> Mesh:
        rows = np.arange(metres.start, metres.stop + 1)
        metre = rows[:-1]
        offsets = np.array([offset for offset, _, _ in PROFILE])
        nodes = terrain.lifted(road.line[rows, None] + offsets[:, None] * road.left[rows, None])
        nodes[..., 2] += [height for _, height, _ in PROFILE]
        nodes[..., 2] += ROUGH * noise(nodes[..., 0] / 0.7, nodes[..., 1] / 0.7, 0)
        corners = np.stack([nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]], axis=2)
        places, at = nodes[..., :2].reshape(-1, 2), np.repeat(rows, len(PROFILE))
        before = self.distance_to_others(places, number, at, before=True)
        covered = before.reshape(nodes.shape[:2]) < HALF_WIDTH
        hidden = covered[:-1, :-1] & covered[1:, :-1] & covered[1:, 1:] & covered[:-1, 1:]
        parts = []
        for strip, (_, _, material) in enumerate(PROFILE[:-1]):
            strip_corners = corners[:, strip]
            centre = strip_corners[:, :, :2].mean(axis=1)
            clear = self.distance_to_others(centre, number, metre) > HALF_WIDTH - 0.02
            if material in ("kerb", "paving"):
                parts.append(quads(strip_corners[clear], material))
                continue
            kept = ~hidden[:, strip]  # of two streets that cross, the earlier has the crossing
            painted = kept & clear & (material == "marking")
            if abs(offsets[strip]) < 1:
                painted &= (metre // DASH) % 2 == 0
            parts += [quads(strip_corners[painted], "marking"), quads(strip_corners[kept & ~painted], "asphalt")]
        return joined(parts)


def _without_repeats(line: Array) -> list[Road]:
    """The road along a line, in parts: without what lies on an earlier part of it."""
    direction = Road(line).direction
    repeated = np.zeros(len(line), bool)
    for index, near in enumerate(cKDTree(line).query_ball_point(line, 2.5)):
        earlier = [other for other in near if other < index - 25 and not repeated[other]]
        repeated[index] = any(abs(direction[index] @ direction[other]) > 0.8 for other in earlier)
    ends = np.flatnonzero(np.diff(np.concatenate([[True], repeated, [True]]).astype(int)))
    runs = [(max(start - 3, 0), min(stop + 3, len(line))) for start, stop in ends.reshape(-1, 2)]
    return [Road(line[start:stop]) for start, stop in runs if stop - start > 8]


def _side_streets(roads: list[Road], rng: np.random.Generator, tunnel: tuple[float, float] | None) -> list[Road]:
    """Streets to the left and right, as far as they keep clear of the roads that there are."""
    streets: list[Road] = []
    for road in roads:
        metre = int(rng.integers(20, 60))
        while metre < len(road.line) - 10:
            for side in (-1, 1):
                if rng.random() < 0.6 and not _in_tunnel(metre, tunnel):
                    street = _side_street(road, metre, side, [*roads, *streets], rng)
                    streets += [street] if street else []
            metre += int(rng.integers(45, 90))
    return streets


def _side_street(road: Road, metre: int, side: int, others: list[Road], rng: np.random.Generator) -> Road | None:
    """One street off a road, a little bent, or None where there is no room for 25 m of it."""
    heading = np.arctan2(*(side * road.left[metre])[::-1]) + rng.normal(0, 0.08)
    bend = rng.normal(0, 0.003)
    along = np.arange(rng.integers(50, 110))
    angle = heading + bend * along
    line = road.line[metre] + np.cumsum(np.column_stack([np.cos(angle), np.sin(angle)]), axis=0)
    away = along > 2.5 * HALF_WIDTH
    near = cKDTree(np.concatenate([other.line for other in others])).query(line)[0]
    blocked = away & ((near < 3 * HALF_WIDTH) & (near < along - HALF_WIDTH))
    length = int(np.argmax(blocked)) if blocked.any() else len(line)
    return Road(line[:length]) if length >= 25 else None


def _in_tunnel(metre: int, tunnel: tuple[float, float] | None) -> bool:
    return tunnel is not None and tunnel[0] - 30 < metre - OUTSKIRTS < tunnel[1] + 30
