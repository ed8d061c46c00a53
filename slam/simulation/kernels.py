"""The loops of ray casting and of the camera: rays, which way light comes in, textures, sky, and the picture made of
them. Nothing but @njit here, and all in one file: numba's cache does not see a change in another.

N pixels, row after row. A pixel's ray has the camera's z component 1, so a reach along it is a depth. Light is linear,
RGB; `air` (5, 3) holds the direction towards the sun, then the colours of its light on a surface that faces it, of the
sky at the zenith and at the horizon, and of the light that the ground gives back.
"""

import math

import numpy as np
from numba import njit

_SPECKLE, _BLOTCHES, _BRICKS = 1, 2, 3  # materials.Pattern
_SUN, _SUNLIGHT, _ZENITH, _HORIZON, _GROUND = 0, 1, 2, 3, 4  # rows of `air`
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))


@njit(inline="always")
def _clamp(value):
    return min(max(value, 0.0), 1.0)


@njit(inline="always")
def _hash(i, j, k):
    """Bits of a lattice point, without visible order; the lowest are poor."""
    h = i * np.int64(-7046029254386353131) ^ j * np.int64(-4658895280553007687) ^ k * np.int64(-7723592293110705685)
    return (h ^ (h >> 32)) * np.int64(-2960836687041489767)


@njit(inline="always")
def _random(i, j, k):
    """0..1 at a lattice point."""
    return np.float64((_hash(i, j, k) >> 40) & 0xFFFF) * (1.0 / 65535.0)


@njit(inline="always")
def _smooth(t):
    return t * t * (3.0 - 2.0 * t)


@njit(fastmath=True, error_model="numpy")
def _noise_2d(x, y, layer):
    """Value noise, -1..1, on the unit lattice of a plane; each layer has its own."""
    floor_x, floor_y = np.floor(x), np.floor(y)
    i, j = np.int64(floor_x), np.int64(floor_y)
    a, b = _smooth(x - floor_x), _smooth(y - floor_y)
    low, high = _random(i, j, layer), _random(i, j + 1, layer)
    low += a * (_random(i + 1, j, layer) - low)
    high += a * (_random(i + 1, j + 1, layer) - high)
    return 2.0 * (low + b * (high - low)) - 1.0


@njit(fastmath=True, error_model="numpy")
def _noise_3d(x, y, z):
    """Value noise, -1..1, on the unit lattice of space."""
    floor_z = np.floor(z)
    k = np.int64(floor_z)
    low = _noise_2d(x, y, k)
    return low + _smooth(z - floor_z) * (_noise_2d(x, y, k + 1) - low)


@njit(inline="always")
def _resolved(size, pixel):
    """How much of a pattern of cells of that size is left where a pixel covers `pixel` metres: 1 all, 0 nothing."""
    return _clamp(0.8 * size / pixel - 0.8)


@njit(fastmath=True, error_model="numpy")
def _grain(x, y, z, solid, size, pixel):
    """Noise of cells of that size [m], faded out before it would alias; in space, or on a surface by x and y alone."""
    left = _resolved(size, pixel)
    if left == 0.0:
        return 0.0
    scale = 1.0 / size
    if solid:
        return left * _noise_3d(x * scale, y * scale, z * scale)
    return left * _noise_2d(x * scale, y * scale, np.int64(1000.0 * size))


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
    tint = _random(np.int64(column), np.int64(row), np.int64(7)) - 0.5
    return mean + left * (tint * (1.0 - covered) + joint_tint * covered - mean)


