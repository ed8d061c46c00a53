"""Kernels of shading: the light of each pixel, and the developed image.

This file holds @njit functions only, with all that they call: numba's cache does not see changes in other files.

N pixels, row by row. Light is linear RGB; `air` (5, 3) holds the direction towards the sun and the colours of sunlight
on a surface that faces it, of the sky at the zenith and at the horizon, and of the light that the ground reflects. The
image is shaded by rows: pixels of the same kind are gathered into arrays of a row's length, and simple loops over
these, which the compiler vectorises, compute their light.
"""

import math

import numpy as np
from numba import njit

_BLOTCHES, _BRICKS = 2, 3  # of materials.Pattern
_SUN, _SUNLIGHT, _ZENITH, _HORIZON, _GROUND = 0, 1, 2, 3, 4  # rows of `air`
_I, _J, _K = np.int64(-7046029254386353131), np.int64(-4658895280553007687), np.int64(-7723592293110705685)
_X, _Y, _Z, _NX, _NY, _NZ, _PIXEL, _OUT, _MORE = 0, 1, 2, 3, 4, 5, 6, 7, 8  # rows of what is gathered


@njit(inline="always")
def _clamp(value):
    return min(max(value, 0.0), 1.0)


@njit(inline="always")
def _smooth(t):
    return t * t * (3.0 - 2.0 * t)


@njit(inline="always")
def _squared(value, times):
    """Square a number of times: the 2nd, 4th, 8th .. power."""
    for _ in range(times):
        value *= value
    return value


@njit(inline="always")
def _hash(h):
    """Bits without visible order, the lowest of them poor, of a lattice point: its indices times _I, _J, _K, xored."""
    return (h ^ (h >> 32)) * np.int64(-2960836687041489767)


@njit(inline="always")
def _random(h):
    """0..65535 at a lattice point."""
    return np.float64((_hash(h) >> 40) & 0xFFFF)


@njit(inline="always")
def _between(left, below, above, a, b):
    """0..65535: interpolated between the random values of four lattice points; the right ones follow the left ones."""
    right = left + _I
    low, high = _random(left ^ below), _random(left ^ above)
    low += a * (_random(right ^ below) - low)
    high += a * (_random(right ^ above) - high)
    return low + b * (high - low)


@njit(inline="always")
def _noise_2d(x, y, layer):
    """Value noise, -1..1, on the unit lattice of a plane; each layer has its own."""
    floor_x, floor_y = np.floor(x), np.floor(y)
    below, k = np.int64(floor_y) * _J, layer * _K
    a, b = _smooth(x - floor_x), _smooth(y - floor_y)
    return _between(np.int64(floor_x) * _I, below ^ k, (below + _J) ^ k, a, b) * (2.0 / 65535.0) - 1.0


@njit(inline="always")
def _noise_3d(x, y, z):
    """Value noise, -1..1, on the unit lattice of space."""
    floor_x, floor_y, floor_z = np.floor(x), np.floor(y), np.floor(z)
    left, below, k = np.int64(floor_x) * _I, np.int64(floor_y) * _J, np.int64(floor_z) * _K
    a, b = _smooth(x - floor_x), _smooth(y - floor_y)
    low = _between(left, below ^ k, (below + _J) ^ k, a, b)
    high = _between(left, below ^ (k + _K), (below + _J) ^ (k + _K), a, b)
    return (low + _smooth(z - floor_z) * (high - low)) * (2.0 / 65535.0) - 1.0


@njit(inline="always")
def _resolved(size, pixel):
    """How much of a pattern of cells of that size is left where a pixel covers `pixel` metres: 1 all, 0 nothing."""
    return _clamp(0.8 * size / pixel - 0.8)


@njit(fastmath=True, error_model="numpy")
def _grain(out, x, y, pixel, count, size, weight):
    """Adds noise of cells of that size [m] at places on a surface, faded out before it would alias."""
    scale, layer = 1.0 / size, np.int64(1000.0 * size)
    for i in range(count):
        out[i] += weight * _resolved(size, pixel[i]) * _noise_2d(x[i] * scale, y[i] * scale, layer)


