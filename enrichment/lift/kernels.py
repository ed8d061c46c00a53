"""Kernels of Lift's input.

This file holds @njit functions only, with all that they call: numba's cache does not see changes in other files.
Therefore it has its own copies of `_intersect_segment` and the azimuth column (`enrichment.geometry.kernels`), and of
`_pixel` (`slam.data.camera.project`).
"""

import math

import numpy as np
from numba import njit

from enrichment.lift.channels import CANDIDATES, Candidate, Ray

EDGE_STEPS = 12  # pixels sampled on each half of the line between the returns above and below
UNCERTAIN_SIGMA = 0.4  # m: rays whose segment has a larger sigma get a GUESS
#: Neighbouring returns: rings relative to the one above the ray, columns to either side, and their step.
RINGS_NEAR, COLUMNS_NEAR, COLUMN_STEP = (-1, 3), 8, 2
#: Horizontal and vertical distance [pixels] and colour difference (of 255) at which the weight of a return falls by e;
#: total weight of the returns, where EDGE and the completed depth weigh 1 each.
HORIZONTAL, VERTICAL, COLOUR, RETURNS = 20.0, 30.0, 25.0, np.float32(2.0)
NEARER, LOWER, ALIKE = np.float32(1 / HORIZONTAL), np.float32(1 / VERTICAL), np.float32(1 / COLOUR)
LEAST, MOST = 0.8, 1.25  # limits of extrapolated surfaces, relative to the nearer and the farther return
NEAR_RAY = 0.15  # share of the gap between two rings: maximum distance of past returns from a ray
SLOPES = 1024  # entries of a table of the lines by slope
AGE = 0.02  # share of the gap: penalty on the distance from the ray per scan of age


@njit(inline="always")
def _bounded(value, low, high):
    return min(max(value, low), high)


@njit(inline="always")
def _extended(rho, z, beyond_rho, beyond_z, tangent, offset, low, high):
    """Rho where a ray meets the line from the return `beyond` through a return, extended past it; 0 for none."""
    forth, down = rho - beyond_rho, z - beyond_z
    above, fall = z - tangent * rho - offset, tangent * forth - down
    share = above / fall if fall != 0.0 else -1.0
    if share < 0.0:
        return 0.0
    return _bounded(rho + share * forth, low, high)


@njit(inline="always")
def _intersect_segment(rho, z, beyond_rho, beyond_z, tangent, offset):
    """Rho where a ray meets the segment between two returns, or its nearer end."""
    forth, down = beyond_rho - rho, beyond_z - z
    above, fall = z - tangent * rho - offset, tangent * forth - down
    return rho + _bounded(above / fall if fall != 0.0 else 0.5, 0.0, 1.0) * forth


@njit(cache=True, nogil=True)
def between_rings(rho, z, length, upper, tangent, offset):
    """Compute the candidates (CANDIDATES, Q, W) of the rings alone: SEGMENT, ABOVE, BELOW, FROM_ABOVE and FROM_BELOW.

    Shapes: rho, z (K, W); length (K - 1, W); upper, tangent, offset (Q,).
    """
    rings, columns = rho.shape
    candidates = np.zeros((CANDIDATES, len(upper), columns), np.float32)
    for row in range(len(upper)):
        k, slant, start = upper[row], tangent[row], offset[row]
        for c in range(columns):
            if length[k, c] == 0.0:
                continue
            above, below = rho[k, c], rho[k + 1, c]
            low, high = LEAST * min(above, below), MOST * max(above, below)
            candidates[Candidate.SEGMENT, row, c] = _intersect_segment(above, z[k, c], below, z[k + 1, c], slant, start)
            candidates[Candidate.ABOVE, row, c], candidates[Candidate.BELOW, row, c] = above, below
            if k > 0 and rho[k - 1, c] > 0.0:
                candidates[Candidate.FROM_ABOVE, row, c] = _extended(
                    above, z[k, c], rho[k - 1, c], z[k - 1, c], slant, start, low, high
                )
            if k + 2 < rings and rho[k + 2, c] > 0.0:
                candidates[Candidate.FROM_BELOW, row, c] = _extended(
                    below, z[k + 1, c], rho[k + 2, c], z[k + 2, c], slant, start, low, high
                )
    return candidates


@njit(cache=True, nogil=True)
def rows_by_slope(tangent, least, most):
    """Tabulate the index of the line next to each of SLOPES slopes from `least` to `most`, for `accumulate_history`."""
    table, row = np.empty(SLOPES, np.int64), len(tangent) - 1
    for i in range(SLOPES):
        while row > 0 and tangent[row] < least + (most - least) * i / (SLOPES - 1):
            row -= 1
        table[i] = row
    return table


