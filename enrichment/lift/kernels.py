"""Kernels of Lift's input.

This file holds @njit functions only, with all that they call: numba's cache does not see changes in other files.
Therefore it has its own copies of `_intersect_segment` and the azimuth column (`enrichment.geometry.kernels`), and of
`_pixel` (`slam.data.camera.project`).
"""

import math

import numpy as np
from numba import njit

from enrichment.lift.channels import CANDIDATES, RAYS, Candidate, Ray

EDGE_STEPS = 12  # pixels sampled on each half of the line between the returns above and below
UNCERTAIN_SIGMA = 0.4  # m: rays whose segment has a larger sigma get a GUESS
#: Neighbouring returns: rings relative to the one above the ray, columns to either side, and their step.
RINGS_NEAR, COLUMNS_NEAR, COLUMN_STEP = (-1, 3), 8, 2
#: Horizontal and vertical distance [pixels] and colour difference (of 255) at which the weight of a return falls by e;
#: total weight of the returns, where EDGE and the completed depth weigh 1 each.
HORIZONTAL, VERTICAL, COLOUR, RETURNS = 20.0, 30.0, 25.0, 2.0
LEAST, MOST = 0.8, 1.25  # limits of extrapolated surfaces, relative to the nearer and the farther return
NEAR_RAY = 0.15  # share of the gap between two rings: maximum distance of past returns from a ray
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
def between_rings(rho, z, length, slope, turn, outlier_distance, sigma, upper, tangent, offset, row_share, gap):
    """Compute `rays` and `candidates` of LiftInput without the features of the image and of earlier scans.

    Shapes: rho, z (K, W); length, slope, turn, outlier_distance, sigma (K - 1, W); upper, tangent, offset, row_share
    (Q,); gap (K - 1,).
    """
    rings, columns = rho.shape
    rays = np.zeros((RAYS, len(upper), columns), np.float32)
    candidates = np.zeros((CANDIDATES, len(upper), columns), np.float32)
    for row in range(len(upper)):
        k = upper[row]
        for c in range(columns):
            if length[k, c] == 0.0:
                continue
            met = _intersect_segment(rho[k, c], z[k, c], rho[k + 1, c], z[k + 1, c], tangent[row], offset[row])
            low, high = LEAST * min(rho[k, c], rho[k + 1, c]), MOST * max(rho[k, c], rho[k + 1, c])
            candidates[Candidate.SEGMENT, row, c] = met
            candidates[Candidate.ABOVE, row, c], candidates[Candidate.BELOW, row, c] = rho[k, c], rho[k + 1, c]
            if k > 0 and rho[k - 1, c] > 0.0:
                candidates[Candidate.FROM_ABOVE, row, c] = _extended(
                    rho[k, c], z[k, c], rho[k - 1, c], z[k - 1, c], tangent[row], offset[row], low, high
                )
            if k + 2 < rings and rho[k + 2, c] > 0.0:
                candidates[Candidate.FROM_BELOW, row, c] = _extended(
                    rho[k + 1, c], z[k + 1, c], rho[k + 2, c], z[k + 2, c], tangent[row], offset[row], low, high
                )
            rays[Ray.KNOWN, row, c], rays[Ray.SHARE, row, c] = 1.0, row_share[row]
            rays[Ray.RANGE, row, c] = math.log(met / 10)
            for other in range(4):  # ABOVE to FROM_BELOW, in the same order in both enumerations
                rho_there = candidates[Candidate.ABOVE + other, row, c]
                if rho_there > 0.0:
                    rays[Ray.ABOVE + other, row, c] = math.log(rho_there / met)
            rays[Ray.LENGTH, row, c], rays[Ray.SLOPE, row, c] = math.log(1 + length[k, c]), slope[k, c]
            rays[Ray.TURN, row, c] = min(turn[k, c], 1.0)
            rays[Ray.OUTLIER_DISTANCE, row, c] = math.log(1 + outlier_distance[k, c])
            rays[Ray.SIGMA, row, c], rays[Ray.GAP, row, c] = math.log(1 + sigma[k, c]), gap[k]
    return rays, candidates


@njit(inline="always")
def _nearest_row(z, rho, tangent, offset):
    """Index of the line nearest to a point; lines are sorted from the highest to the lowest."""
    low, high = 0, len(tangent)
    while low < high:
        middle = (low + high) // 2
        if tangent[middle] * rho + offset[middle] > z:
            low = middle + 1
        else:
            high = middle
    if low == len(tangent):
        return low - 1
    if low > 0 and tangent[low - 1] * rho + offset[low - 1] - z < z - tangent[low] * rho - offset[low]:
        return low - 1
    return low