@njit(fastmath=True, error_model="numpy")
def _solid_grain(out, x, y, z, pixel, count, size, weight):
    """The same in space."""
    scale = 1.0 / size
    for i in range(count):
        out[i] += weight * _resolved(size, pixel[i]) * _noise_3d(x[i] * scale, y[i] * scale, z[i] * scale)


@njit(fastmath=True, error_model="numpy")
def _courses(u, v, length, height, joint, joint_tint, pixel):
    """Bricks or tiles in courses, each half a length on from the one below: a tint a piece, and the joints."""
    left = _resolved(height, pixel)
    mean = joint_tint * joint * (1.0 / length + 1.0 / height)
    if left == 0.0:
        return mean
    row = np.floor(v / height)
    u += 0.5 * length * (np.int64(row) & 1)
    column = np.floor(u / length)
    edge = min(u - column * length, v - row * height)  # from the piece's left and lower joint
    covered = _clamp((joint - edge) / max(pixel, 1e-4) + 0.5) * _clamp(joint / pixel)
    tint = _random(np.int64(column) * _I ^ np.int64(row) * _J ^ np.int64(7) * _K) * (1.0 / 65535.0) - 0.5
    return mean + left * (tint * (1.0 - covered) + joint_tint * covered - mean)


@njit(inline="always")
def _level(nz):
    return abs(nz) > 0.97


@njit(inline="always")
def _kind(pattern, nz):
    """Kind of texture: 0 none, 1 speckle, 2 blotches on level ground, 3 blotches in space, 4 bricks, 5 tiles."""
    if pattern == _BLOTCHES:
        return 2 if _level(nz) else 3
    return pattern + 1 if pattern >= _BRICKS else pattern


@njit(fastmath=True, error_model="numpy")
def _to_wall(points, count):
    """Convert points on walls, in place, to coordinates along the wall and up it.

    The horizontal axis of a wall is rounded, since the normals of its triangles differ in their last digits.
    """
    for i in range(count):
        nx, ny, nz = points[_NX, i], points[_NY, i], points[_NZ, i]
        if not _level(nz):
            qx, qy = np.floor(nx * 64.0 + 0.5), np.floor(ny * 64.0 + 0.5)
            along = (points[_X, i] * qy - points[_Y, i] * qx) / math.sqrt(qx * qx + qy * qy + 1e-9)
            points[_X, i], points[_Y, i] = along, points[_Z, i] / math.sqrt(max(1.0 - nz * nz, 1e-3))


@njit(fastmath=True, error_model="numpy")
def _texture(kind, points, count):
    """How much brighter or darker than its colour a surface is, about -1..1, at points of one kind: into row _OUT."""
    x, y, z, pixel, out = points[_X], points[_Y], points[_Z], points[_PIXEL], points[_OUT]
    for i in range(count):
        out[i] = 0.0
    if kind == 1:
        _to_wall(points, count)
        _grain(out, x, y, pixel, count, 2.7, 0.5)
        _grain(out, x, y, pixel, count, 0.19, 0.45)
        _grain(out, x, y, pixel, count, 0.03, 0.9)
    elif kind == 2:
        for size in (0.9, 0.13, 0.03):
            _grain(out, x, y, pixel, count, size, 0.9)
        _grain(out, x, y, pixel, count, 5.3, 0.7)  # a lawn is not of one green
    elif kind == 3:
        for size in (0.9, 0.13, 0.03):
            _solid_grain(out, x, y, z, pixel, count, size, 0.9)
    else:
        _to_wall(points, count)
        _grain(out, x, y, pixel, count, 2.7, 0.5)
        for i in range(count):
            if kind == 4:
                out[i] += _courses(x[i], y[i], 0.25, 0.083, 0.012, 1.0, pixel[i])
            elif _level(points[_NZ, i]):
                out[i] += _courses(x[i], y[i], 0.4, 0.4, 0.012, -1.6, pixel[i])
            else:
                out[i] += _courses(x[i], y[i], 0.24, 0.3, 0.025, -1.6, pixel[i])