@njit(cache=True, nogil=True)
def accumulate_history(past, xyz, T_now_then, age, table, rho, z, length, segment, upper, tangent, offset, gap):
    """Add the returns of an earlier scan (N, 3) near the rays, relative to the current segments, to `past`.

    `past` (Q, W, 6) float32 has, for each ray, the distance of the candidate's return from the ray, infinite before the
    first scan; its range and the logarithm of its ratio to the segment; the smallest and largest of these logarithms;
    the number of returns. `table` is that of `rows_by_slope`, between the first and the last tangent.
    """
    columns, last = rho.shape[1], len(tangent) - 1
    least, most = tangent[last], tangent[0]
    steps, turns = (SLOPES - 1) / max(most - least, 1e-9), columns / (2 * math.pi)
    for i in range(len(xyz)):
        x, y, up = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        px = T_now_then[0, 0] * x + T_now_then[0, 1] * y + T_now_then[0, 2] * up + T_now_then[0, 3]
        py = T_now_then[1, 0] * x + T_now_then[1, 1] * y + T_now_then[1, 2] * up + T_now_then[1, 3]
        pz = T_now_then[2, 0] * x + T_now_then[2, 1] * y + T_now_then[2, 2] * up + T_now_then[2, 3]
        far = math.sqrt(px * px + py * py)
        if not far >= 1.0:
            continue
        row = table[int(_bounded((pz / far - least) * steps, 0.0, SLOPES - 1.0))]
        off = pz - tangent[row] * far - offset[row]
        while off > 0.0 and row > 0:
            other = pz - tangent[row - 1] * far - offset[row - 1]
            if abs(other) >= off:
                break
            row, off = row - 1, other
        while off < 0.0 and row < last:
            other = pz - tangent[row + 1] * far - offset[row + 1]
            if abs(other) > -off:
                break
            row, off = row + 1, other
        k = upper[row]
        off = abs(off) / (gap[k] * far / 10)
        if off > NEAR_RAY:
            continue
        c = min(int((math.atan2(py, px) + math.pi) * turns), columns - 1)
        if length[k, c] == 0.0:
            continue
        above, below = rho[k, c], rho[k + 1, c]
        slant = (pz - offset[row]) / far
        ratio = far / _intersect_segment(above, z[k, c], below, z[k + 1, c], slant, offset[row])
        found = ratio * segment[row, c]
        if not LEAST * min(above, below) <= found <= MOST * max(above, below):
            continue
        of_ray, change = past[row, c], math.log(np.float32(ratio))
        of_ray[3], of_ray[4] = min(of_ray[3], change), max(of_ray[4], change)
        of_ray[5] += 1.0
        if off + AGE * age < of_ray[0]:
            of_ray[0], of_ray[1], of_ray[2] = off + AGE * age, found, change


@njit(cache=True, nogil=True)
def add_history(past, rays, candidates):
    """Add the features of `past` to rays and candidates of LiftInput."""
    for row in range(past.shape[0]):
        for c in range(past.shape[1]):
            of_ray = past[row, c]
            if of_ray[5] > 0.0:
                candidates[Candidate.PAST, row, c], rays[Ray.PAST, row, c] = of_ray[1], of_ray[2]
                rays[Ray.PAST_NEAREST, row, c], rays[Ray.PAST_FURTHEST, row, c] = of_ray[3], of_ray[4]
                rays[Ray.PAST_RETURNS, row, c] = math.log(np.float32(1.0) + of_ray[5])


@njit(inline="always")
def _pixel(projection, x, y, z):
    """Pixel u, v of a point; NaN behind the camera."""
    depth = projection[2, 0] * x + projection[2, 1] * y + projection[2, 2] * z + projection[2, 3]
    if depth < 0.5:
        return np.nan, np.nan
    u = projection[0, 0] * x + projection[0, 1] * y + projection[0, 2] * z + projection[0, 3]
    v = projection[1, 0] * x + projection[1, 1] * y + projection[1, 2] * z + projection[1, 3]
    return u / depth, v / depth


@njit(inline="always")
def _inside(u, v, image):
    return -0.5 <= u < image.shape[1] - 0.5 and -0.5 <= v < image.shape[0] - 0.5


