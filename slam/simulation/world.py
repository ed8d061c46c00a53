"""What stands around the car at one moment, ready for rays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import open3d as o3d

from slam.data.cloud import Array
from slam.simulation.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Hits:
    """Where N rays end first.

    reach     (N,) float32: in units of the ray's direction; inf where it meets nothing
    triangle  (N,) int64, index into `World.material` and `World.colour`; -1 where it meets nothing
    normal    (N, 3) float32, of unit length, on either side of the surface
    """

    reach: Array
    triangle: Array
    normal: Array


class World:
    """Standing and moving triangles. Rays are given and answered in the coordinates of the meshes.

    material  (T,) uint8 and colour (T, 3) uint8 of all triangles, those of the standing ones first
    """

    def __init__(self, standing: StandingWorld, moving: Mesh) -> None:
        self._standing = standing
        self._moving = _Scene(moving, standing.scene.centre) if len(moving) else None
        self.material = np.concatenate([standing.mesh.material, moving.material])
        self.colour = np.concatenate([standing.mesh.colour, moving.colour])

    def cast(self, origin: Array, direction: Array) -> Hits:
        """The first triangle that each ray meets: origin (3,) or (N, 3), direction (N, 3) of any length but zero."""
        rays = self._standing.scene.rays(origin, direction)
        hits = self._standing.scene.cast(rays)
        if self._moving is None:
            return hits
        over = self._moving.cast(rays)
        nearer = np.flatnonzero(over.reach < hits.reach)
        hits.reach[nearer] = over.reach[nearer]
        hits.normal[nearer] = over.normal[nearer]
        hits.triangle[nearer] = over.triangle[nearer] + len(self._standing.mesh)
        return hits

    def hidden(self, origin: Array, direction: Array) -> Array:
        """(N,) bool: whether anything stands in a ray's way, at whatever distance."""
        rays = self._standing.scene.rays(origin, direction)
        found = self._standing.scene.hidden(rays)
        return found if self._moving is None else found | self._moving.hidden(rays)


class StandingWorld:
    """What does not move. Made once for many frames: the tree that rays descend takes a while to build."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.scene = _Scene(mesh, np.round(mesh.vertices.mean(axis=0)))


class _Scene:
    """Open3D's ray casting (Embree) over one mesh, around a centre, for it computes in float32.

    On one thread: whole frames are shared out among cores, which leaves none of them waiting.
    """

    def __init__(self, mesh: Mesh, centre: Array) -> None:
        self.centre = centre
        self._scene: Any = o3d.t.geometry.RaycastingScene()
        vertices: Array = np.ascontiguousarray(mesh.vertices - centre, np.float32)
        triangles: Array = np.ascontiguousarray(mesh.triangles, np.uint32)
        self._scene.add_triangles(o3d.core.Tensor.from_numpy(vertices), o3d.core.Tensor.from_numpy(triangles))

    def rays(self, origin: Array, direction: Array) -> Any:
        rays: Array = np.empty((len(direction), 6), np.float32)
        rays[:, :3], rays[:, 3:] = origin - self.centre, direction
        return o3d.core.Tensor.from_numpy(rays)

    def cast(self, rays: Any) -> Hits:
        answer = self._scene.cast_rays(rays, nthreads=1)
        primitive = answer["primitive_ids"].numpy()
        triangle = np.where(primitive == self._scene.INVALID_ID, -1, primitive.astype(np.int64))
        return Hits(answer["t_hit"].numpy(), triangle, answer["primitive_normals"].numpy())

    def hidden(self, rays: Any) -> Array:
        return np.asarray(self._scene.test_occlusions(rays, nthreads=1).numpy())
