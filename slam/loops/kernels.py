"""Kernels of scan context: the highest points of a cloud, its descriptors, and distances of their keys.

This file holds @njit functions only, with all that they call: numba's cache does not see changes in other files.
"""

import math

import numpy as np
from numba import njit

BLOCK = 512  # points whose cells are computed at once: their arrays stay in the cache


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"}, error_model="numpy")
def _cells(x, y, rings, sectors, max_range, cells):
    """Compute the cell of each point in a polar grid: ring * sectors + sector, or rings * sectors beyond the range.

    The loop has no branches or calls, so that it is vectorised. The angle is by a polynomial (Abramowitz and Stegun,
    Handbook of Mathematical Functions, 4.4.47), with errors up to 1e-5 rad.
    """
    ring_scale, sector_scale = np.float32(rings / max_range), np.float32(sectors / (2 * math.pi))
    outside, turn = np.int32(rings * sectors), np.int32(sectors)
    for i in range(len(x)):
        near, far = min(abs(x[i]), abs(y[i])), max(abs(x[i]), abs(y[i]))
        t = near / max(far, np.float32(1e-30))
        s = t * t
        polynomial = np.float32(0.0208351)
        polynomial = polynomial * s + np.float32(-0.0851330)
        polynomial = polynomial * s + np.float32(0.1801410)
        polynomial = polynomial * s + np.float32(-0.3302995)
        polynomial = polynomial * s + np.float32(0.9998660)
        angle = polynomial * t
        angle = np.float32(math.pi / 2) - angle if abs(y[i]) > abs(x[i]) else angle
        angle = np.float32(math.pi) - angle if x[i] < 0 else angle
        angle = np.float32(2 * math.pi) - angle if y[i] < 0 else angle
        sector = np.int32(angle * sector_scale)
        sector = sector - turn if sector >= turn else sector  # just below the x axis the angle may round to 2 pi
        squared = x[i] * x[i] + y[i] * y[i]
        ring = min(np.int32(math.sqrt(squared) * ring_scale), np.int32(rings - 1))
        cells[i] = ring * turn + sector if squared < np.float32(max_range * max_range) else outside


@njit(cache=True, nogil=True)
def highest(xyz, size, reach):
    """Select the highest point of each column of a square grid.

    Args:
        xyz: Points (N, 3) float32; non-finite points are left out.
        size: Size of the columns [m].
        reach: Points further than this from the origin along x or y are left out [m].

    Returns:
        Rows (M,) of the points, in the order of their columns.
    """
    width = math.ceil(2 * reach / size)
    best = np.full(width * width, -1, np.int32)
    count = 0
    for i in range(len(xyz)):
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        if not (-reach <= x < reach and -reach <= y < reach and abs(z) < math.inf):
            continue
        column = np.int64((x + reach) / size) * width + np.int64((y + reach) / size)
        other = best[column]
        count += other < 0
        if other < 0 or z > xyz[other, 2]:
            best[column] = i
    rows = np.empty(count, np.int64)
    count = 0
    for column in range(len(best)):
        if best[column] >= 0:
            rows[count] = best[column]
            count += 1
    return rows


@njit(cache=True, nogil=True)
def describe(xyz, lateral, rings, sectors, max_range, sensor_height):
    """Compute the maximum height above the ground in each cell of polar grids, one grid per lateral shift.

    Args:
        xyz: Points (N, 3) float32 in the sensor frame; non-finite points are ignored.
        lateral: (L,) shifts of the grid's origin to the left of the sensor [m].
        rings: Number of range bins.
        sectors: Number of azimuth bins.
        max_range: Range of the outermost bin [m].
        sensor_height: Height of the sensor above the ground [m], added to z.

    Returns:
        (L, rings, sectors) float32 [m], 0 for empty cells.
    """
    grids = np.zeros((len(lateral), rings * sectors + 1), np.float32)  # the last cell takes points beyond the range
    x, y, z = np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
    shifted = np.empty(BLOCK, np.float32)
    cells = np.empty(BLOCK, np.int32)
    for start in range(0, len(xyz), BLOCK):
        count = 0
        for i in range(start, min(start + BLOCK, len(xyz))):
            height = xyz[i, 2] + np.float32(sensor_height)
            if 0.0 < height < math.inf:
                x[count], y[count], z[count] = xyz[i, 0], xyz[i, 1], height
                count += 1
        for root in range(len(lateral)):
            shift = np.float32(lateral[root])
            for i in range(count):
                shifted[i] = y[i] - shift
            _cells(x[:count], shifted[:count], rings, sectors, max_range, cells)
            for i in range(count):
                grids[root, cells[i]] = max(grids[root, cells[i]], z[i])
    return grids[:, :-1].copy().reshape(len(lateral), rings, sectors)


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def key_distances(keys, stored, count):
    """Compute the squared distance (count,) float32 of each of the first `count` stored keys to the nearest of `keys`.

    Args:
        keys: Keys (L, K) float32.
        stored: Stored keys (N, K) float32.
        count: Number of stored keys that are compared.
    """
    nearest = np.empty(count, np.float32)
    for row in range(count):
        there, least = stored[row], np.float32(math.inf)
        for q in range(len(keys)):
            here, total = keys[q], np.float32(0.0)
            for k in range(len(there)):
                total += (here[k] - there[k]) * (here[k] - there[k])
            least = min(least, total)
        nearest[row] = least
    return nearest
