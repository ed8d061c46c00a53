"""Numba kernels over points, several times faster than numpy. A kernel and all it calls share this file."""

import math

import numpy as np
from numba import njit


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


@njit(cache=True, nogil=True)
def turn_times(xyz, sweep, instant):
    """Compute point times from azimuths: (1/2 - azimuth / (2 pi) - instant) * sweep, (N,) float32 [s]."""
    out = np.empty(len(xyz), np.float32)
    for i in range(len(xyz)):
        out[i] = (0.5 - instant - math.atan2(xyz[i, 1], xyz[i, 0]) / (2 * math.pi)) * sweep
    return out