@njit(cache=True, nogil=True)
def accumulate_history(rays, candidates, best, xyz, T_now_then, age, rho, z, upper, tangent, offset, gap):
    """Add the returns of an earlier scan (N, 3) near the rays, relative to the current segments.

    `rays` and `candidates` of LiftInput are updated, as is `best` (Q, W), the distance of the candidate's return from
    its ray, infinite before the first scan.
    """
    columns = rho.shape[1]
    for i in range(len(xyz)):
        x, y, up = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        px = T_now_then[0, 0] * x + T_now_then[0, 1] * y + T_now_then[0, 2] * up + T_now_then[0, 3]
        py = T_now_then[1, 0] * x + T_now_then[1, 1] * y + T_now_then[1, 2] * up + T_now_then[1, 3]
        pz = T_now_then[2, 0] * x + T_now_then[2, 1] * y + T_now_then[2, 2] * up + T_now_then[2, 3]
        far = math.hypot(px, py)
        if far < 1.0:
            continue
        row = _nearest_row(pz, far, tangent, offset)
        k = upper[row]
        off = abs(pz - tangent[row] * far - offset[row]) / (gap[k] * far / 10)
        c = min(int((math.atan2(py, px) / (2 * math.pi) + 0.5) * columns), columns - 1)
        if off > NEAR_RAY or rays[Ray.KNOWN, row, c] == 0.0:
            continue
        slant = (pz - offset[row]) / far
        ratio = far / _intersect_segment(rho[k, c], z[k, c], rho[k + 1, c], z[k + 1, c], slant, offset[row])
        found = ratio * candidates[Candidate.SEGMENT, row, c]
        if not LEAST * min(rho[k, c], rho[k + 1, c]) <= found <= MOST * max(rho[k, c], rho[k + 1, c]):
            continue
        change = math.log(ratio)
        if best[row, c] == np.inf:
            rays[Ray.PAST_NEAREST, row, c], rays[Ray.PAST_FURTHEST, row, c] = change, change
        rays[Ray.PAST_NEAREST, row, c] = min(rays[Ray.PAST_NEAREST, row, c], change)
        rays[Ray.PAST_FURTHEST, row, c] = max(rays[Ray.PAST_FURTHEST, row, c], change)
        rays[Ray.PAST_RETURNS, row, c] += 1.0
        if off + AGE * age < best[row, c]:
            best[row, c] = off + AGE * age
            rays[Ray.PAST, row, c], candidates[Candidate.PAST, row, c] = change, found


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
def _difference(image, u, v, other_u, other_v):
    """Difference of the colours of two pixels."""
    one, other = image[int(v + 0.5), int(u + 0.5)], image[int(other_v + 0.5), int(other_u + 0.5)]
    square = 0.0
    for channel in range(3):
        square += (float(one[channel]) - float(other[channel])) ** 2
    return math.sqrt(square)


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
def _weighted_median(values, weights):
    """Weighted median, the smallest value that reaches half of the weight, and the mean distance from it."""
    order = np.argsort(values)
    half, reached, median = weights.sum() / 2, 0.0, values[order[0]]
    for i in order:
        reached += weights[i]
        if reached >= half:
            median = values[i]
            break
    spread = 0.0
    for i in range(len(values)):
        spread += weights[i] * abs(values[i] - median)
    return median, spread / (2 * half)


@njit(inline="always")
def _filled(dense, scale, u, v, cosine, sine, tangent, offset, projection, otherwise):
    """Rho where the depth of a ray equals that of the depth image at its pixel."""
    depth = dense[min(int((v + 0.5) * scale), dense.shape[0] - 1), min(int((u + 0.5) * scale), dense.shape[1] - 1)]
    along = projection[2, 0] * cosine + projection[2, 1] * sine + projection[2, 2] * tangent
    rho = (depth - projection[2, 2] * offset - projection[2, 3]) / along
    return rho if depth > 0.0 and rho > 0.0 else otherwise


@njit(cache=True, nogil=True)
def guess(rays, candidates, pixels, upper, tangent, offset, cosine, sine, projection, image, rho, dense, scale):
    """Add the candidate GUESS on uncertain rays in the image, its ratio to the segment, and the spread of its inputs.

    GUESS is the weighted median of EDGE, of nearby returns with similar colour and of a completed depth image. `pixels`
    (K, W, 2) and `rho` (K, W) are of the returns; `dense` (h, w) is the depth with `scale` cells per pixel.
    """
    _, rows, columns = rays.shape
    rings = rho.shape[0]
    most = (RINGS_NEAR[1] - RINGS_NEAR[0]) * (2 * COLUMNS_NEAR // COLUMN_STEP + 1) + 2
    values, weights = np.empty(most), np.empty(most)
    for row in range(rows):
        k = upper[row]
        for c in range(columns):
            if rays[Ray.SEEN, row, c] == 0.0 or math.exp(rays[Ray.SIGMA, row, c]) - 1 < UNCERTAIN_SIGMA:
                continue
            met = candidates[Candidate.SEGMENT, row, c]
            x, y, z = met * cosine[c], met * sine[c], met * tangent[row] + offset[row]
            u, v = _pixel(projection, x, y, z)
            count, total = 0, 0.0
            for ring in range(max(k + RINGS_NEAR[0], 0), min(k + RINGS_NEAR[1], rings)):
                for shift in range(-COLUMNS_NEAR, COLUMNS_NEAR + 1, COLUMN_STEP):
                    other = (c + shift) % columns
                    if np.isnan(pixels[ring, other, 0]):
                        continue
                    other_u, other_v = pixels[ring, other, 0], pixels[ring, other, 1]
                    far = abs(other_u - u) / HORIZONTAL + abs(other_v - v) / VERTICAL
                    weights[count] = math.exp(-far - _difference(image, u, v, other_u, other_v) / COLOUR)
                    values[count] = rho[ring, other]
                    total += weights[count]
                    count += 1
            for i in range(count):
                weights[i] *= RETURNS / max(total, 1e-9)
            values[count], weights[count] = candidates[Candidate.EDGE, row, c], 1.0
            count += 1
            values[count] = _filled(dense, scale, u, v, cosine[c], sine[c], tangent[row], offset[row], projection, met)
            weights[count] = 1.0
            count += 1
            median, spread = _weighted_median(values[:count], weights[:count])
            candidates[Candidate.GUESS, row, c] = median
            rays[Ray.GUESS, row, c], rays[Ray.GUESS_SPREAD, row, c] = math.log(median / met), math.log(1 + spread)


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
