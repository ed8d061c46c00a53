"""Kernels of keyframes and the map: averages per voxel, range images, beams that pass through voxels.

This file holds @njit functions only, with all that they call: numba's cache does not see changes in other files.

A hash table is one array of slots, `table` (S,) int32: the row of a voxel in the dense arrays, or FREE; open addressing
with linear probing, and a power of two of slots. `cell_keys` (C,) int64 is the key of each row.
"""

import math

import numpy as np
from numba import njit

from slam.data.angle import angle

FREE = np.int32(-1)
_BITS = 21  # bits of a cell index per axis: +-1,048,576 cells, 200 km with 0.2 m cells
_MASK = (1 << _BITS) - 1
_HALF = 1 << (_BITS - 1)
_EVEN = ~(1 | 1 << _BITS | 1 << (2 * _BITS))

# Columns of a voxel's sums: number of points, offsets from the voxel's corner (3), intensity, number of clouds with a
# point in the voxel, number of the last such cloud plus 1; with colour also red, green, blue and the number of coloured
# points. Whole numbers are exact in float32 up to 2^24.
_OFFSET, _INTENSITY, SEEN, _LAST, _COLOUR, _COLOURED = 1, 4, 5, 6, 7, 10
_BLOCK = 256  # points that are processed together
_NEAR = 2e-3  # bins to the next bin, within which the angle in single precision is not sure of the bin


@njit(inline="always")
def _find(table, cell_keys, key):
    """Slot of the voxel `key`, or the free slot where it belongs."""
    mask = len(table) - 1
    low = (key & 1) | ((key >> (_BITS - 1)) & 2) | ((key >> (2 * _BITS - 2)) & 4)
    h = (key & _EVEN) * np.int64(-7046029254386353131)  # 2^64 / golden ratio: mixes the high bits of the product well
    slot = (np.int64(h ^ (h >> 32)) << 3 | low) & mask
    while table[slot] != FREE and cell_keys[table[slot]] != key:
        slot = (slot + 1) & mask
    return slot


@njit
def _voxels(xyz, sigma, max_sigma, pose, size, min_range, max_range, begin, keys, offsets):
    """Write the voxel of each point from `begin` on, -1 for those left out, and the offset from its corner."""
    inverse_size = 1.0 / size
    nearest, farthest = min_range * min_range, max_range * max_range
    for k in range(min(len(keys), len(xyz) - begin)):
        i = begin + k
        px, py, pz = np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2])
        squared = px * px + py * py + pz * pz
        x = pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * pz + pose[0, 3]
        y = pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * pz + pose[1, 3]
        z = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * pz + pose[2, 3]
        cx, cy, cz = np.floor(x * inverse_size), np.floor(y * inverse_size), np.floor(z * inverse_size)
        offsets[k, 0], offsets[k, 1], offsets[k, 2] = x - cx * size, y - cy * size, z - cz * size
        key = ((np.int64(cx) & _MASK) << (2 * _BITS)) | ((np.int64(cy) & _MASK) << _BITS) | (np.int64(cz) & _MASK)
        keys[k] = key if (nearest <= squared) & (squared <= farthest) & (sigma[i] <= max_sigma) else np.int64(-1)


