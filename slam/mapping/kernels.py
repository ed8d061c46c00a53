"""Kernels of keyframes and the map: averages per voxel, range images, beams that pass through voxels.

This file holds @njit functions only, with all that they call: numba's cache does not see changes in other files.

A hash table is one array of slots, `table` (S,) int32: the row of a voxel in the dense arrays, or FREE; open addressing
with linear probing, and a power of two of slots. `cell_keys` (C,) int64 is the key of each row.
"""

import math

import numpy as np
from numba import njit

FREE = np.int32(-1)
_BITS = 21  # bits of a cell index per axis: +-1,048,576 cells, 200 km with 0.2 m cells
_MASK = (1 << _BITS) - 1
_HALF = 1 << (_BITS - 1)

# Columns of a voxel's sums: number of points, offsets from the voxel's corner (3), intensity; with colour also red,
# green, blue and the number of coloured points.
_OFFSET, _INTENSITY, _COLOUR, _COLOURED = 1, 4, 5, 8


@njit(inline="always")
def _find(table, cell_keys, key):
    """Slot of the voxel `key`, or the free slot where it belongs."""
    mask = len(table) - 1
    h = key * np.int64(-7046029254386353131)  # 2^64 / golden ratio: mixes the high bits of the product well
    slot = np.int64(h ^ (h >> 32)) & mask
    while table[slot] != FREE and cell_keys[table[slot]] != key:
        slot = (slot + 1) & mask
    return slot


@njit(cache=True, nogil=True)
def average_into(
    xyz, intensity, colour, pose, size, min_range, max_range, table, cell_keys, sums, seen, last, number, count
):
    """Add points (N, 3) between the two ranges, transformed by `pose` (4, 4), to the averages of their voxels.

    `colour` is (N, 3) uint8, black where no camera saw the point, or (0, 3). `seen` (C,) uint16 counts the clouds with
    a point in a voxel, `last` (C,) int32 is the `number` of the latest one. Returns the new number of voxels.
    """
    inverse_size = 1.0 / size
    coloured = len(colour) > 0
    last_key, cell = np.int64(-1), 0
    for i in range(len(xyz)):
        px, py, pz = np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2])
        if not min_range * min_range <= px * px + py * py + pz * pz <= max_range * max_range:
            continue
        x = pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * pz + pose[0, 3]
        y = pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * pz + pose[1, 3]
        z = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * pz + pose[2, 3]
        cx, cy, cz = math.floor(x * inverse_size), math.floor(y * inverse_size), math.floor(z * inverse_size)
        key = ((np.int64(cx) & _MASK) << (2 * _BITS)) | ((np.int64(cy) & _MASK) << _BITS) | (np.int64(cz) & _MASK)
        if key != last_key:  # consecutive points of a scan mostly share the voxel
            last_key = key
            slot = _find(table, cell_keys, key)
            if table[slot] == FREE:
                table[slot] = count
                cell_keys[count] = key
                sums[count] = 0.0
                seen[count] = 0
                last[count] = -1
                count += 1
            cell = table[slot]
            if last[cell] != number:
                last[cell] = number
                seen[cell] = min(seen[cell] + 1, 65535)
        row = sums[cell]
        row[0] += 1.0
        row[_OFFSET] += x - cx * size
        row[_OFFSET + 1] += y - cy * size
        row[_OFFSET + 2] += z - cz * size
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


@njit(cache=True, nogil=True)
def averages(sums, cell_keys, kept, size):
    """Compute mean point (K, 3) float32, intensity (K,) float32 and colour (K, 3) uint8 of the voxels `kept` (C,) bool.

    The colour is black if no point had one.
    """
    total = kept.sum()
    xyz, intensity = np.empty((total, 3), np.float32), np.empty(total, np.float32)
    colour = np.zeros((total, 3), np.uint8)
    coloured = sums.shape[1] > _COLOURED
    row = 0
    for cell in range(len(kept)):
        if not kept[cell]:
            continue
        points = np.float64(sums[cell, 0])
        for axis in range(3):
            xyz[row, axis] = _corner(cell_keys[cell], axis) * size + sums[cell, _OFFSET + axis] / points
        intensity[row] = sums[cell, _INTENSITY] / points
        if coloured and sums[cell, _COLOURED] > 0:
            for channel in range(3):
                colour[row, channel] = round(sums[cell, _COLOUR + channel] / sums[cell, _COLOURED])
        row += 1
    return xyz, intensity, colour