@njit(fastmath=True, error_model="numpy")
def _texture(pattern, x, y, z, nx, ny, nz, pixel):
    """How much brighter or darker than its colour a surface is at a point of the world: about -1..1."""
    level = abs(nz) > 0.97
    solid = pattern == _BLOTCHES and not level
    if not level and not solid:
        # The wall's own axes; the level one in coarse steps, for normals of its triangles differ in their last digits.
        qx, qy = np.floor(nx * 64.0 + 0.5), np.floor(ny * 64.0 + 0.5)
        x, y = (x * qy - y * qx) / math.sqrt(qx * qx + qy * qy + 1e-9), z / math.sqrt(max(1.0 - nz * nz, 1e-3))
    if pattern == _SPECKLE:
        tint = 0.5 * _grain(x, y, z, solid, 2.7, pixel) + 0.45 * _grain(x, y, z, solid, 0.19, pixel)
        return tint + 0.9 * _grain(x, y, z, solid, 0.03, pixel)
    if pattern == _BLOTCHES:
        tint = 0.9 * _grain(x, y, z, solid, 0.9, pixel) + 0.9 * _grain(x, y, z, solid, 0.13, pixel)
        tint += 0.9 * _grain(x, y, z, solid, 0.03, pixel)
        return tint if solid else tint + 0.7 * _grain(x, y, z, solid, 5.3, pixel)  # a lawn is not of one green
    tint = 0.5 * _grain(x, y, z, solid, 2.7, pixel)
    if pattern == _BRICKS:
        return tint + _courses(x, y, 0.25, 0.083, 0.012, 1.0, pixel)
    if level:
        return tint + _courses(x, y, 0.4, 0.4, 0.012, -1.6, pixel)
    return tint + _courses(x, y, 0.24, 0.3, 0.025, -1.6, pixel)


@njit(fastmath=True, error_model="numpy")
def _clear_sky(dx, dy, dz, air):
    """Light of a cloudless sky from a direction (of unit length): paler towards the horizon and around the sun."""
    up = max(dz, 0.0)
    share = 1.0 - (1.0 - up) ** 4
    c = max(dx * air[_SUN, 0] + dy * air[_SUN, 1] + dz * air[_SUN, 2], 0.0)
    c8 = c * c * c * c * c * c * c * c
    glow = 0.05 * c * c + 0.10 * c8 + 0.5 * c8**8 + 2.0 * c8**200
    return (
        air[_HORIZON, 0] * (1.0 - share) + air[_ZENITH, 0] * share + glow * air[_SUNLIGHT, 0],
        air[_HORIZON, 1] * (1.0 - share) + air[_ZENITH, 1] * share + glow * air[_SUNLIGHT, 1],
        air[_HORIZON, 2] * (1.0 - share) + air[_ZENITH, 2] * share + glow * air[_SUNLIGHT, 2],
    )


@njit(fastmath=True, error_model="numpy")
def _sky(dx, dy, dz, air, cover, layer):
    """Light of the sky with its clouds, which lie on a plane overhead that dips a little towards the horizon."""
    red, green, blue = _clear_sky(dx, dy, dz, air)
    if dz <= 0.0:
        return red, green, blue
    x, y = 1.6 * dx / (dz + 0.08), 1.6 * dy / (dz + 0.08)
    density, weight = 0.0, 0.5
    for octave in range(4):
        density += weight * _noise_2d(x, y, layer + octave)
        x, y, weight = 1.7 * x - 1.2 * y, 1.2 * x + 1.7 * y, 0.6 * weight
    opacity = _smooth(_clamp((density + 1.5 * cover - 0.75) * 1.6)) * _clamp(8.0 * dz)
    white = (1.0 - 0.35 * _clamp(density + cover - 0.2)) * (0.35 * air[_SUNLIGHT, 1] + air[_HORIZON, 2])
    return red + opacity * (white - red), green + opacity * (white - green), blue + opacity * (1.02 * white - blue)


@njit(inline="always")
def _lifted(i, rays, reach, normal, origin):
    """The point that pixel i sees, a little above its surface so that a ray can leave it."""
    t = np.float64(reach[i])
    off = 0.004 + 0.0006 * t
    return (
        origin[0] + t * rays[i, 0] + off * normal[i, 0],
        origin[1] + t * rays[i, 1] + off * normal[i, 1],
        origin[2] + t * rays[i, 2] + off * normal[i, 2],
    )


@njit(cache=True, nogil=True)
def turned(rays, R):
    """R (3, 3) times each of rays (N, 3) float32. (numpy's product takes fifty times as long for so thin a matrix.)"""
    out = np.empty_like(rays)
    for i in range(len(rays)):
        for axis in range(3):
            out[i, axis] = R[axis, 0] * rays[i, 0] + R[axis, 1] * rays[i, 1] + R[axis, 2] * rays[i, 2]
    return out


@njit(cache=True, nogil=True)
def face_camera(normal, rays):
    """Turns normals (N, 3), in place, to the side that rays (N, 3) come from."""
    for i in range(len(rays)):
        if normal[i, 0] * rays[i, 0] + normal[i, 1] * rays[i, 1] + normal[i, 2] * rays[i, 2] > 0.0:
            normal[i, 0], normal[i, 1], normal[i, 2] = -normal[i, 0], -normal[i, 1], -normal[i, 2]