@njit(cache=True, nogil=True)
def colours_of_rings(xyz, points, projection, image, out):
    """Fill `out` (4, K, W) with seen, red, green, blue of the returns in the image, and return their pixels (K, W, 2).

    `projection` (3, 4) maps the LiDAR frame to pixels; `image` is (H, W, 3) uint8.
    """
    rings, columns = points.shape
    pixels = np.full((rings, columns, 2), np.float32(np.nan))
    for k in range(rings):
        for c in range(columns):
            i = points[k, c]
            if i < 0:
                continue
            u, v = _pixel(projection, xyz[i, 0], xyz[i, 1], xyz[i, 2])
            if _inside(u, v, image):
                pixels[k, c, 0], pixels[k, c, 1] = u, v
                colour = image[int(v + 0.5), int(u + 0.5)]
                out[0, k, c] = 1.0
                for channel in range(3):
                    out[1 + channel, k, c] = colour[channel] / 128 - 1
    return pixels


@njit(inline="always")
def _change(image, u, v, to_u, to_v):
    """Total colour change (0..255 per channel) along the line between two pixels, and the difference of its ends."""
    total = 0.0
    first = image[int(v + 0.5), int(u + 0.5)]
    before = first
    for step in range(1, EDGE_STEPS + 1):
        share = step / EDGE_STEPS
        here = image[int(v + share * (to_v - v) + 0.5), int(u + share * (to_u - u) + 0.5)]
        square = 0.0
        for channel in range(3):
            square += (float(here[channel]) - float(before[channel])) ** 2
        total += math.sqrt(square)
        before = here
    square = 0.0
    for channel in range(3):
        square += (float(before[channel]) - float(first[channel])) ** 2
    return total, math.sqrt(square)


@njit(inline="always")
def _exp(x):
    """Exponential function of x <= 0 in single precision, to 2e-7; unlike math.exp a compiler can vectorise it."""
    x = max(x, np.float32(-80.0))
    whole = np.floor(x * np.float32(1.44269504) + np.float32(0.5))
    rest = x - whole * np.float32(0.693359375) + whole * np.float32(2.12194440e-4)
    power = np.float32(1.3981999507e-3) + np.float32(1.9875691500e-4) * rest  # Cephes' polynomial for expf
    power = np.float32(8.3334519073e-3) + power * rest
    power = np.float32(4.1665795894e-2) + power * rest
    power = np.float32(1.6666665459e-1) + power * rest
    power = np.float32(0.5) + power * rest
    power = np.float32(1.0) + rest + power * rest * rest
    return power * np.int32((np.int32(whole) + np.int32(127)) << np.int32(23)).view(np.float32)


@njit(cache=True, nogil=True)
def depths_seen(xyz, points, pixels, projection, scale, out):
    """Fill `out` (h, w), with `scale` cells per pixel, with the depth of the nearest return in each cell."""
    rings, columns = points.shape
    for k in range(rings):
        for c in range(columns):
            if points[k, c] < 0 or np.isnan(pixels[k, c, 0]):
                continue
            x, y, z = xyz[points[k, c]]
            depth = projection[2, 0] * x + projection[2, 1] * y + projection[2, 2] * z + projection[2, 3]
            row = min(int((pixels[k, c, 1] + 0.5) * scale), out.shape[0] - 1)
            column = min(int((pixels[k, c, 0] + 0.5) * scale), out.shape[1] - 1)
            if out[row, column] == 0.0 or depth < out[row, column]:
                out[row, column] = depth


@njit(inline="always")
def weighted_median(values, weights, count):
    """Compute the weighted median, the smallest value that reaches half of the weight, and the mean distance from it.

    Only the first `count` of values and weights (N,) are used.
    """
    total = np.float32(0.0)
    for i in range(count):
        total += weights[i]
    median = np.float32(np.inf)
    for i in range(count):
        value, reached = values[i], np.float32(0.0)
        if value >= median:
            continue
        for j in range(count):
            reached += weights[j] if values[j] <= value else np.float32(0.0)
        if reached >= np.float32(0.5) * total:
            median = value
    spread = np.float32(0.0)
    for i in range(count):
        spread += weights[i] * abs(values[i] - median)
    return median, spread / total