@njit(cache=True, nogil=True)
def average_into(
    xyz, intensity, colour, sigma, max_sigma, pose, size, min_range, max_range, table, cell_keys, sums, number, count
):
    """Add points (N, 3) between the two ranges, transformed by `pose` (4, 4), to the averages of their voxels.

    `colour` is (N, 3) uint8, black where no camera saw the point, or (0, 3). Points with a `sigma` (N,) above
    `max_sigma` are left out. `number` is that of the cloud, from 0. Returns the new number of voxels.

    The points are taken in blocks, so that the waits for the memory of several voxels overlap.
    """
    coloured, latest = len(colour) > 0, np.float32(number + 1)
    keys, offsets, cells = np.empty(_BLOCK, np.int64), np.empty((_BLOCK, 3)), np.empty(_BLOCK, np.int32)
    last, cell = np.int64(-1), np.int32(0)  # two of five successive points are in one voxel
    for begin in range(0, len(xyz), _BLOCK):
        points = min(_BLOCK, len(xyz) - begin)
        _voxels(xyz, sigma, max_sigma, pose, size, min_range, max_range, begin, keys, offsets)
        for k in range(points):
            if keys[k] < 0:
                continue
            if keys[k] != last:
                last = keys[k]
                slot = _find(table, cell_keys, last)
                if table[slot] == FREE:
                    table[slot] = count
                    cell_keys[count] = last
                    sums[count] = 0.0
                    count += 1
                cell = table[slot]
            cells[k] = cell
        for k in range(points):
            if keys[k] < 0:
                continue
            i, row = begin + k, sums[cells[k]]
            if row[_LAST] != latest:
                row[_LAST] = latest
                row[SEEN] += 1.0
            row[0] += 1.0
            row[_OFFSET] += offsets[k, 0]
            row[_OFFSET + 1] += offsets[k, 1]
            row[_OFFSET + 2] += offsets[k, 2]
            row[_INTENSITY] += intensity[i]
            if coloured and (colour[i, 0] > 0 or colour[i, 1] > 0 or colour[i, 2] > 0):
                for channel in range(3):
                    row[_COLOUR + channel] += colour[i, channel]
                row[_COLOURED] += 1.0
    return count


@njit(cache=True, nogil=True)
def rehash(cell_keys, count, table):
    """Insert all voxels into a table that has grown."""
    table[:] = FREE
    for cell in range(count):
        table[_find(table, cell_keys, cell_keys[cell])] = cell


@njit(inline="always")
def _corner(key, axis):
    """Signed index of a voxel along an axis."""
    index = (key >> ((2 - axis) * _BITS)) & _MASK
    return ((index + _HALF) & _MASK) - _HALF


@njit(inline="always")
def _mean(sums, cell_keys, cell, axis, size):
    """Coordinate of the mean point of a voxel."""
    points = np.float64(sums[cell, 0])
    return _corner(cell_keys[cell], axis) * size + sums[cell, _OFFSET + axis] / points


@njit(inline="always")
def _mean_colour(sums, cell, colour):
    """Write the mean colour of a voxel to `colour` (3,); it stays black if no point had one."""
    if sums.shape[1] > _COLOURED and sums[cell, _COLOURED] > 0:
        for channel in range(3):
            colour[channel] = round(sums[cell, _COLOUR + channel] / sums[cell, _COLOURED])


@njit(cache=True, nogil=True)
def averages(sums, cell_keys, kept, size):
    """Compute mean point (K, 3) float32, intensity (K,) float32 and colour (K, 3) uint8 of the voxels `kept` (C,) bool.

    The colour is black if no point had one, and (0, 3) if none of all voxels had one.
    """
    total = kept.sum()
    xyz, intensity = np.empty((total, 3), np.float32), np.empty(total, np.float32)
    colour = np.zeros((total if sums.shape[1] > _COLOURED else 0, 3), np.uint8)
    row = 0
    for cell in range(len(kept)):
        if not kept[cell]:
            continue
        for axis in range(3):
            xyz[row, axis] = _mean(sums, cell_keys, cell, axis, size)
        intensity[row] = sums[cell, _INTENSITY] / np.float64(sums[cell, 0])
        if len(colour):
            _mean_colour(sums, cell, colour[row])
        row += 1
    return xyz, intensity, colour


