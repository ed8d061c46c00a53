"""Ray casting by Open3D, half as fast: used where embreex has no wheel (Linux on ARM) or the CPU has no AVX."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import open3d as o3d

from slam.data.cloud import Array


class TriangleScene:
    """See `embree.TriangleScene`."""

    def __init__(self, vertices: Array, triangles: Array) -> None:
        self._count = len(triangles)
        self.scene: Any = o3d.t.geometry.RaycastingScene()
        self.scene.add_triangles(
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(vertices, np.float32)),
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(triangles, np.uint32)),
        )

    def __len__(self) -> int:
        return self._count


class RayCaster:
    """See `caster.RayCaster`."""

    def __init__(self, scenes: Sequence[TriangleScene], centre: Array) -> None:
        self._scenes, self._centre = tuple(scenes), centre

    def cast(self, origin: Array, direction: Array, order: Array | None = None) -> tuple[Array, Array, Array]:
        """Find the first triangle hit by each ray; the order has no effect."""
        del order
        rays, first = self._rays(origin, direction), 0
        reach = np.full(len(direction), np.inf, np.float32)
        triangle, normal = np.full(len(direction), -1, np.int32), np.zeros((len(direction), 3), np.float32)
        for scene in self._scenes:
            found = scene.scene.cast_rays(rays, nthreads=1)
            distance = found["t_hit"].numpy()
            nearer = distance < reach
            reach[nearer] = distance[nearer]
            triangle[nearer] = found["primitive_ids"].numpy().astype(np.int32)[nearer] + first
            normal[nearer] = found["primitive_normals"].numpy()[nearer]
            first += len(scene)
        return reach, triangle, normal

    def hidden(self, origin: Array, direction: Array, alike: bool = True) -> Array:
        """Check which rays (N,) bool hit anything, at any distance."""
        del alike
        rays, found = self._rays(origin, direction), np.zeros(len(direction), bool)
        for scene in self._scenes:
            found |= scene.scene.test_occlusions(rays, nthreads=1).numpy()
        return found

    def _rays(self, origin: Array, direction: Array) -> Any:
        start = np.broadcast_to((np.atleast_2d(origin) - self._centre).astype(np.float32), direction.shape)
        return o3d.core.Tensor.from_numpy(np.ascontiguousarray(np.hstack([start, direction]), np.float32))
