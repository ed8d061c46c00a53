"""Numba kernels over points, several times faster than numpy. A kernel and all it calls share this file."""

import math

import numpy as np
from numba import njit

from slam.data.angle import angle


@njit(cache=True, nogil=True)
def move_to_stamp(xyz, time, first, second, third):
    """Move each point to its position at the stamp: exp(t xi) x to third order in its time t [s] from the stamp.

    `first`, `second`, `third` (3, 4) are the top rows of X, X^2 / 2 and X^3 / 6, with X the matrix of the velocity xi.
    The omitted fourth order rotates by less than 1e-5 rad at 1.5 rad/s and half a sweep of 0.1 s.
    """
    out = np.empty_like(xyz)
    for i in range(len(xyz)):
        s = time[i]
        for row in range(3):
            value = xyz[i, row] + s * (first[row, 3] + s * (second[row, 3] + s * third[row, 3]))
            for column in range(3):
                term = first[row, column] + s * (second[row, column] + s * third[row, column])
                value += s * term * xyz[i, column]
            out[i, row] = value
    return out


@njit(cache=True, nogil=True)
def raise_elevation(xyz, sine, cosine):
    """Rotate each point upwards, in the vertical plane through it and the sensor, by the angle of (sine, cosine)."""
    out = np.empty_like(xyz)
    for i in range(len(xyz)):
        rho = math.sqrt(xyz[i, 0] * xyz[i, 0] + xyz[i, 1] * xyz[i, 1])
        stretch = cosine - sine * xyz[i, 2] / max(rho, 1e-6)
        out[i, 0] = xyz[i, 0] * stretch
        out[i, 1] = xyz[i, 1] * stretch
        out[i, 2] = xyz[i, 2] * cosine + rho * sine
    return out


@njit(cache=True, nogil=True)
def wraps(xyz):
    """Find azimuth wraparounds: (N,) bool, whether the azimuth (mod 2 pi) falls by more than pi from the point before.

    This is a step across +x from the right (y < 0) to the left by less than half a turn, so no angle is computed.
    """
    out = np.zeros(len(xyz), np.bool_)
    for i in range(1, len(xyz)):
        if xyz[i - 1, 1] < 0 <= xyz[i, 1]:
            out[i] = xyz[i - 1, 0] * xyz[i, 1] > xyz[i - 1, 1] * xyz[i, 0]
    return out


@njit(cache=True, nogil=True)
def count_up(steps):
    """Count the steps (N,) bool up to each point: (N,) int16."""
    out, count = np.empty(len(steps), np.int16), 0
    for i in range(len(steps)):
        count += steps[i]
        out[i] = count
    return out


@njit(cache=True, nogil=True)
def nearest_lines(xyz, tangent, offset):
    """Find for each point the laser k whose line z = tangent[k] * rho + offset[k] is vertically nearest: (N,) int16."""
    out = np.empty(len(xyz), np.int16)
    for i in range(len(xyz)):
        rho = math.sqrt(xyz[i, 0] * xyz[i, 0] + xyz[i, 1] * xyz[i, 1])
        best, nearest = np.inf, 0
        for k in range(len(tangent)):
            distance = abs(xyz[i, 2] - tangent[k] * rho - offset[k])
            if distance < best:
                best, nearest = distance, k
        out[i] = nearest
    return out


