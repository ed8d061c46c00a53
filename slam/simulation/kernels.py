"""Kernels for the rays of the camera: through pixels, towards the sun and the sky, and mirrored by glossy surfaces.

This file holds @njit functions only, with all that they call: numba's cache does not see changes in other files.

N pixels, row by row. A pixel's ray has the camera's z component 1, so a reach along it is a depth.
"""

import math

import numpy as np
from numba import njit

_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))


@njit(inline="always")
def _lifted(i, rays, reach, normal, origin):
    """The point that pixel i sees, a little above its surface so that a ray can leave it."""
    t = np.float64(reach[i])
    off = 0.004 + 0.0006 * t
    return (
        origin[0] + t * rays[i, 0] + off * normal[i, 0],
        origin[1] + t * rays[i, 1] + off * normal[i, 1],
        origin[2] + t * rays[i, 2] + off * normal[i, 2],
    )


@njit(cache=True, nogil=True)
def turned(rays, R):
    """Rotate rays (N, 3) float32 by R (3, 3); numpy's product takes fifty times as long for such a thin matrix."""
    out = np.empty_like(rays)
    for i in range(len(rays)):
        for axis in range(3):
            out[i, axis] = R[axis, 0] * rays[i, 0] + R[axis, 1] * rays[i, 1] + R[axis, 2] * rays[i, 2]
    return out


@njit(cache=True, nogil=True)
def incidence(rays, normal):
    """Compute the absolute cosine (N,) float32 of the angle between rays and unit normals (N, 3)."""
    out = np.empty(len(rays), np.float32)
    for i in range(len(rays)):
        out[i] = abs(rays[i, 0] * normal[i, 0] + rays[i, 1] * normal[i, 1] + rays[i, 2] * normal[i, 2])
    return out


@njit(cache=True, nogil=True)
def face_camera(normal, rays):
    """Flip normals (N, 3), in place, to the side that rays (N, 3) come from."""
    for i in range(len(rays)):
        if normal[i, 0] * rays[i, 0] + normal[i, 1] * rays[i, 1] + normal[i, 2] * rays[i, 2] > 0.0:
            normal[i, 0], normal[i, 1], normal[i, 2] = -normal[i, 0], -normal[i, 1], -normal[i, 2]


@njit(cache=True, nogil=True)
def sun_rays(rays, reach, triangle, normal, origin, order, width, sun):
    """Select every second pixel (M,), as on a chessboard, that faces the sun, and the origin of its sun ray (M, 3)."""
    pixels = np.empty(len(rays), np.int32)
    count = 0
    for i in order:
        if (i // width + i % width) % 2:
            continue
        if triangle[i] >= 0 and normal[i, 0] * sun[0] + normal[i, 1] * sun[1] + normal[i, 2] * sun[2] > 0.0:
            pixels[count] = i
            count += 1
    start = np.empty((count, 3))
    for m in range(count):
        start[m] = _lifted(pixels[m], rays, reach, normal, origin)
    return pixels[:count], start


@njit(cache=True, nogil=True)
def second_of_two(i, triangle):
    """Check whether a pixel is odd and on the same triangle as the one before."""
    return i % 2 == 1 and triangle[i] == triangle[i - 1]


@njit(cache=True, nogil=True)
def double(mirrored, triangle):
    """Copy the mirrored triangle of the first to the second of two pixels, in place."""
    for i in range(1, len(mirrored), 2):
        if triangle[i] == triangle[i - 1]:
            mirrored[i] = mirrored[i - 1]


@njit(cache=True, nogil=True)
def mirror_rays(rays, reach, triangle, normal, origin, order, material, gloss):
    """Compute mirrored rays: pixels (M,) of glossy materials, origins (M, 3) and directions (M, 3).

    The second of two neighbours on one triangle has no ray, see `second_of_two`.
    """
    pixels = np.empty(len(rays), np.int32)
    count = 0
    for i in order:
        if triangle[i] >= 0 and gloss[material[triangle[i]]] > 0.0 and not second_of_two(i, triangle):
            pixels[count] = i
            count += 1
    start, direction = np.empty((count, 3)), np.empty((count, 3), np.float32)
    for m in range(count):
        i = pixels[m]
        start[m] = _lifted(i, rays, reach, normal, origin)
        twice = 2.0 * (rays[i, 0] * normal[i, 0] + rays[i, 1] * normal[i, 1] + rays[i, 2] * normal[i, 2])
        for axis in range(3):
            direction[m, axis] = rays[i, axis] - twice * normal[i, axis]
    return pixels[:count], start, direction


@njit(cache=True, nogil=True)
def sky_rays(rays, reach, triangle, normal, origin, width, step):
    """Compute four rays towards the sky from every `step`-th pixel in both axes.

    Four neighbouring cells share 16 directions, distributed over the hemisphere by the cosine. Returns the cells (M,)
    of the coarse grid, each four times, origins (M, 3) and directions (M, 3).
    """
    rows, columns = len(rays) // width // step, width // step
    cells = np.empty(4 * rows * columns, np.int32)
    start, direction = np.empty((len(cells), 3)), np.empty((len(cells), 3), np.float32)
    count = 0
    for row in range(rows):
        for column in range(columns):
            i = (row * step + step // 2) * width + column * step + step // 2
            if triangle[i] < 0:
                continue
            nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
            sign = 1.0 if nz >= 0.0 else -1.0  # two axes across the normal: Duff et al., JCGT 6(1), 2017
            a = -1.0 / (sign + nz)
            b = nx * ny * a
            for ray in range(4):
                k = 4 * ray + 2 * (row & 1) + (column & 1)
                r = math.sqrt((k + 0.5) / 16.0)
                up, along, across = math.sqrt(1.0 - r * r), r * math.cos(k * _GOLDEN), r * math.sin(k * _GOLDEN)
                cells[count] = row * columns + column
                start[count] = _lifted(i, rays, reach, normal, origin)
                direction[count, 0] = up * nx + along * (1.0 + sign * nx * nx * a) + across * b
                direction[count, 1] = up * ny + along * sign * b + across * (sign + ny * ny * a)
                direction[count, 2] = up * nz - along * sign * nx - across * ny
                count += 1
    return cells[:count], start[:count], direction[:count]
