"""Loops over rays and points. Nothing but @njit here; a cached kernel and all it calls share a file."""

import math

import numpy as np
from numba import njit


@njit(inline="always")
def _column(x, y, columns):
    column = np.int64((math.atan2(y, x) / (2 * math.pi) + 0.5) * columns)
    return min(column, columns - 1)  # azimuth pi itself


@njit(cache=True, nogil=True)
def columns_of(xyz, columns):
    """(N,) int64: the azimuth column of each point, the first one beginning at -pi."""
    out = np.empty(len(xyz), np.int64)
    for i in range(len(xyz)):
        out[i] = _column(xyz[i, 0], xyz[i, 1], columns)
    return out


@njit(cache=True, nogil=True)
def range_image(xyz, ring, rings, columns):
    """(rings, columns) int32: the nearest point of each ring and column, -1 for none."""
    image = np.full((rings, columns), np.int32(-1))
    for i in range(len(xyz)):
        column = _column(xyz[i, 0], xyz[i, 1], columns)
        known = image[ring[i], column]
        if known >= 0:
            here = xyz[i, 0] * xyz[i, 0] + xyz[i, 1] * xyz[i, 1]
            if here >= xyz[known, 0] * xyz[known, 0] + xyz[known, 1] * xyz[known, 1]:
                continue
        image[ring[i], column] = i
    return image


@njit(cache=True, nogil=True)
def filled(image, reach):
    """A range image (K, W) int32 with its empty cells filled from the nearest column of the ring, `reach` away at most;
    the columns go round. Of two as near, the left one."""
    rings, columns = image.shape
    out = image.copy()
    for k in range(rings):
        for column in range(columns):
            step = 1
            while out[k, column] < 0 and step <= reach:
                left = image[k, (column + columns - step) % columns]
                out[k, column] = left if left >= 0 else image[k, (column + step) % columns]
                step += 1
    return out


@njit(inline="always")
def _turn(rho_a, z_a, rho_b, z_b):
    """Angle [rad] between two vectors of the vertical plane."""
    return abs(math.atan2(rho_a * z_b - z_a * rho_b, rho_a * rho_b + z_a * z_b))


@njit(cache=True, nogil=True)
def ray_segments(xyz, image, upper, tangent, offset, share, length, slope, turn):
    """Where rays meet the segments between the returns above and below them; all outputs (R, W).

    xyz (N, 3); image (K, W) int32: the points of the K rings there are, -1 for none; upper (R,): the row of `image`
    above each ray, -1 for a ray that is above the first, below the last or on a ring; tangent, offset (R,): its line.
    share   0 at the return above, 1 at the one below; NaN where one of them is missing
    length  m; slope  rad, of the segment against the horizontal plane
    turn    rad, by which the segment is bent against the next one above or below: the smaller; pi where there are none
    """
    rings, columns = image.shape
    rho, z = np.empty((rings, columns), np.float32), np.empty((rings, columns), np.float32)
    for k in range(rings):
        for column in range(columns):
            point = image[k, column]
            if point >= 0:
                rho[k, column] = math.hypot(xyz[point, 0], xyz[point, 1])
                z[k, column] = xyz[point, 2]
    share[:] = np.nan
    last, bent = -1, np.empty(columns, np.float32)
    for row in range(len(upper)):
        k = upper[row]
        if k < 0:
            continue
        if k != last:  # the rays between two rings share their segments
            last = k
            for column in range(columns):
                bent[column] = math.pi
                if image[k, column] < 0 or image[k + 1, column] < 0:
                    continue
                forth, down = rho[k + 1, column] - rho[k, column], z[k + 1, column] - z[k, column]
                if k > 0 and image[k - 1, column] >= 0:
                    above = _turn(rho[k, column] - rho[k - 1, column], z[k, column] - z[k - 1, column], forth, down)
                    bent[column] = above
                if k + 2 < rings and image[k + 2, column] >= 0:
                    f, d = rho[k + 2, column] - rho[k + 1, column], z[k + 2, column] - z[k + 1, column]
                    bent[column] = min(bent[column], _turn(forth, down, f, d))
        for column in range(columns):
            if image[k, column] < 0 or image[k + 1, column] < 0:
                continue
            forth, down = rho[k + 1, column] - rho[k, column], z[k + 1, column] - z[k, column]
            above = z[k, column] - tangent[row] * rho[k, column] - offset[row]  # of the ray
            fall = tangent[row] * forth - down
            t = above / fall if fall != 0.0 else 0.5
            share[row, column] = min(max(t, 0.0), 1.0)
            length[row, column] = math.hypot(forth, down)
            slope[row, column] = math.atan2(abs(down), abs(forth))
            turn[row, column] = bent[column]
