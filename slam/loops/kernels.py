"""Kernels of scan context: descriptors of a cloud, and distances of descriptors over all column shifts.

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
            shifted[:count] = y[:count] - np.float32(lateral[root])
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


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def align(columns, filled, stored_columns, stored_filled, rows):
    """Compute the scan context distance of each query to stored descriptors at the best column shift.

    Args:
        columns: (L, 2 S, R) float32, unit columns of the queries. All S columns are repeated once, so that each shift
            is one contiguous dot product.
        filled: (L, 2 S) float32, 1 for columns that are not zero.
        stored_columns: (N, S, R) float32, unit columns or zero.
        stored_filled: (N, S) float32, 1 for columns that are not zero.
        rows: (M,) stored descriptors to compare with.

    Returns:
        Distances (L, M) float32, 1 if no pair of columns is filled at any shift, and shifts (L, M) int64: column j of
        the stored descriptor matches column j + shift of the query; the first of equal shifts.
    """
    queries, sectors = len(columns), stored_columns.shape[1]
    distances = np.ones((queries, len(rows)), np.float32)
    shifts = np.zeros((queries, len(rows)), np.int64)
    length = stored_columns.shape[1] * stored_columns.shape[2]
    width = stored_columns.shape[2]
    for m in range(len(rows)):
        there, there_filled = stored_columns[rows[m]].reshape(length), stored_filled[rows[m]]
        for q in range(queries):
            flat = columns[q].reshape(2 * length)
            for shift in range(sectors):
                # slices: possibly negative indices would prevent vectorisation of the loops
                here, here_filled = flat[shift * width : shift * width + length], filled[q, shift : shift + sectors]
                pairs, cosines = np.float32(0.0), np.float32(0.0)
                for j in range(sectors):
                    pairs += here_filled[j] * there_filled[j]
                if pairs == 0.0:
                    continue
                for j in range(length):
                    cosines += here[j] * there[j]
                distance = np.float32(1.0) - cosines / pairs
                if distance < distances[q, m]:
                    distances[q, m], shifts[q, m] = distance, shift
    return distances, shifts