@njit(inline="always")
def _filled(dense, scale, u, v, cosine, sine, tangent, offset, projection, otherwise):
    """Rho where the depth of a ray equals that of the depth image at its pixel."""
    depth = dense[min(int((v + 0.5) * scale), dense.shape[0] - 1), min(int((u + 0.5) * scale), dense.shape[1] - 1)]
    along = projection[2, 0] * cosine + projection[2, 1] * sine + projection[2, 2] * tangent
    rho = (depth - projection[2, 2] * offset - projection[2, 3]) / along
    return rho if depth > 0.0 and rho > 0.0 else otherwise


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz"})
def guess(rays, candidates, seen, upper, tangent, offset, cosine, sine, projection, image, dense, scale):
    """Add the candidate GUESS on uncertain rays in the image, its ratio to the segment, and the spread of its inputs.

    GUESS is the weighted median of EDGE, of nearby returns with similar colour and of a completed depth image. `seen`
    (K, 6, W + 2 COLUMNS_NEAR) has u, v, red, green, blue and rho of the returns, NaN outside the image, and repeats
    COLUMNS_NEAR columns on both sides; `dense` (h, w) is the depth with `scale` cells per pixel.
    """
    _, rows, columns = rays.shape
    rings, near = len(seen), 2 * COLUMNS_NEAR // COLUMN_STEP + 1
    most = (RINGS_NEAR[1] - RINGS_NEAR[0]) * near + 2
    values, weights = np.empty(most, np.float32), np.empty(most, np.float32)
    uncertain = math.log(1 + UNCERTAIN_SIGMA)
    for row in range(rows):
        k = upper[row]
        for c in range(columns):
            if rays[Ray.SEEN, row, c] == 0.0 or rays[Ray.SIGMA, row, c] < uncertain:
                continue
            met = candidates[Candidate.SEGMENT, row, c]
            x, y, z = met * cosine[c], met * sine[c], met * tangent[row] + offset[row]
            u, v = _pixel(projection, x, y, z)
            colour = image[int(v + 0.5), int(u + 0.5)]
            here = np.float32(u), np.float32(v), np.float32(colour[0]), np.float32(colour[1]), np.float32(colour[2])
            count, total = 0, np.float32(0.0)
            for ring in range(max(k + RINGS_NEAR[0], 0), min(k + RINGS_NEAR[1], rings)):
                of_ring = seen[ring]
                for step in range(near):
                    there = c + step * COLUMN_STEP
                    away = of_ring[2, there] - here[2], of_ring[3, there] - here[3], of_ring[4, there] - here[4]
                    weight = _exp(
                        -abs(of_ring[0, there] - here[0]) * NEARER
                        - abs(of_ring[1, there] - here[1]) * LOWER
                        - math.sqrt(away[0] * away[0] + away[1] * away[1] + away[2] * away[2]) * ALIKE
                    )
                    known = of_ring[5, there] > np.float32(0.0)
                    weights[count] = weight if known else np.float32(0.0)
                    values[count] = of_ring[5, there]
                    total += weights[count]
                    count += 1
            share = RETURNS / max(total, np.float32(1e-9))
            for i in range(count):
                weights[i] *= share
            values[count], weights[count] = candidates[Candidate.EDGE, row, c], 1.0
            values[count + 1] = _filled(
                dense, scale, u, v, cosine[c], sine[c], tangent[row], offset[row], projection, met
            )
            weights[count + 1] = 1.0
            median, spread = weighted_median(values, weights, count + 2)
            candidates[Candidate.GUESS, row, c] = median
            rays[Ray.GUESS, row, c] = math.log(np.float32(median / met))
            rays[Ray.GUESS_SPREAD, row, c] = math.log(np.float32(1.0) + spread)


@njit(cache=True, nogil=True)
def along_image(rays, candidates, pixels, upper, tangent, offset, cosine, sine, projection, image):
    """Add the image features of rays whose point on the segment and whose returns above and below are in the image.

    `rays` and `candidates` of LiftInput are updated; `pixels` (K, W, 2) are of the returns, `cosine` and `sine` (W,) of
    the azimuths.
    """
    _, rows, columns = rays.shape
    for row in range(rows):
        k = upper[row]
        for c in range(columns):
            rho = candidates[Candidate.SEGMENT, row, c]
            if rho == 0.0 or np.isnan(pixels[k, c, 0]) or np.isnan(pixels[k + 1, c, 0]):
                continue
            u, v = _pixel(projection, rho * cosine[c], rho * sine[c], rho * tangent[row] + offset[row])
            if not _inside(u, v, image):
                continue
            change_above, colour_above = _change(image, pixels[k, c, 0], pixels[k, c, 1], u, v)
            change_below, colour_below = _change(image, u, v, pixels[k + 1, c, 0], pixels[k + 1, c, 1])
            share = (change_above + 1.0) / (change_above + change_below + 2.0)
            edge = 1 / ((1 - share) / candidates[Candidate.ABOVE, row, c] + share / candidates[Candidate.BELOW, row, c])
            candidates[Candidate.EDGE, row, c] = edge
            rays[Ray.EDGE, row, c] = math.log(edge / rho)
            rays[Ray.SEEN, row, c] = 1.0
            rays[Ray.CHANGE_ABOVE, row, c] = math.log(1 + change_above / 16)
            rays[Ray.CHANGE_BELOW, row, c] = math.log(1 + change_below / 16)
            rays[Ray.COLOUR_ABOVE, row, c] = math.log(1 + colour_above / 16)
            rays[Ray.COLOUR_BELOW, row, c] = math.log(1 + colour_below / 16)
