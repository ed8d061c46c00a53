"""The loops behind scan context: descriptors of a cloud, and all column shifts of pairs of them. Nothing but @njit
here, and all in one file: numba's cache does not see a change in another.
"""

import math

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def describe(xyz, lateral, rings, sectors, max_range, sensor_height):
    """Highest point above the ground of each cell, seen from roots `lateral` (L,) metres to the left of the sensor.

    xyz (N, 3) -> (L, rings, sectors) float32 [m], 0 where a cell is empty; points that are not finite are left out.
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
            # behind -x the angle is just below 0 or just above pi: wrapped, then rounded down
            sector = int((math.atan2(y, x) + 2 * math.pi) * sector_scale) % sectors
            if z > heights[root, ring, sector]:
                heights[root, ring, sector] = z
    return heights


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def align(columns, filled, stored_columns, stored_filled, rows):
    """Scan context distance of every query to the stored descriptors in `rows` (M,), at the best column shift.

    columns         (L, 2 S, R) float32, the queries' columns at unit length, all S of them twice in a row, so that each
                    shift is one contiguous dot product;  filled (L, 2 S) float32: 1 where a column is not zero
    stored_columns  (N, S, R) float32, unit length or zero;  stored_filled (N, S)
    Returns distances (L, M) float32, 1 where no column pair is filled at any shift, and shifts (L, M) int64: column j
    of the stored one fits column j + shift of the query; of equals the first.
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
                # slices: an index that may be negative would keep the loops from being vectorised
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