@njit(inline="always")
def _haze_free(dx, dy, dz, air, channel):
    """Light of a cloudless sky from a direction (of unit length): paler towards the horizon and around the sun."""
    down = 1.0 - max(dz, 0.0)
    share = 1.0 - _squared(down, 2)
    c = max(dx * air[_SUN, 0] + dy * air[_SUN, 1] + dz * air[_SUN, 2], 0.0)
    c8 = _squared(c, 3)
    c64 = _squared(c8, 3)
    c512 = _squared(c64, 3)
    glow = 0.05 * c * c + 0.10 * c8 + 0.5 * c64 + 2.0 * c512 * c512 * c512 * c64
    return air[_HORIZON, channel] * (1.0 - share) + air[_ZENITH, channel] * share + glow * air[_SUNLIGHT, channel]


@njit(fastmath=True, error_model="numpy")
def _clear_sky(out, points, count, air, channel):
    """`_haze_free` of directions in the rows _X to _Z."""
    x, y, z = points[_X], points[_Y], points[_Z]
    for i in range(count):
        out[i] = _haze_free(x[i], y[i], z[i], air, channel)


@njit(fastmath=True, error_model="numpy")
def _clouds(points, count, layer):
    """How dense clouds are in a direction, into row _OUT; on a plane overhead that dips a little to the horizon."""
    u, v, density = points[_NX], points[_NY], points[_OUT]
    for i in range(count):
        z = max(points[_Z, i], 0.0) + 0.08
        u[i], v[i], density[i] = 1.6 * points[_X, i] / z, 1.6 * points[_Y, i] / z, 0.0
    weight = 0.5
    for octave in range(4):
        for i in range(count):
            density[i] += weight * _noise_2d(u[i], v[i], layer + octave)
            u[i], v[i] = 1.7 * u[i] - 1.2 * v[i], 1.2 * u[i] + 1.7 * v[i]
        weight *= 0.6


@njit(fastmath=True, error_model="numpy")
def _sky(light, pixels, points, count, air, cover, layer):
    """Light (3, W) of the sky with its clouds, for pixels whose directions are in the rows _X to _Z."""
    _clouds(points, count, layer)
    out, opacity, white = points[_MORE], points[_NX], points[_NY]
    for i in range(count):
        density, dz = points[_OUT, i], points[_Z, i]
        opacity[i] = _smooth(_clamp((density + 1.5 * cover - 0.75) * 1.6)) * _clamp(8.0 * dz)
        white[i] = (1.0 - 0.35 * _clamp(density + cover - 0.2)) * (0.35 * air[_SUNLIGHT, 1] + air[_HORIZON, 2])
    for channel in range(3):
        _clear_sky(out, points, count, air, channel)
        tone = 1.02 if channel == 2 else 1.0
        for i in range(count):
            light[channel, pixels[i]] = out[i] + opacity[i] * (tone * white[i] - out[i])


@njit(inline="always")
def _alike(i, depth, nx, ny, nz, reach, normal):
    """How likely pixel i sees the same surface as one that sees that depth and normal: 0..1."""
    cos = normal[i, 0] * nx + normal[i, 1] * ny + normal[i, 2] * nz
    gap = 12.0 * abs(reach[i] - depth) / (reach[i] + depth)
    return _squared(max(cos, 0.0), 2) / (1.0 + _squared(gap, 2))


@njit(inline="always")
def _pixels_alike(i, j, reach, normal):
    """How likely pixels i and j see the same surface: 0..1."""
    return _alike(i, reach[j], normal[j, 0], normal[j, 1], normal[j, 2], reach, normal)