@njit(cache=True, nogil=True)
def steps(sums, cell_keys, count, size, step):
    """Compute the averages of all voxels in whole numbers, without points beyond int16.

    These are coordinates (K, 3) int16 in steps of `step` [m], intensities (K,) uint8 in steps of 1 / 255, and colours
    (K, 3) uint8.
    """
    xyz, intensity = np.empty((count, 3), np.int16), np.empty(count, np.uint8)
    colour = np.zeros((count if sums.shape[1] > _COLOURED else 0, 3), np.uint8)
    limit, row = np.float32(1 << 15), 0
    for cell in range(count):
        x, y, z = (
            np.rint(np.float32(_mean(sums, cell_keys, cell, 0, size)) / step),
            np.rint(np.float32(_mean(sums, cell_keys, cell, 1, size)) / step),
            np.rint(np.float32(_mean(sums, cell_keys, cell, 2, size)) / step),
        )
        if not (abs(x) < limit and abs(y) < limit and abs(z) < limit):
            continue
        xyz[row, 0], xyz[row, 1], xyz[row, 2] = np.int16(x), np.int16(y), np.int16(z)
        mean = np.float32(sums[cell, _INTENSITY] / np.float64(sums[cell, 0]))
        share = min(max(mean, np.float32(0.0)), np.float32(1.0))
        intensity[row] = np.uint8(np.rint(np.float32(255.0) * share))
        if len(colour):
            _mean_colour(sums, cell, colour[row])
        row += 1
    return xyz[:row], intensity[:row], colour[:row] if len(colour) else colour


@njit(cache=True, nogil=True)
def means(sums, cell_keys, order, size):
    """Compute the mean points (C, 3) float64 of voxels in the given order."""
    xyz = np.empty((len(order), 3))
    for place in range(len(order)):
        for axis in range(3):
            xyz[place, axis] = _mean(sums, cell_keys, order[place], axis, size)
    return xyz


@njit(cache=True, nogil=True)
def tiles(cell_keys, width):
    """Compute the tile (C, 2) int32 of each voxel: x-y squares of `width` voxels."""
    out = np.empty((len(cell_keys), 2), np.int32)
    for cell in range(len(cell_keys)):
        for axis in range(2):
            out[cell, axis] = _corner(cell_keys[cell], axis) // width
    return out


@njit(error_model="numpy")
def _directions(points, count, rows, columns, places):
    """Write row (0 = straight up) and column of `count` directions (3, B) in a range image of the whole sphere.

    The `places` (2, B) are not rounded down; those next to the border of a bin are not sure, see `_bin`. In single
    precision, without branches and checks, eight directions are computed at once.
    """
    half = np.float32(0.5)
    row_step, column_step = np.float32(rows / math.pi), np.float32(columns / (2 * math.pi))
    top, left = half * np.float32(rows), half * np.float32(columns)
    for k in range(count):
        x, y, z = np.float32(points[0, k]), np.float32(points[1, k]), np.float32(points[2, k])
        rho = np.sqrt(x * x + y * y)
        places[0, k] = top - angle(z, rho) * row_step
        places[1, k] = left + angle(y, x) * column_step


@njit(inline="always")
def _bin(x, y, z, row, column, rows, columns):
    """Row and column of the bin of a direction, from its place."""
    row, column = np.float64(row), np.float64(column)
    if not _NEAR < row - math.floor(row) < 1.0 - _NEAR:
        row = (0.5 - math.atan2(z, math.sqrt(x * x + y * y)) / math.pi) * rows
    if not _NEAR < column - math.floor(column) < 1.0 - _NEAR:
        column = (0.5 + math.atan2(y, x) / (2 * math.pi)) * columns
    return min(int(row), rows - 1), int(column) if column < columns else 0


@njit(cache=True, nogil=True)
def range_image(xyz, measured, rows, columns):
    """Compute the range of the nearest `measured` (N,) return [cm] in each bin, (rows, columns) uint16, 0 for none."""
    image = np.zeros((rows, columns), np.uint16)
    points, places = np.zeros((3, _BLOCK)), np.empty((2, _BLOCK), np.float32)
    for begin in range(0, len(xyz), _BLOCK):
        count = min(_BLOCK, len(xyz) - begin)
        for k in range(count):
            for axis in range(3):
                points[axis, k] = xyz[begin + k, axis]
        _directions(points, count, rows, columns, places)
        for k in range(count):
            x, y, z = points[0, k], points[1, k], points[2, k]
            reach = math.sqrt(x * x + y * y + z * z)
            if not (measured[begin + k] and reach > 0.0 and math.isfinite(reach)):
                continue
            row, column = _bin(x, y, z, places[0, k], places[1, k], rows, columns)
            centimetres = max(1, min(int(100.0 * reach), 65535))
            if image[row, column] == 0 or centimetres < image[row, column]:
                image[row, column] = centimetres
    return image


