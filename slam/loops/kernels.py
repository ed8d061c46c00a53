"""Kernels of scan context: descriptors of a cloud, and distances of descriptors over all column shifts.

This file holds @njit functions only, with all that they call: numba's cache does not see changes in other files.
"""

import math

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def describe(xyz, lateral, rings, sectors, max_range, sensor_height):
    """Compute the maximum height above the ground in each cell of polar grids, one grid per lateral shift.

    Args:
        xyz: Points (N, 3) in the sensor frame; non-finite points are ignored.
        lateral: (L,) shifts of the grid's origin to the left of the sensor [m].
        rings: Number of range bins.
        sectors: Number of azimuth bins.
        max_range: Range of the outermost bin [m].
        sensor_height: Height of the sensor above the ground [m], added to z.

    Returns:
        (L, rings, sectors) float32 [m], 0 for empty cells.
    """
    heights = np.zeros((len(lateral), rings, sectors), np.float32)
    ring_scale, sector_scale = rings / max_range, sectors / (2 * math.pi)
    for i in range(len(xyz)):
        x, z = xyz[i, 0], xyz[i, 2] + sensor_height
        if not 0.0 < z < math.inf:
            continue
        for root in range(len(lateral)):
            y = xyz[i, 1] - lateral[root]
            rho = math.sqrt(x * x + y * y)
            if not rho < max_range:
                continue
            ring = min(int(rho * ring_scale), rings - 1)
            # near -x the angle is just above -pi or just below pi: wrap it, then round down
            sector = int((math.atan2(y, x) + 2 * math.pi) * sector_scale) % sectors
            if z > heights[root, ring, sector]:
                heights[root, ring, sector] = z
    return heights


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