@njit(inline="always")
def _centre(row, column, width, step):
    """The pixel in the middle of a cell."""
    return (row * step + step // 2) * width + column * step + step // 2


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def smooth_cells(openness, reach, triangle, normal, width, step):
    """Average each cell's share of open sky (rows, columns) with its neighbours on the same surface.

    So all 16 directions have equal weight. Also returns (rows - 1, columns - 1), whether four neighbouring cells are on
    one surface.
    """
    rows, columns = openness.shape
    smoothed = np.ones_like(openness)
    for row in range(rows):
        for column in range(columns):
            i = _centre(row, column, width, step)
            if triangle[i] < 0:
                continue
            total, weights = 0.0, 1e-6
            for r in range(max(row - 2, 0), min(row + 3, rows)):
                for c in range(max(column - 2, 0), min(column + 3, columns)):
                    j = _centre(r, c, width, step)
                    if triangle[j] >= 0:
                        w = _pixels_alike(i, j, reach, normal)
                        w *= (0.5 if abs(r - row) == 2 else 1.0) * (0.5 if abs(c - column) == 2 else 1.0)
                        total += w * openness[r, c]
                        weights += w
            smoothed[row, column] = total / weights
    uniform = np.empty((rows - 1, columns - 1), np.bool_)
    for row in range(rows - 1):
        for column in range(columns - 1):
            i = _centre(row, column, width, step)
            same = triangle[i] >= 0
            for j in (i + step, i + step * width, i + step * width + step):
                same = same and triangle[j] >= 0 and _pixels_alike(i, j, reach, normal) > 0.9
            uniform[row, column] = same
    return smoothed, uniform


@njit(fastmath=True, error_model="numpy")
def _openness(open_sky, weights, row, openness, uniform, reach, triangle, normal, step):
    """Share of open sky at each pixel of a row, into open_sky (W,), from the four cells around on the same surface."""
    rows, columns, width = openness.shape[0], openness.shape[1], len(open_sky)
    y = (row - step // 2) * (1.0 / step)
    r = min(max(np.int64(y), 0), rows - 2)
    b = _clamp(y - r)
    for c in range(columns - 1):
        first = 0 if c == 0 else c * step + step // 2
        last = width if c == columns - 2 else (c + 1) * step + step // 2
        if uniform[r, c]:
            left = openness[r, c] + b * (openness[r + 1, c] - openness[r, c])
            right = openness[r, c + 1] + b * (openness[r + 1, c + 1] - openness[r, c + 1])
            for column in range(first, last):
                a = _clamp((column - step // 2) * (1.0 / step) - c)
                open_sky[column] = left + a * (right - left)
        else:
            _openness_of_cell(open_sky, weights, row, first, last, r, c, b, openness, reach, triangle, normal, step)


@njit(fastmath=True, error_model="numpy")
def _openness_of_cell(open_sky, weights, row, first, last, r, c, b, openness, reach, triangle, normal, step):
    """The same where the four cells are of several surfaces."""
    width = len(open_sky)
    for column in range(first, last):
        open_sky[column] = weights[column] = 0.0
    for down in range(2):
        for right in range(2):
            j = _centre(r + down, c + right, width, step)
            if triangle[j] < 0:
                continue
            depth, nx, ny, nz = reach[j], normal[j, 0], normal[j, 1], normal[j, 2]
            share, value = b if down else 1.0 - b, openness[r + down, c + right]
            for column in range(first, last):
                a = _clamp((column - step // 2) * (1.0 / step) - c)
                w = share * (a if right else 1.0 - a) + 0.01
                w *= _alike(row * width + column, depth, nx, ny, nz, reach, normal) + 1e-4
                open_sky[column] += w * value
                weights[column] += w
    for column in range(first, last):
        w = weights[column]
        open_sky[column] = open_sky[column] / w if w > 0.0 else 0.7


@njit(inline="always")
def _towards(i, rays):
    """The direction of a pixel's ray, of unit length, and how long the ray is that reaches 1 in depth."""
    dx, dy, dz = np.float64(rays[i, 0]), np.float64(rays[i, 1]), np.float64(rays[i, 2])
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    return dx / length, dy / length, dz / length, length


@njit(fastmath=True, error_model="numpy")
def _shade_sky(light, start, rays, triangle, air, cover, layer, pixels, points):
    """Gives the pixels of a row that see nothing else the light of the sky."""
    count = 0
    for column in range(light.shape[1]):
        if triangle[start + column] < 0:
            points[_X, count], points[_Y, count], points[_Z, count], _ = _towards(start + column, rays)
            pixels[count] = column
            count += 1
    if count:
        _sky(light, pixels, points, count, air, cover, layer)


@njit(fastmath=True, error_model="numpy")
def _tints(tint, start, rays, reach, triangle, normal, origin, focal, material, pattern, contrast, kinds, points):
    """How much brighter or darker than its colour the surface of each pixel of a row is, into tint (W,)."""
    counts = np.zeros(6, np.int64)
    for column in range(len(tint)):
        tint[column] = 0.0
        t = triangle[start + column]
        if t >= 0:
            kind = _kind(pattern[material[t]], normal[start + column, 2])
            kinds[kind, counts[kind]] = column
            counts[kind] += 1
    for kind in range(1, 6):
        count, columns = counts[kind], kinds[kind]
        for m in range(count):
            i = start + columns[m]
            ux, uy, uz, _ = _towards(i, rays)
            nx, ny, nz, depth = normal[i, 0], normal[i, 1], normal[i, 2], np.float64(reach[i])
            points[_X, m] = origin[0] + depth * rays[i, 0]
            points[_Y, m] = origin[1] + depth * rays[i, 1]
            points[_Z, m] = origin[2] + depth * rays[i, 2]
            points[_NX, m], points[_NY, m], points[_NZ, m] = nx, ny, nz
            points[_PIXEL, m] = depth / focal / math.sqrt(max(-(ux * nx + uy * ny + uz * nz), 0.02))
        if count:
            _texture(kind, points, count)
        for m in range(count):
            tint[columns[m]] = contrast[material[triangle[start + columns[m]]]] * points[_OUT, m]


@njit(fastmath=True, error_model="numpy")
def _shade_surfaces(light, start, triangle, normal, colour, linear, sunlit, tint, open_sky, air, points):
    """Gives each pixel of a row the light that the surface it sees scatters."""
    width = len(tint)
    sun, up, albedo = points[_X], points[_Y], points[_Z]
    for column in range(width):
        i = start + column
        nx, ny, nz = np.float64(normal[i, 0]), np.float64(normal[i, 1]), np.float64(normal[i, 2])
        sun[column] = sunlit[i] * max(nx * air[_SUN, 0] + ny * air[_SUN, 1] + nz * air[_SUN, 2], 0.0)
        up[column] = 0.5 + 0.5 * nz
    for channel in range(3):
        for column in range(width):
            albedo[column] = linear[colour[max(triangle[start + column], 0), channel]]
        ground, sunlight = air[_GROUND, channel], air[_SUNLIGHT, channel]
        dome = 0.55 * air[_ZENITH, channel] + 0.45 * air[_HORIZON, channel]
        for column in range(width):
            above = up[column] * dome + (1.0 - up[column]) * ground
            free = open_sky[column]
            arriving = free * above + 0.5 * (1.0 - free) * ground + sun[column] * sunlight
            varied = max(1.0 + tint[column] * (1.15 - 0.2 * channel), 0.1)  # more so in red than in blue
            light[channel, column] = albedo[column] * varied * arriving


@njit(fastmath=True, error_model="numpy")
def _shade_mirrors(
    light, start, rays, triangle, normal, colour, material, linear, gloss, sunlit, mirrored, air, pixels, points
):
    """Lays what glossy surfaces mirror over their light: another surface, or the sky."""
    count = 0
    for column in range(light.shape[1]):
        i = start + column
        if triangle[i] >= 0 and gloss[material[triangle[i]]] > 0.0:
            ux, uy, uz, _ = _towards(i, rays)
            nx, ny, nz = np.float64(normal[i, 0]), np.float64(normal[i, 1]), np.float64(normal[i, 2])
            facing = min(-(ux * nx + uy * ny + uz * nz), 1.0)
            points[_X, count] = ux + 2.0 * facing * nx
            points[_Y, count] = uy + 2.0 * facing * ny
            points[_Z, count] = uz + 2.0 * facing * nz
            points[_NX, count], points[_NY, count] = facing, 0.5 * gloss[material[triangle[i]]]
            pixels[count] = column
            count += 1
    share, glint, sky = points[_NZ], points[_PIXEL], points[_OUT]
    for m in range(count):
        away, own = 1.0 - points[_NX, m], points[_NY, m]
        share[m] = own + (1.0 - own) * _squared(away, 2) * away  # Schlick
        c = points[_X, m] * air[_SUN, 0] + points[_Y, m] * air[_SUN, 1] + points[_Z, m] * air[_SUN, 2]
        c4 = _squared(max(c, 0.0), 2)
        c32 = _squared(c4, 3)
        glint[m] = 1.5 * _squared(c32, 3) * c32 * _squared(c4, 1) * c4  # its 300th power
    for channel in range(3):
        _clear_sky(sky, points, count, air, channel)
        for m in range(count):
            i = start + pixels[m]
            seen = sky[m]
            if mirrored[i] >= 0:
                albedo = linear[colour[mirrored[i], channel]]
                seen = albedo * (0.35 * air[_HORIZON, channel] + 0.2 * air[_SUNLIGHT, channel])
            own = light[channel, pixels[m]]
            light[channel, pixels[m]] += share[m] * (seen + sunlit[i] * glint[m] * air[_SUNLIGHT, channel] - own)


@njit(fastmath=True, error_model="numpy")
def _shade_air(light, start, rays, reach, air, haze, points):
    """Attenuates the light between surface and camera and adds that of the air."""
    far = points[_OUT]
    for column in range(light.shape[1]):
        thick = haze * np.float64(reach[start + column]) * _towards(start + column, rays)[3]
        far[column] = 1.0 - 1.0 / (1.0 + thick + 0.5 * thick * thick)  # about 1 - exp(-thick), and quicker
    for channel in range(3):
        for column in range(light.shape[1]):
            light[channel, column] += far[column] * (air[_HORIZON, channel] - light[channel, column])


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def shade(
    rays, reach, triangle, normal, origin, width, focal,  # what each pixel sees
    colour, material,  # (T, 3), (T,)
    linear, pattern, contrast, gloss,  # tables over a colour's value and over MATERIALS
    sunlit, mirrored, openness, uniform, step,  # (N,) 0..1, (N,) the triangle or -1, two of smooth_cells
    air, haze, cover, layer,
):  # fmt: skip
    """Compute the light (N, 3) float32 that reaches the camera."""
    image = np.empty((len(rays), 3), np.float32)
    light, tint, open_sky = np.empty((3, width), np.float32), np.empty(width), np.empty(width)
    points, pixels = np.empty((_MORE + 1, width)), np.empty((6, width), np.int64)
    for row in range(len(rays) // width):
        start = row * width
        _openness(open_sky, points[_OUT], row, openness, uniform, reach, triangle, normal, step)
        _tints(tint, start, rays, reach, triangle, normal, origin, focal, material, pattern, contrast, pixels, points)
        _shade_surfaces(light, start, triangle, normal, colour, linear, sunlit, tint, open_sky, air, points)
        _shade_mirrors(
            light, start, rays, triangle, normal, colour, material, linear, gloss, sunlit, mirrored, air, pixels[0],
            points,
        )  # fmt: skip
        _shade_air(light, start, rays, reach, air, haze, points)
        _shade_sky(light, start, rays, triangle, air, cover, layer, pixels[0], points)
        for column in range(width):
            for channel in range(3):
                image[start + column, channel] = light[channel, column]
    return image


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def develop(light, width, exposure, noise, grain, curve):
    """Develop light (N, 3) into an image (N, 3) uint8, blue first: lens falloff, photon noise, and the tone curve.

    The tone curve is a table over the square root of the exposed light from 0 to 2.
    """
    rows, last = len(light) // width, len(curve) - 1
    image = np.empty((len(light), 3), np.uint8)
    for i in range(len(light)):
        row = i // width
        x, y = (i - row * width) / width - 0.5, (row - 0.5 * rows) / width
        falloff = math.sqrt(exposure * (1.0 - 0.45 * (x * x + y * y)))
        for channel in range(3):
            h = _hash(np.int64(i) * _I ^ np.int64(channel) * _J ^ grain * _K)
            shot = ((h >> 24) & 0xFFFF) + ((h >> 44) & 0xFFFF) - 65535.0  # photon noise is even in the root
            at = int((math.sqrt(light[i, channel]) * falloff + noise / 65535.0 * shot) * 0.5 * last)
            image[i, 2 - channel] = curve[min(max(at, 0), last)]
    return image