@njit(cache=True, nogil=True)
def tiles(cell_keys, width):
    """Compute the tile (C, 2) int32 of each voxel: x-y squares of `width` voxels."""
    out = np.empty((len(cell_keys), 2), np.int32)
    for cell in range(len(cell_keys)):
        for axis in range(2):
            out[cell, axis] = _corner(cell_keys[cell], axis) // width
    return out


@njit(inline="always")
def _bin(x, y, z, rows, columns):
    """Row (0 = straight up) and column of a direction in a range image of the whole sphere."""
    row = int((0.5 - math.atan2(z, math.sqrt(x * x + y * y)) / math.pi) * rows)
    column = int((0.5 + math.atan2(y, x) / (2 * math.pi)) * columns)
    return min(row, rows - 1), column % columns


@njit(cache=True, nogil=True)
def range_image(xyz, rows, columns):
    """Compute the range of the nearest return [cm] in each bin, (rows, columns) uint16, 0 without a return."""
    image = np.zeros((rows, columns), np.uint16)
    for i in range(len(xyz)):
        x, y, z = np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2])
        reach = math.sqrt(x * x + y * y + z * z)
        if not (reach > 0.0 and math.isfinite(reach)):
            continue
        row, column = _bin(x, y, z, rows, columns)
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
    nearest = np.full((rows, columns), np.inf, np.float32)
    known = np.zeros((rows, columns), np.bool_)
    for column in range(columns):
        for row in range(rows):
            near, sides = np.inf, 0
            if image[row, column] > 0:
                near, sides = 0.01 * image[row, column], 2
            for direction in (-1, 1):
                for step in range(1, gap + 1):
                    other = row + direction * step
                    if other < 0 or other >= rows:
                        break
                    if image[other, column] > 0:
                        near, sides = min(near, 0.01 * image[other, column]), sides + 1
                        break
            nearest[row, column], known[row, column] = near, sides >= 2
    out = np.zeros((rows, columns), np.float32)
    for row in range(rows):
        for column in range(columns):
            if known[row, column]:
                adjacent = min(nearest[row, column - 1], nearest[row, (column + 1) % columns])
                out[row, column] = min(nearest[row, column], adjacent)
    return out


@njit(cache=True, nogil=True)
def pass_through(
    nearest, first_row, rows, T_lidar_world, reach, margin, share, order, starts, stops, cell_keys, sums, size, passes
):
    """Count in `passes` (C,) uint16 the voxels within `reach` [m] that the beams of a scan passed through.

    `nearest` (R, C) is the result of `nearest_around`, from `first_row` on of an image with `rows` rows. A beam has
    passed a voxel if all returns around its direction are farther by more than `margin` [m] + `share` of the distance.
    `order` lists the voxels by tile; those of tile t, from starts[t] to stops[t], are checked.
    """
    T, columns = T_lidar_world, nearest.shape[1]
    for tile in range(len(starts)):
        for place in range(starts[tile], stops[tile]):
            cell = order[place]
            points = np.float64(sums[cell, 0])
            wx = _corner(cell_keys[cell], 0) * size + sums[cell, _OFFSET] / points
            wy = _corner(cell_keys[cell], 1) * size + sums[cell, _OFFSET + 1] / points
            wz = _corner(cell_keys[cell], 2) * size + sums[cell, _OFFSET + 2] / points
            x = T[0, 0] * wx + T[0, 1] * wy + T[0, 2] * wz + T[0, 3]
            y = T[1, 0] * wx + T[1, 1] * wy + T[1, 2] * wz + T[1, 3]
            z = T[2, 0] * wx + T[2, 1] * wy + T[2, 2] * wz + T[2, 3]
            squared = x * x + y * y + z * z
            if squared > reach * reach:
                continue
            row, column = _bin(x, y, z, rows, columns)
            row -= first_row
            if row < 0 or row >= len(nearest):
                continue
            distance = math.sqrt(squared)
            if nearest[row, column] > distance * (1.0 + share) + margin:
                passes[cell] = min(passes[cell] + 1, 65535)