@njit(cache=True, nogil=True)
def cheapest_lines(xyz, weight, wrap, tangent, offset, spacing, switch_cost):
    """Find the non-decreasing rings (N,) int16 along the file that best fit the laser lines, and the mean misfit, 0..1.

    The misfit of a point to line k is its distance from the line, seen from the sensor, in units of `spacing[k]` and at
    most 1; the mean is weighted. A step to the next ring costs nothing at a `wrap` and `switch_cost` elsewhere; staying
    on a ring over a wrap costs half of that. Dynamic programming over points and lines (Viterbi).
    """
    count, lines = len(xyz), len(tangent)
    came_from = np.empty((count, lines), np.int16)
    cost = np.zeros(lines)
    for i in range(count):
        rho = max(math.sqrt(xyz[i, 0] * xyz[i, 0] + xyz[i, 1] * xyz[i, 1]), 1e-3)
        stay, switch = (0.5 * switch_cost, 0.0) if wrap[i] else (0.0, switch_cost)
        lowest, lowest_line = np.inf, 0
        for k in range(lines):
            here = cost[k]
            cost[k], came_from[i, k] = here + stay, k
            if lowest + switch < cost[k]:
                cost[k], came_from[i, k] = lowest + switch, lowest_line
            if here < lowest:
                lowest, lowest_line = here, k
            cost[k] += weight[i] * min(1.0, abs(xyz[i, 2] - tangent[k] * rho - offset[k]) / (rho * spacing[k]))
    ring = np.empty(count, np.int16)
    misfit, line = 0.0, int(np.argmin(cost))
    for i in range(count - 1, -1, -1):
        rho = max(math.sqrt(xyz[i, 0] * xyz[i, 0] + xyz[i, 1] * xyz[i, 1]), 1e-3)
        distance = abs(xyz[i, 2] - tangent[line] * rho - offset[line])
        misfit += weight[i] * min(1.0, distance / (rho * spacing[line]))
        ring[i] = line
        line = came_from[i, line]
    return ring, misfit / max(weight.sum(), 1e-9)


@njit(cache=True, nogil=True, error_model="numpy")
def turn_times(xyz, sweep, instant):
    """Compute point times from azimuths: (1/2 - azimuth / (2 pi) - instant) * sweep, (N,) float32 [s]."""
    out = np.empty(len(xyz), np.float32)
    rear, per_radian = np.float32((0.5 - instant) * sweep), np.float32(sweep / (2 * math.pi))
    for i in range(len(xyz)):
        out[i] = rear - angle(np.float32(xyz[i, 1]), np.float32(xyz[i, 0])) * per_radian
    return out


@njit(cache=True, nogil=True)
def project(xyz, T, K):
    """Project points (N, 3) by T_camera_lidar (4, 4) and a camera matrix (3, 3) without a lens model.

    Returns pixels (N, 2), NaN behind the camera, and depths (N,) [m].
    """
    pixels, depth = np.full((len(xyz), 2), np.nan), np.empty(len(xyz))
    for i in range(len(xyz)):
        x, y, z = np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2])
        ahead = T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3]
        depth[i] = ahead
        if ahead > 0:
            right = (T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3]) / ahead
            down = (T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3]) / ahead
            pixels[i, 0] = K[0, 0] * right + K[0, 1] * down + K[0, 2]
            pixels[i, 1] = K[1, 0] * right + K[1, 1] * down + K[1, 2]
    return pixels, depth


@njit(cache=True, nogil=True)
def visible(pixels, depth, height, width, rows, columns, nearer, share):
    """Find the points that an image (height, width) shows: inside, and not hidden by nearer ones, (N,) bool.

    A point is hidden if a point at most `rows` and `columns` of pixels away is nearer by more than `nearer` [m] and
    more than `share` of its depth.
    """
    nearest = np.full((height, width), np.inf)
    inside = np.zeros(len(pixels), np.bool_)
    for i in range(len(pixels)):
        u, v = pixels[i, 0], pixels[i, 1]
        if -0.5 <= u < width - 0.5 and -0.5 <= v < height - 0.5:
            inside[i] = True
            row, column = math.floor(v + 0.5), math.floor(u + 0.5)
            nearest[row, column] = min(nearest[row, column], depth[i])
    for i in range(len(pixels)):
        if not inside[i]:
            continue
        row, column = math.floor(pixels[i, 1] + 0.5), math.floor(pixels[i, 0] + 0.5)
        around = depth[i]
        for r in range(max(row - rows, 0), min(row + rows + 1, height)):
            for c in range(max(column - columns, 0), min(column + columns + 1, width)):
                around = min(around, nearest[r, c])
        inside[i] = depth[i] - around <= max(nearer, share * depth[i])
    return inside


@njit(cache=True, nogil=True)
def pixels_of(image, pixels, shown):
    """Look up the colours (N, 3) uint8 of points in an image (H, W, 3); black for those that are not `shown` (N,)."""
    out = np.zeros((len(pixels), 3), np.uint8)
    for i in range(len(pixels)):
        if not shown[i]:
            continue
        row, column = math.floor(pixels[i, 1] + 0.5), math.floor(pixels[i, 0] + 0.5)
        black = True
        for channel in range(3):
            out[i, channel] = image[row, column, channel]
            black = black and out[i, channel] == 0
        if black:
            out[i] = 1
    return out
