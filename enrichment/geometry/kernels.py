"""Kernels over rays and points.

This file holds @njit functions only, with all that they call: numba's cache does not see changes in other files.
Therefore `enrichment.lift.kernels` has its own copies of the azimuth column and the intersection with a segment.
"""

import math

import numpy as np
from numba import njit


@njit(inline="always")
def _column(x, y, columns):
    column = np.int64((math.atan2(y, x) / (2 * math.pi) + 0.5) * columns)
    return min(column, columns - 1)  # for an azimuth of exactly pi


@njit(cache=True, nogil=True)
def columns_of(xyz, columns):
    """Compute the azimuth column (N,) int64 of each point; column 0 begins at -pi."""
    out = np.empty(len(xyz), np.int64)
    for i in range(len(xyz)):
        out[i] = _column(xyz[i, 0], xyz[i, 1], columns)
    return out


@njit(cache=True, nogil=True)
def range_image(xyz, ring, rings, columns):
    """Compute the index of the nearest point of each ring and column, (rings, columns) int32, -1 for none."""
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
    """Fill empty cells of a range image (K, W) int32 from the nearest column of the ring, at most `reach` away.

    Columns wrap around; the left one of two equally near columns is taken.
    """
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
    """Angle [rad] between two vectors in the vertical plane."""
    return abs(math.atan2(rho_a * z_b - z_a * rho_b, rho_a * rho_b + z_a * z_b))


@njit(cache=True, nogil=True)
def segments(xyz, image):
    """Compute the segments from each return to the one below it, in the vertical plane of its column.

    Args:
        xyz: Points (N, 3).
        image: (K, W) int32, points of the K rings, -1 for none.

    Returns:
        rho and z of the points, (K, W) float32; length [m] of each segment, 0 if one end is missing, slope [rad]
        relative to the horizontal, and turn [rad], the smaller angle to the next segment above or below, pi without
        one: (K - 1, W) float32 each.
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
    """Compute the mean distance by which neighbouring returns are outside of the range interval of each segment.

    Neighbouring returns are those of both rings, `window` columns to either side. The interval is from the nearer to
    the farther end, extended by `slack` [m] and `slack_share` of the range; a return counts at most `limit` [m].

    Args:
        rho: (K, W), from `segments`.
        length: (K - 1, W), from `segments`.
        window: Columns to either side.
        slack: Extension of the interval [m].
        slack_share: Extension of the interval as a share of the range.
        limit: Maximum distance of one return [m].

    Returns:
        (K - 1, W) float32 [m].
    """
    rings, columns = rho.shape
    out = np.zeros((rings - 1, columns), np.float32)
    near, far, total = np.empty(columns), np.empty(columns), np.empty(columns)
    around = np.empty((rings, columns + 2 * window), rho.dtype)  # without `%` a compiler can vectorise the inner loop
    for k in range(rings):
        for column in range(columns + 2 * window):
            around[k, column] = rho[k, (column - window) % columns]
    for k in range(rings - 1):
        total[:] = 0.0
        for column in range(columns):
            above, below = rho[k, column], rho[k + 1, column]
            near[column] = min(above, below) * (1 - slack_share) - slack
            far[column] = max(above, below) * (1 + slack_share) + slack
        for shift in range(2 * window + 1):
            for ring in (k, k + 1):
                neighbours = around[ring, shift:]
                for column in range(columns):
                    r = neighbours[column]
                    outside = min(max(r - far[column], near[column] - r, 0.0), limit)
                    total[column] += outside if r > 0.0 else 0.0
        for column in range(columns):
            if length[k, column] > 0.0:
                out[k, column] = total[column] / (4 * window)
    return out


@njit(cache=True, nogil=True)
def intersect_segments(rho, z, length, upper, tangent, offset):
    """Intersect each ray with the segment between the returns above and below.

    Rays that pass above or below a segment are assigned its end.

    Args:
        rho: (K, W), from `segments`.
        z: (K, W), from `segments`.
        length: (K - 1, W), from `segments`.
        upper: (R,) ring above each ray, -1 for none.
        tangent: (R,) slope of each ray: z = tangent * rho + offset.
        offset: (R,) offset of each ray [m].

    Returns:
        rho of the intersections, (R, W) float32 [m], 0 without a segment.
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
    """Collect the predicted points to keep, row by row.

    Args:
        ranges: (R, W) predicted ranges [m].
        sigma: (R, W) [m].
        keep: (R, W) bool.
        image: (K, W) int32, measured points by ring and column, -1 for none.
        upper: (R,) row of `image` above each ray, -1 for none.
        below: (R,) row of `image` below each ray, -1 for none.
        intensity: (N,) intensity of the measured points.
        time: (N,) time of the measured points, or empty.
        azimuth: (W,) azimuth of the columns [rad].
        cosine: (R,) cosine of the elevation.
        sine: (R,) sine of the elevation.
        offset: (R,) height of the laser [m].

    Returns:
        xyz (M, 3), intensity and sigma (M,) float32, row (M,) int16, and time (M,) float32, empty without times.
        Intensity and time are the mean of the points above and below, or that of the only one, 0 without any.
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
    cosine_azimuth, sine_azimuth = np.cos(azimuth), np.sin(azimuth)
    i = 0
    for row in range(rows):
        for column in range(columns):
            if not keep[row, column]:
                continue
            rho = ranges[row, column] * cosine[row]
            xyz[i, 0], xyz[i, 1] = rho * cosine_azimuth[column], rho * sine_azimuth[column]
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