@njit(cache=True, nogil=True)
def nearest_around(image, gap):
    """Compute the range of the nearest return around each bin, (R, C) float32 [m].

    Around a bin are the next bins above and below with a return, at most `gap` rows away, and the same in both adjacent
    columns. The result is 0 for bins that are neither on a ring nor between two.
    """
    rows, columns = image.shape
    nearest = np.full((rows, columns), 1 << 16, np.int32)  # [cm]
    sides = np.zeros((rows, columns), np.int8)
    for upwards in (False, True):  # the last return so far in each column
        last, row_of_last = np.zeros(columns, np.int32), np.full(columns, -rows, np.int32)
        for step in range(rows):
            row = rows - 1 - step if upwards else step
            for column in range(columns):
                if step - row_of_last[column] <= gap:
                    nearest[row, column] = min(nearest[row, column], last[column])
                    sides[row, column] += 1
                if image[row, column] > 0:
                    last[column], row_of_last[column] = image[row, column], step
                    nearest[row, column] = min(nearest[row, column], last[column])
                    sides[row, column] = 2
    out = np.zeros((rows, columns), np.float32)
    for row in range(rows):
        for column in range(columns):
            if sides[row, column] >= 2:
                adjacent = min(nearest[row, column - 1], nearest[row, (column + 1) % columns])
                out[row, column] = 0.01 * min(nearest[row, column], adjacent)
    return out


@njit(cache=True, nogil=True)
def pass_through(nearest, first_row, rows, T_lidar_world, reach, margin, share, xyz, starts, stops, passes):
    """Count in `passes` (C,) uint16 the points (C, 3) within `reach` [m] that the beams of a scan passed.

    `nearest` (R, C) is the result of `nearest_around`, from `first_row` on of an image with `rows` rows. A beam has
    passed a point if all returns around its direction are farther by more than `margin` [m] + `share` of the distance.
    The points are sorted by tile; those of tile t, from starts[t] to stops[t], are checked.
    """
    columns, points, places = nearest.shape[1], np.zeros((3, _BLOCK)), np.empty((2, _BLOCK), np.float32)
    numbers = np.empty(_BLOCK, np.int64)
    for tile in range(len(starts)):
        for begin in range(starts[tile], stops[tile], _BLOCK):
            count = min(_BLOCK, stops[tile] - begin)
            count = _within(xyz, begin, count, T_lidar_world, reach, points, numbers)
            _directions(points, count, rows, columns, places)
            for k in range(count):
                x, y, z = points[0, k], points[1, k], points[2, k]
                row, column = _bin(x, y, z, places[0, k], places[1, k], rows, columns)
                row -= first_row
                if row < 0 or row >= len(nearest):
                    continue
                if nearest[row, column] > math.sqrt(x * x + y * y + z * z) * (1.0 + share) + margin:
                    passes[numbers[k]] = min(passes[numbers[k]] + 1, 65535)


@njit
def _within(xyz, begin, count, T, reach, points, numbers):
    """Write those of `count` points (C, 3) from `begin` on that `T` (4, 4) moves to within `reach` of the origin.

    They are written to `points` (3, B), transformed, and their `numbers` (B,). Returns how many there are.
    """
    found = 0
    for i in range(begin, begin + count):
        wx, wy, wz = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        x = T[0, 0] * wx + T[0, 1] * wy + T[0, 2] * wz + T[0, 3]
        y = T[1, 0] * wx + T[1, 1] * wy + T[1, 2] * wz + T[1, 3]
        z = T[2, 0] * wx + T[2, 1] * wy + T[2, 2] * wz + T[2, 3]
        points[0, found], points[1, found], points[2, found], numbers[found] = x, y, z, i
        found += x * x + y * y + z * z <= reach * reach
    return found
