"""What stands around the car at one moment, ready for rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import open3d as o3d

from slam.data.cloud import Array
from slam.simulation import kernels
from slam.simulation.mesh import Mesh, joined


@dataclass(frozen=True, eq=False)
class Hits:
    """Where N rays end first.

    reach     (N,) float32: in units of the ray's direction; inf where it meets nothing
    triangle  (N,) int32, index into `World.material` and `World.colour`; -1 where it meets nothing
    normal    (N, 3) float32, of unit length, on either side of the surface
    """

    reach: Array
    triangle: Array
    normal: Array


class World:
    """Standing and moving triangles. Rays are given and answered in the coordinates of the meshes.

    material  (T,) uint8 and colour (T, 3) uint8 of all triangles, those of the standing ones first
    """

    def __init__(self, standing: StandingWorld, moving: Sequence[Mesh] = ()) -> None:
        self._standing = standing
        self._moving = _Scene(joined(moving), standing.scene.centre) if moving else None
        self._around = np.array([_sphere(mesh, standing.scene.centre) for mesh in moving], np.float32).T.copy()
        self.material = np.concatenate([mesh.material for mesh in (standing.mesh, *moving)])
        self.colour = np.concatenate([mesh.colour for mesh in (standing.mesh, *moving)])

    def cast(self, origin: Array, direction: Array) -> Hits:
        """The first triangle that each ray meets: origin (3,) or (N, 3), direction (N, 3) of any length but zero."""
        rays = self._standing.scene.rays(origin, direction)
        hits = self._standing.scene.cast(rays)
        if self._moving is not None:
            near = kernels.rays_near(rays, self._around)
            over = self._moving.cast(rays[near])
            nearer = over.reach < hits.reach[near]
            at = near[nearer]
            hits.reach[at], hits.normal[at] = over.reach[nearer], over.normal[nearer]
            hits.triangle[at] = over.triangle[nearer] + len(self._standing.mesh)
        return hits

    def hidden(self, origin: Array, direction: Array) -> Array:
        """(N,) bool: whether anything stands in a ray's way, at whatever distance."""
        rays = self._standing.scene.rays(origin, direction)
        found = self._standing.scene.hidden(rays)
        if self._moving is not None:
            near = kernels.rays_near(rays, self._around)
            found[near] |= self._moving.hidden(rays[near])
        return found


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

    def rays(self, origin: Array, direction: Array) -> Array:
        """(N, 6) float32, as Open3D takes them."""
        return np.asarray(kernels.rays(np.atleast_2d(origin), direction, self.centre))

    def cast(self, rays: Array) -> Hits:
        answer = self._scene.cast_rays(o3d.core.Tensor.from_numpy(rays), nthreads=1)
        triangle = answer["primitive_ids"].numpy().view(np.int32)  # no triangle: all bits set, which is -1
        return Hits(answer["t_hit"].numpy(), triangle, answer["primitive_normals"].numpy())

    def hidden(self, rays: Array) -> Array:
        return np.array(self._scene.test_occlusions(o3d.core.Tensor.from_numpy(rays), nthreads=1).numpy())


def _sphere(mesh: Mesh, centre: Array) -> Array:
    """Around the middle of a mesh's bounds: x, y, z from `centre`, radius."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return np.append((low + high) / 2 - centre, np.linalg.norm(high - low) / 2 + 0.01)
