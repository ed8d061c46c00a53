"""Loops over rays and points. Nothing but @njit here; a cached kernel and all it calls share a file.

That is why `enrichment.lift.kernels` has the azimuth column and the intersection with a segment once more.
"""

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
def segments(xyz, image):
    """The straight lines from each return to the one below it, in the vertical plane of its column.

    xyz (N, 3); image (K, W) int32, the points of the K rings that there are, -1 for none. Returns (K, W) float32 rho
    and z of the points, and (K - 1, W) float32 length [m] (0 where one end is missing), slope [rad] against the
    horizontal, and turn [rad]: the angle to the next segment above or below, the smaller; pi where there are none.
    """
    rings, columns = image.shape
    rho, z = np.zeros((rings, columns), np.float32), np.zeros((rings, columns), np.float32)
    for k in range(rings):
        for column in range(columns):
            point = image[k, column]
            if point >= 0:
                rho[k, column] = math.hypot(xyz[point, 0], xyz[point, 1])
                z[k, column] = xyz[point, 2]
    length = np.zeros((rings - 1, columns), np.float32)
    slope, turn = np.zeros_like(length), np.full_like(length, np.float32(math.pi))
    for k in range(rings - 1):
        for column in range(columns):
            if image[k, column] < 0 or image[k + 1, column] < 0:
                continue
            forth, down = rho[k + 1, column] - rho[k, column], z[k + 1, column] - z[k, column]
            length[k, column] = max(math.hypot(forth, down), 1e-6)
            slope[k, column] = math.atan2(abs(down), abs(forth))
            if k > 0 and image[k - 1, column] >= 0:
                bend = _turn(rho[k, column] - rho[k - 1, column], z[k, column] - z[k - 1, column], forth, down)
                turn[k, column] = bend
                turn[k - 1, column] = min(turn[k - 1, column], bend)
    return rho, z, length, slope, turn


@njit(cache=True, nogil=True)
def neighbour_outlier_distance(rho, length, window, slack, slack_share, limit):
    """(K - 1, W) float32, metres: how far the returns beside each segment lie outside of its reach, in the mean.

    rho (K, W) and length (K - 1, W) of `segments`. Beside are both of its rings, `window` columns to either side. Its
    reach is from the nearer of its ends to the further one, plus `slack` metres and `slack_share` of them; no return
    counts more than `limit`.
    """
    rings, columns = rho.shape
    out = np.zeros((rings - 1, columns), np.float32)
    for k in range(rings - 1):
        for column in range(columns):
            if length[k, column] == 0.0:
                continue
            near, far = min(rho[k, column], rho[k + 1, column]), max(rho[k, column], rho[k + 1, column])
            near, far = near * (1 - slack_share) - slack, far * (1 + slack_share) + slack
            total = 0.0
            for beside in range(column - window, column + window + 1):
                wrapped = beside % columns
                for ring in (k, k + 1):
                    r = rho[ring, wrapped]
                    if r > 0.0:
                        total += min(max(r - far, near - r, 0.0), limit)
            out[k, column] = total / (4 * window)
    return out


@njit(cache=True, nogil=True)
def intersect_segments(rho, z, length, upper, tangent, offset):
    """(R, W) float32, metres: at which rho each ray meets the segment between the returns above and below; 0: at none.

    rho, z (K, W) and length (K - 1, W) of `segments`; upper (R,): the ring above each ray, -1 for none; tangent,
    offset (R,): z = tangent * rho + offset is its line. Rays that pass above or below a segment meet its end.
    """
    columns = rho.shape[1]
    met = np.zeros((len(upper), columns), np.float32)
    for row in range(len(upper)):
        k = upper[row]
        if k < 0:
            continue
        for column in range(columns):
            if length[k, column] == 0.0:
                continue
            forth, down = rho[k + 1, column] - rho[k, column], z[k + 1, column] - z[k, column]
            above, fall = z[k, column] - tangent[row] * rho[k, column] - offset[row], tangent[row] * forth - down
            share = above / fall if fall != 0.0 else 0.5
            met[row, column] = rho[k, column] + min(max(share, 0.0), 1.0) * forth
    return met


@njit(cache=True, nogil=True)
def collect(ranges, sigma, keep, image, upper, below, intensity, time, azimuth, cosine, sine, offset):
    """The predicted points to keep, row by row: xyz (M, 3), intensity, sigma (M,) float32, row (M,) int16 and, where
    `time` (N,) is not empty, time (M,) float32.

    ranges, sigma, keep (R, W); image (K, W) int32, the measured points; upper and below (R,), rows of `image`:
    intensity and time are the mean of the points there, or the one that there is, 0 without any.
    """
    rows, columns = ranges.shape
    count = 0
    for row in range(rows):
        for column in range(columns):
            count += keep[row, column]
    timed = len(time) > 0
    xyz, ring = np.empty((count, 3), np.float32), np.empty(count, np.int16)
    sigmas, intensities = np.empty(count, np.float32), np.zeros(count, np.float32)
    times = np.zeros(count if timed else 0, np.float32)
    across, aside = np.cos(azimuth), np.sin(azimuth)
    i = 0
    for row in range(rows):
        for column in range(columns):
            if not keep[row, column]:
                continue
            rho = ranges[row, column] * cosine[row]
            xyz[i, 0], xyz[i, 1] = rho * across[column], rho * aside[column]
            xyz[i, 2] = ranges[row, column] * sine[row] + offset[row]
            sigmas[i], ring[i] = sigma[row, column], row
            found = 0
            for k in (upper[row], below[row]):
                point = image[k, column] if k >= 0 else -1
                if point >= 0:
                    intensities[i] += intensity[point]
                    if timed:
                        times[i] += time[point]
                    found += 1
            if found > 1:
                intensities[i] /= found
                if timed:
                    times[i] /= found
            i += 1
    return xyz, intensities, sigmas, ring, times
