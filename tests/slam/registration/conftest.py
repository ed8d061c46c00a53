"""Synthetic rooms for registration: rectangles, sampled again for every scan."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from slam.data import se3
from slam.data.cloud import Array

Box = tuple[float, float, float, float, float, float]  # minimum x, y, z, maximum x, y, z
Sampler = Callable[..., Array]

#: A hall with three crates in it; no wall lies on the border of a 1 m cell.
HALL: Sequence[Box] = (
    (-9.6, -7.4, -1.7, 10.3, 8.6, 3.4),
    (2.3, 1.4, -1.7, 4.6, 3.7, 0.4),
    (-6.2, -5.3, -1.7, -4.4, -2.6, 1.3),
    (5.4, -5.6, -1.7, 6.7, -4.3, 2.6),
)


def rectangles(box: Box) -> list[tuple[Array, Array, Array]]:
    """Corner and two edges of each of a box's six faces."""
    low, high = np.array(box[:3]), np.array(box[3:])
    faces = []
    for axis in range(3):
        u, v = np.zeros(3), np.zeros(3)
        a, b = (axis + 1) % 3, (axis + 2) % 3
        u[a], v[b] = (high - low)[a], (high - low)[b]
        far = low.copy()
        far[axis] = high[axis]
        faces += [(low, u, v), (far, u, v)]
    return faces


def sampled(faces: list[tuple[Array, Array, Array]], density: float, seed: int, noise: float) -> Array:
    rng, points = np.random.default_rng(seed), []
    for corner, u, v in faces:
        count = int(density * np.linalg.norm(u) * np.linalg.norm(v))
        a, b = rng.random((2, count, 1))
        points.append(corner + a * u + b * v)
    xyz = np.concatenate(points)
    return xyz + rng.normal(0, noise, xyz.shape)


@pytest.fixture(scope="session")
def hall() -> Sampler:
    """`hall(seed, pose, density)`: points (N, 3) float32 of the hall as seen from `pose`, with 1 cm noise."""

    def scan(seed: int, pose: Array | None = None, density: float = 10.0) -> Array:
        faces = [face for box in HALL for face in rectangles(box)]
        return seen(sampled(faces, density, seed, 0.01), pose)

    return scan


@pytest.fixture(scope="session")
def corridor() -> Sampler:
    """As `hall`, of a corridor along x without ends within the range of 20 m."""

    def scan(seed: int, pose: Array | None = None, density: float = 20.0) -> Array:
        faces = [face for face in rectangles((-40, -2.4, -1.7, 40, 2.6, 2.3)) if face[1][0] or face[2][0]]
        xyz = seen(sampled(faces, density, seed, 0.01), pose)
        return xyz[np.linalg.norm(xyz, axis=1) < 20]

    return scan


def seen(xyz: Array, pose: Array | None) -> Array:
    if pose is not None:
        back = se3.inverse(pose)
        xyz = xyz @ back[:3, :3].T + back[:3, 3]
    return xyz.astype(np.float32)