@njit(cache=True, nogil=True)
def sun_rays(rays, reach, triangle, normal, origin, width, sun):
    """Every second pixel (M,), as on a chessboard, if it faces the sun, and where its ray towards it starts (M, 3)."""
    pixels = np.empty(len(rays), np.int32)
    count = 0
    for i in range(len(rays)):
        if (i // width + i % width) % 2:
            continue
        if triangle[i] >= 0 and normal[i, 0] * sun[0] + normal[i, 1] * sun[1] + normal[i, 2] * sun[2] > 0.0:
            pixels[count] = i
            count += 1
    start = np.empty((count, 3))
    for m in range(count):
        start[m] = _lifted(pixels[m], rays, reach, normal, origin)
    return pixels[:count], start


@njit(cache=True, nogil=True)
def second_of_two(i, triangle):
    """Whether a pixel is an odd one on the triangle of the one before."""
    return i % 2 == 1 and triangle[i] == triangle[i - 1]


@njit(cache=True, nogil=True)
def double(mirrored, triangle):
    """Give seconds of two what the first mirrors, in place."""
    for i in range(1, len(mirrored), 2):
        if triangle[i] == triangle[i - 1]:
            mirrored[i] = mirrored[i - 1]


@njit(cache=True, nogil=True)
def mirror_rays(rays, reach, triangle, normal, origin, material, gloss):
    """Pixels (M,) of materials with gloss, where their mirrored rays start (M, 3) and whither they go (M, 3).

    Of two neighbours on one triangle, the second has no ray: `second_of_two` says which they are.
    """
    pixels = np.empty(len(rays), np.int32)
    count = 0
    for i in range(len(rays)):
        if triangle[i] >= 0 and gloss[material[triangle[i]]] > 0.0 and not second_of_two(i, triangle):
            pixels[count] = i
            count += 1
    start, direction = np.empty((count, 3)), np.empty((count, 3), np.float32)
    for m in range(count):
        i = pixels[m]
        start[m] = _lifted(i, rays, reach, normal, origin)
        twice = 2.0 * (rays[i, 0] * normal[i, 0] + rays[i, 1] * normal[i, 1] + rays[i, 2] * normal[i, 2])
        for axis in range(3):
            direction[m, axis] = rays[i, axis] - twice * normal[i, axis]
    return pixels[:count], start, direction


@njit(cache=True, nogil=True)
def sky_rays(rays, reach, triangle, normal, origin, width, step):
    """Four rays towards the sky from every `step`-th pixel both ways: cells (M,) of that coarse grid, four in a row the
    same, where the rays start (M, 3) and whither (M, 3). Four neighbouring cells share out 16 directions over the
    hemisphere, as many towards each part of it as light from there counts (by the cosine)."""
    rows, columns = len(rays) // width // step, width // step
    cells = np.empty(4 * rows * columns, np.int32)
    start, direction = np.empty((len(cells), 3)), np.empty((len(cells), 3), np.float32)
    count = 0
    for row in range(rows):
        for column in range(columns):
            i = (row * step + step // 2) * width + column * step + step // 2
            if triangle[i] < 0:
                continue
            nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
            sign = 1.0 if nz >= 0.0 else -1.0  # two axes across the normal: Duff et al., JCGT 6(1), 2017
            a = -1.0 / (sign + nz)
            b = nx * ny * a
            for ray in range(4):
                k = 4 * ray + 2 * (row & 1) + (column & 1)
                r = math.sqrt((k + 0.5) / 16.0)
                up, along, across = math.sqrt(1.0 - r * r), r * math.cos(k * _GOLDEN), r * math.sin(k * _GOLDEN)
                cells[count] = row * columns + column
                start[count] = _lifted(i, rays, reach, normal, origin)
                direction[count, 0] = up * nx + along * (1.0 + sign * nx * nx * a) + across * b
                direction[count, 1] = up * ny + along * sign * b + across * (sign + ny * ny * a)
                direction[count, 2] = up * nz - along * sign * nx - across * ny
                count += 1
    return cells[:count], start[:count], direction[:count]


@njit(inline="always")
def _alike(i, j, reach, normal):
    """How likely pixels i and j see the same surface: 0..1."""
    cos = normal[i, 0] * normal[j, 0] + normal[i, 1] * normal[j, 1] + normal[i, 2] * normal[j, 2]
    gap = 12.0 * abs(reach[i] - reach[j]) / (reach[i] + reach[j])
    return max(cos, 0.0) ** 4 / (1.0 + gap * gap * gap * gap)


@njit(inline="always")
def _centre(row, column, width, step):
    """The pixel in the middle of a cell."""
    return (row * step + step // 2) * width + column * step + step // 2


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def smooth_cells(openness, reach, triangle, normal, width, step):
    """Each cell's share of open sky (rows, columns) averaged with those of its neighbours on the same surface, so that
    all 16 directions count the same; and (rows - 1, columns - 1) whether four neighbouring cells are of one surface."""
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
                        w = _alike(i, j, reach, normal)
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
                same = same and triangle[j] >= 0 and _alike(i, j, reach, normal) > 0.9
            uniform[row, column] = same
    return smoothed, uniform


@njit(fastmath=True, error_model="numpy")
def _openness(row, column, openness, uniform, reach, triangle, normal, width, step):
    """Share of open sky at a pixel: from the four cells around, those on the same surface."""
    rows, columns = openness.shape
    y, x = (row - step // 2) * (1.0 / step), (column - step // 2) * (1.0 / step)
    r, c = min(max(np.int64(y), 0), rows - 2), min(max(np.int64(x), 0), columns - 2)
    b, a = _clamp(y - r), _clamp(x - c)
    if uniform[r, c]:
        low = openness[r, c] + a * (openness[r, c + 1] - openness[r, c])
        return low + b * (openness[r + 1, c] + a * (openness[r + 1, c + 1] - openness[r + 1, c]) - low)
    i, total, weights = row * width + column, 0.0, 0.0
    for down in range(2):
        for right in range(2):
            j = _centre(r + down, c + right, width, step)
            if triangle[j] >= 0:
                w = (b if down else 1.0 - b) * (a if right else 1.0 - a) + 0.01
                w *= _alike(i, j, reach, normal) + 1e-4
                total += w * openness[r + down, c + right]
                weights += w
    return total / weights if weights > 0.0 else 0.7


@njit(fastmath=True, error_model="numpy")
def _mirror(light, ux, uy, uz, n, gloss, sunlit, surface, air):
    """Lays what a glossy surface mirrors over its light (3,): a surface of that colour (3,), linear, or the sky where
    its red is below 0. The camera looks along u onto a normal n (3,)."""
    facing = min(-(ux * n[0] + uy * n[1] + uz * n[2]), 1.0)
    mx, my, mz = ux + 2.0 * facing * n[0], uy + 2.0 * facing * n[1], uz + 2.0 * facing * n[2]
    share = gloss + (1.0 - gloss) * (1.0 - facing) ** 5  # Schlick
    glint = 1.5 * sunlit * max(mx * air[_SUN, 0] + my * air[_SUN, 1] + mz * air[_SUN, 2], 0.0) ** 300
    sky = _clear_sky(mx, my, mz, air)
    for channel in range(3):
        seen = sky[channel]
        if surface[0] >= 0.0:
            seen = surface[channel] * (0.35 * air[_HORIZON, channel] + 0.2 * air[_SUNLIGHT, channel])
        light[channel] += share * (seen + glint * air[_SUNLIGHT, channel] - light[channel])


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def shade(
    rays, reach, triangle, normal, origin, width, focal,  # what each pixel sees
    colour, material,  # (T, 3), (T,)
    linear, pattern, contrast, gloss,  # tables over a colour's value and over MATERIALS
    sunlit, mirrored, openness, uniform, step,  # (N,) 0..1, (N,) the triangle or -1, two of smooth_cells
    air, haze, cover, layer,
):  # fmt: skip
    """Light (N, 3) float32 that reaches the camera."""
    light = np.empty((len(rays), 3), np.float32)
    surface = np.empty(3)
    for i in range(len(rays)):
        row = i // width
        dx, dy, dz = np.float64(rays[i, 0]), np.float64(rays[i, 1]), np.float64(rays[i, 2])
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        ux, uy, uz = dx / length, dy / length, dz / length
        t = triangle[i]
        if t < 0:
            light[i, 0], light[i, 1], light[i, 2] = _sky(ux, uy, uz, air, cover, layer)
            continue
        m = material[t]
        depth = np.float64(reach[i])
        nx, ny, nz = np.float64(normal[i, 0]), np.float64(normal[i, 1]), np.float64(normal[i, 2])
        tint = 0.0
        if pattern[m] > 0:
            pixel = depth / focal / math.sqrt(max(-(ux * nx + uy * ny + uz * nz), 0.02))
            x, y, z = origin[0] + depth * dx, origin[1] + depth * dy, origin[2] + depth * dz
            tint = contrast[m] * _texture(pattern[m], x, y, z, nx, ny, nz, pixel)
        open_sky = _openness(row, i - row * width, openness, uniform, reach, triangle, normal, width, step)
        sun = sunlit[i] * max(nx * air[_SUN, 0] + ny * air[_SUN, 1] + nz * air[_SUN, 2], 0.0)
        up = 0.5 + 0.5 * nz
        for channel in range(3):
            ground = air[_GROUND, channel]
            dome = up * (0.55 * air[_ZENITH, channel] + 0.45 * air[_HORIZON, channel]) + (1.0 - up) * ground
            arriving = open_sky * dome + 0.5 * (1.0 - open_sky) * ground + sun * air[_SUNLIGHT, channel]
            varied = max(1.0 + tint * (1.15 - 0.2 * channel), 0.1)  # more so in red than in blue
            light[i, channel] = linear[colour[t, channel]] * varied * arriving
        if gloss[m] > 0.0:
            for channel in range(3):
                surface[channel] = linear[colour[mirrored[i], channel]] if mirrored[i] >= 0 else -1.0
            _mirror(light[i], ux, uy, uz, normal[i], 0.5 * gloss[m], sunlit[i], surface, air)
        thick = haze * depth * length
        far = 1.0 - 1.0 / (1.0 + thick + 0.5 * thick * thick)  # about 1 - exp(-thick), and quicker
        for channel in range(3):
            light[i, channel] += far * (air[_HORIZON, channel] - light[i, channel])
    return light


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def develop(light, width, exposure, noise, grain, curve):
    """Light (N, 3) -> image (N, 3) uint8: lens falloff, photon noise, then the tone curve, a table over the square root
    of the exposed light from 0 to 2."""
    rows, last = len(light) // width, len(curve) - 1
    image = np.empty((len(light), 3), np.uint8)
    for i in range(len(light)):
        row = i // width
        x, y = (i - row * width) / width - 0.5, (row - 0.5 * rows) / width
        falloff = math.sqrt(exposure * (1.0 - 0.45 * (x * x + y * y)))
        for channel in range(3):
            h = _hash(np.int64(i), np.int64(channel), grain)
            shot = ((h >> 24) & 0xFFFF) + ((h >> 44) & 0xFFFF) - 65535.0  # photon noise is even in the root
            at = int((math.sqrt(light[i, channel]) * falloff + noise / 65535.0 * shot) * 0.5 * last)
            image[i, channel] = curve[min(max(at, 0), last)]
    return image


@njit(cache=True, nogil=True)
def rays(origin, direction, centre):
    """Origins (1, 3) or (N, 3) less a centre (3,), and directions (N, 3), side by side: (N, 6) float32."""
    together = np.empty((len(direction), 6), np.float32)
    common = len(origin) == 1
    for i in range(len(direction)):
        at = 0 if common else i
        for axis in range(3):
            together[i, axis] = origin[at, axis] - centre[axis]
            together[i, 3 + axis] = direction[i, axis]
    return together


@njit(cache=True, nogil=True, fastmath=True)
def rays_near(rays, spheres):
    """Which rays (N, 6) pass through one of the spheres (4, K: centre, radius) or begin in it: their indices (M,)."""
    found = np.empty(len(rays), np.int64)
    count = 0
    cx, cy, cz, radius = spheres[0], spheres[1], spheres[2], spheres[3]
    for i in range(len(rays)):
        ox, oy, oz = rays[i, 0], rays[i, 1], rays[i, 2]
        dx, dy, dz = rays[i, 3], rays[i, 4], rays[i, 5]
        squared = dx * dx + dy * dy + dz * dz
        near = 0
        for k in range(len(radius)):  # without a way out, so that it is done several at a time
            x, y, z = cx[k] - ox, cy[k] - oy, cz[k] - oz
            outside = x * x + y * y + z * z - radius[k] * radius[k]
            along = x * dx + y * dy + z * dz
            near |= (outside <= 0.0) | ((along > 0.0) & (outside * squared <= along * along))
        if near:
            found[count] = i
            count += 1
    return found[:count]
