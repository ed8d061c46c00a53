"""Loops of Lift's input. Nothing but @njit here; a cached kernel and all it calls share a file."""

import math

import numpy as np
from numba import njit

STEPS = 12  # pixels looked at on each half of the way between the returns above and below
LEAST, MOST = 0.8, 1.25  # of the nearer and the further return: how far surfaces are extended


@njit(inline="always")
def _bounded(value, low, high):
    return min(max(value, low), high)


@njit(inline="always")
def _extended(rho, z, beyond_rho, beyond_z, tangent, offset, low, high):
    """rho where a ray meets the line through a return and the one `beyond`, extended past the return; 0: nowhere."""
    forth, down = rho - beyond_rho, z - beyond_z
    above, fall = z - tangent * rho - offset, tangent * forth - down
    share = above / fall if fall != 0.0 else -1.0
    if share < 0.0:
        return 0.0
    return _bounded(rho + share * forth, low, high)


@njit(cache=True, nogil=True)
def between_rings(rho, z, length, slope, turn, beside, sigma, upper, tangent, offset, row_share, gap, channels):
    """`rays` and `candidates` of LiftInput, without what the image gives.

    rho, z (K, W); length, slope, turn, beside, sigma (K - 1, W); upper, tangent, offset, row_share (Q,); gap (K - 1,).
    """
    rings, columns = rho.shape
    rays = np.zeros((channels, len(upper), columns), np.float32)
    candidates = np.zeros((6, len(upper), columns), np.float32)
    for row in range(len(upper)):
        k = upper[row]
        for c in range(columns):
            if length[k, c] == 0.0:
                continue
            forth, down = rho[k + 1, c] - rho[k, c], z[k + 1, c] - z[k, c]
            above, fall = z[k, c] - tangent[row] * rho[k, c] - offset[row], tangent[row] * forth - down
            share = _bounded(above / fall if fall != 0.0 else 0.5, 0.0, 1.0)
            met = rho[k, c] + share * forth
            low, high = LEAST * min(rho[k, c], rho[k + 1, c]), MOST * max(rho[k, c], rho[k + 1, c])
            candidates[0, row, c], candidates[1, row, c], candidates[2, row, c] = met, rho[k, c], rho[k + 1, c]
            if k > 0 and rho[k - 1, c] > 0.0:
                candidates[3, row, c] = _extended(
                    rho[k, c], z[k, c], rho[k - 1, c], z[k - 1, c], tangent[row], offset[row], low, high
                )
            if k + 2 < rings and rho[k + 2, c] > 0.0:
                candidates[4, row, c] = _extended(
                    rho[k + 1, c], z[k + 1, c], rho[k + 2, c], z[k + 2, c], tangent[row], offset[row], low, high
                )
            rays[0, row, c], rays[1, row, c], rays[2, row, c] = 1.0, row_share[row], math.log(met / 10)
            for candidate in range(1, 5):
                if candidates[candidate, row, c] > 0.0:
                    rays[2 + candidate, row, c] = math.log(candidates[candidate, row, c] / met)
            rays[8, row, c], rays[9, row, c] = math.log(1 + length[k, c]), slope[k, c]
            rays[10, row, c], rays[11, row, c] = min(turn[k, c], 1.0), math.log(1 + beside[k, c])
            rays[12, row, c], rays[13, row, c] = math.log(1 + sigma[k, c]), gap[k]
    return rays, candidates


@njit(inline="always")
def _pixel(projection, x, y, z):
    """u, v of a point; NaN behind the camera."""
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
    """Fills `out` (4, K, W): seen, red, green, blue of the returns in the image; returns their pixels (K, W, 2).

    projection (3, 4) from the LiDAR's frame to pixels; image (H, W, 3) uint8.
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
    """Length of the way through colours (0..255 each) on the straight way from pixel to pixel, and from end to end."""
    total = 0.0
    first = image[int(v + 0.5), int(u + 0.5)]
    before = first
    for step in range(1, STEPS + 1):
        share = step / STEPS
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


@njit(cache=True, nogil=True)
def along_image(rays, candidates, pixels, upper, tangent, offset, cosine, sine, projection, image):
    """Adds what the image says of rays whose point on the segment and whose returns above and below lie in it.

    rays, candidates: of LiftInput, changed; pixels (K, W, 2) of the returns; cosine, sine (W,) of the azimuths.
    """
    _, rows, columns = rays.shape
    for row in range(rows):
        k = upper[row]
        for c in range(columns):
            rho = candidates[0, row, c]
            if rho == 0.0 or np.isnan(pixels[k, c, 0]) or np.isnan(pixels[k + 1, c, 0]):
                continue
            u, v = _pixel(projection, rho * cosine[c], rho * sine[c], rho * tangent[row] + offset[row])
            if not _inside(u, v, image):
                continue
            change_above, colour_above = _change(image, pixels[k, c, 0], pixels[k, c, 1], u, v)
            change_below, colour_below = _change(image, u, v, pixels[k + 1, c, 0], pixels[k + 1, c, 1])
            share = (change_above + 1.0) / (change_above + change_below + 2.0)
            edge = 1 / ((1 - share) / candidates[1, row, c] + share / candidates[2, row, c])
            candidates[5, row, c] = edge
            rays[7, row, c] = math.log(edge / rho)
            rays[14, row, c] = 1.0
            rays[15, row, c], rays[16, row, c] = math.log(1 + change_above / 16), math.log(1 + change_below / 16)
            rays[17, row, c], rays[18, row, c] = math.log(1 + colour_above / 16), math.log(1 + colour_below / 16)
