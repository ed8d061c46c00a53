"""The loops behind registration: voxel hashing, Gaussians a cell, NDT's normal equations. Nothing but @njit here,
and all in one file: numba's cache does not see a change in another.

Hash tables are open addressing with linear probing over a power of two of slots: `keys` (S,) int64, EMPTY where free,
and `slots` (S,) int32, the row of the cell in its dense arrays.
"""

import math

import numpy as np
from numba import njit

EMPTY = np.int64(-1)
INLIER = 7.815  # 95 % quantile of chi^2 with 3 degrees of freedom
_BITS = 21  # a cell index per axis: +-1,048,576 cells, 1000 km of 1 m cells
_MASK = (1 << _BITS) - 1

# Columns of a cell's running sums: weight, mean (3), scatter about the mean (xx xy xz yy yz zz), points seen.
_MEAN, _SCATTER, _COUNT = 1, 4, 10


@njit(inline="always")
def _key(x, y, z, inverse_size):
    i = np.int64(math.floor(x * inverse_size)) & _MASK
    j = np.int64(math.floor(y * inverse_size)) & _MASK
    k = np.int64(math.floor(z * inverse_size)) & _MASK
    return (i << (2 * _BITS)) | (j << _BITS) | k


@njit(inline="always")
def _find(keys, key):
    """Slot that holds `key`, or the free one where it belongs."""
    mask = len(keys) - 1
    h = key * np.int64(-7046029254386353131)  # 2^64 / golden ratio: the product's high bits are well mixed
    slot = np.int64(h ^ (h >> 32)) & mask
    while keys[slot] != EMPTY and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@njit(inline="always")
def _turned(pose, x, y, z):
    """R [x y z] of a pose."""
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z,
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z,
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z,
    )


@njit(cache=True, nogil=True)
def downsample(xyz, weight, size, min_range, max_range, keys, slots):
    """Weighted centroid of the points of each cell, in the order in which the cells were first met.

    Points nearer to the origin than `min_range` or further than `max_range`, and those not finite, are left out.
    xyz (N, 3) float32, weight (N,) float32 -> centroids (M, 3) float32, mean weights (M,) float32, source (M,) int64:
    the first point of each cell. `keys` and `slots` are scratch, at least twice as long as N, overwritten.
    """
    keys[:] = EMPTY
    inverse_size = 1.0 / size
    sums = np.empty((len(xyz), 5), np.float32)
    source = np.empty(len(xyz), np.int64)
    count = 0
    last_key, cell = EMPTY, 0
    for i in range(len(xyz)):
        x, y, z, w = xyz[i, 0], xyz[i, 1], xyz[i, 2], weight[i]
        squared = x * x + y * y + z * z
        if not min_range * min_range <= squared <= max_range * max_range:
            continue
        key = _key(x, y, z, inverse_size)
        if key != last_key:  # neighbours in a scan mostly share the cell
            last_key = key
            slot = _find(keys, key)
            if keys[slot] == EMPTY:
                keys[slot] = key
                slots[slot] = count
                sums[count] = 0.0
                source[count] = i
                count += 1
            cell = slots[slot]
        # relative to the cell's first point: float32 sums far from the origin would lose digits
        first = source[cell]
        sums[cell, 0] += w
        sums[cell, 1] += w * (x - xyz[first, 0])
        sums[cell, 2] += w * (y - xyz[first, 1])
        sums[cell, 3] += w * (z - xyz[first, 2])
        sums[cell, 4] += 1.0
    centroids = np.empty((count, 3), np.float32)
    weights = np.empty(count, np.float32)
    for cell in range(count):
        first = source[cell]
        for axis in range(3):
            centroids[cell, axis] = xyz[first, axis] + sums[cell, 1 + axis] / sums[cell, 0]
        weights[cell] = sums[cell, 0] / sums[cell, 4]
    return centroids, weights, source[:count].copy()


@njit(inline="always")
def _update_gaussian(cell, sums, gaussians, floor):
    """Mean and information matrix of a cell from its sums; `floor` of the trace keeps flat cells invertible."""
    row = sums[cell]
    scale = 1.0 / row[0] * row[_COUNT] / (row[_COUNT] - 1.0)
    xx, xy, xz = row[_SCATTER] * scale, row[_SCATTER + 1] * scale, row[_SCATTER + 2] * scale
    yy, yz, zz = row[_SCATTER + 3] * scale, row[_SCATTER + 4] * scale, row[_SCATTER + 5] * scale
    ridge = floor * (xx + yy + zz) + 1e-6
    xx, yy, zz = xx + ridge, yy + ridge, zz + ridge
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    inverse = 1.0 / (xx * a + xy * b + xz * c)
    for axis in range(3):
        gaussians[cell, axis] = row[_MEAN + axis]
    gaussians[cell, 3] = a * inverse
    gaussians[cell, 4] = b * inverse
    gaussians[cell, 5] = c * inverse
    gaussians[cell, 6] = (xx * zz - xz * xz) * inverse
    gaussians[cell, 7] = (xy * xz - xx * yz) * inverse
    gaussians[cell, 8] = (xx * yy - xy * xy) * inverse


@njit(cache=True, nogil=True)
def insert(xyz, weight, pose, size, min_points, max_points, floor, keys, slots, sums, gaussians, cell_keys, count):
    """Add points (N, 3), moved by `pose` (4, 4), to the cells' running sums and renew the Gaussians they touch.

    Centred accumulation (West 1979), unbiased covariance. A cell that has seen `max_points` is left as it is.
    gaussians[c, 3] stays 0 while the cell has fewer than `min_points`. Returns the new number of cells.
    """
    inverse_size = 1.0 / size
    touched = np.empty(len(xyz), np.int32)
    touches = 0
    last_key, cell = EMPTY, 0
    for i in range(len(xyz)):
        px, py, pz, w = np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2]), weight[i]
        x, y, z = _turned(pose, px, py, pz)
        x, y, z = x + pose[0, 3], y + pose[1, 3], z + pose[2, 3]
        key = _key(x, y, z, inverse_size)
        if key != last_key:
            last_key = key
            slot = _find(keys, key)
            if keys[slot] == EMPTY:
                keys[slot] = key
                slots[slot] = count
                cell_keys[count] = key
                sums[count] = 0.0
                gaussians[count] = 0.0
                count += 1
            cell = slots[slot]
            if sums[cell, _COUNT] < max_points:
                touched[touches] = cell
                touches += 1
        row = sums[cell]
        if row[_COUNT] >= max_points:
            continue
        row[_COUNT] += 1.0
        row[0] += w
        dx, dy, dz = x - row[_MEAN], y - row[_MEAN + 1], z - row[_MEAN + 2]
        gain = w / row[0]
        row[_MEAN] += gain * dx
        row[_MEAN + 1] += gain * dy
        row[_MEAN + 2] += gain * dz
        ex, ey, ez = w * (x - row[_MEAN]), w * (y - row[_MEAN + 1]), w * (z - row[_MEAN + 2])
        row[_SCATTER] += dx * ex
        row[_SCATTER + 1] += dx * ey
        row[_SCATTER + 2] += dx * ez
        row[_SCATTER + 3] += dy * ey
        row[_SCATTER + 4] += dy * ez
        row[_SCATTER + 5] += dz * ez
    for i in range(touches):
        if sums[touched[i], _COUNT] >= min_points:
            _update_gaussian(touched[i], sums, gaussians, floor)
    return count


@njit(cache=True, nogil=True)
def evict(centre, radius, keys, slots, sums, gaussians, cell_keys, count):
    """Forget the cells whose mean is further than `radius` from `centre` (3,); returns how many remain."""
    keys[:] = EMPTY
    kept = 0
    for cell in range(count):
        squared = 0.0
        for axis in range(3):
            squared += (sums[cell, _MEAN + axis] - centre[axis]) ** 2
        if squared > radius * radius:
            continue
        sums[kept] = sums[cell]
        gaussians[kept] = gaussians[cell]
        cell_keys[kept] = cell_keys[cell]
        slot = _find(keys, cell_keys[kept])
        keys[slot] = cell_keys[kept]
        slots[slot] = kept
        kept += 1
    return kept


@njit(cache=True, nogil=True)
def rehash(cell_keys, count, keys, slots):
    """Fill an empty table, after it has grown, with the cells there are."""
    keys[:] = EMPTY
    for cell in range(count):
        slot = _find(keys, cell_keys[cell])
        keys[slot] = cell_keys[cell]
        slots[slot] = cell


@njit(inline="always")
def _add_point(H, g, u, S, qx, qy, qz, fx, fy, fz):
    """Add u J^T S J to the upper triangle of H and J^T f to g, for J = [-[q]_x, I], the products written out."""
    xx, xy, xz, yy, yz, zz = u * S[3], u * S[4], u * S[5], u * S[6], u * S[7], u * S[8]
    # A = [q]_x S, the block that couples turning with moving
    a00, a01, a02 = qy * xz - qz * xy, qy * yz - qz * yy, qy * zz - qz * yz
    a10, a11, a12 = qz * xx - qx * xz, qz * xy - qx * yz, qz * xz - qx * zz
    a20, a21, a22 = qx * xy - qy * xx, qx * yy - qy * xy, qx * yz - qy * xz
    H[0, 0] += a02 * qy - a01 * qz
    H[0, 1] += a00 * qz - a02 * qx
    H[0, 2] += a01 * qx - a00 * qy
    H[1, 1] += a10 * qz - a12 * qx
    H[1, 2] += a11 * qx - a10 * qy
    H[2, 2] += a21 * qx - a20 * qy
    H[0, 3] += a00
    H[0, 4] += a01
    H[0, 5] += a02
    H[1, 3] += a10
    H[1, 4] += a11
    H[1, 5] += a12
    H[2, 3] += a20
    H[2, 4] += a21
    H[2, 5] += a22
    H[3, 3] += xx
    H[3, 4] += xy
    H[3, 5] += xz
    H[4, 4] += yy
    H[4, 5] += yz
    H[5, 5] += zz
    g[0] += qy * fz - qz * fy
    g[1] += qz * fx - qx * fz
    g[2] += qx * fy - qy * fx
    g[3] += fx
    g[4] += fy
    g[5] += fz


@njit(cache=True, nogil=True)
def normal_equations(xyz, weight, pose, size, neighbours, kernel, keys, slots, gaussians, scores):
    """One linearisation of NDT: sum over points of w rho'(m) J^T S^-1 [J | r], with m = r^T S^-1 r and r = T x - mean.

    The perturbation turns about the sensor and moves it, both in the axes of the map: J = [-[R x]_x, I]. The robust
    weight is Cauchy's, 1 / (1 + m / kernel^2), on the Mahalanobis distance. `neighbours` is 1 (the point's own cell)
    or 7 (its six neighbours by face as well). Where `scores` (N, 6) has any rows, each point's part of the gradient is
    added there.

    Returns H (6, 6), gradient (6,), and six sums: robust weights, robust weights x m, the weight of the points whose
    best m is below the 95 % quantile of chi^2(3), the paper's eq. 5 (weights x exp(-m / 2), best cell), the weight of
    the points that met a Gaussian, all weights.
    """
    H = np.zeros((6, 6))
    g = np.zeros(6)
    totals = np.zeros(6)
    inverse_size, inverse_kernel = 1.0 / size, 1.0 / (kernel * kernel)
    for i in range(len(xyz)):
        px, py, pz, w = np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2]), np.float64(weight[i])
        qx, qy, qz = _turned(pose, px, py, pz)
        x, y, z = qx + pose[0, 3], qy + pose[1, 3], qz + pose[2, 3]
        best = np.inf
        totals[5] += w
        for n in range(neighbours):
            step = size if n % 2 == 1 else -size
            axis = (n + 1) // 2
            key = _key(
                x + (step if axis == 1 else 0.0),
                y + (step if axis == 2 else 0.0),
                z + (step if axis == 3 else 0.0),
                inverse_size,
            )
            slot = _find(keys, key)
            if keys[slot] == EMPTY:
                continue
            S = gaussians[slots[slot]]
            if S[3] == 0.0:
                continue
            rx, ry, rz = x - S[0], y - S[1], z - S[2]
            sx = S[3] * rx + S[4] * ry + S[5] * rz
            sy = S[4] * rx + S[6] * ry + S[7] * rz
            sz = S[5] * rx + S[7] * ry + S[8] * rz
            m = rx * sx + ry * sy + rz * sz
            best = min(best, m)
            u = w / (1.0 + m * inverse_kernel)
            totals[0] += u
            totals[1] += u * m
            fx, fy, fz = u * sx, u * sy, u * sz
            _add_point(H, g, u, S, qx, qy, qz, fx, fy, fz)
            if len(scores):
                scores[i, 0] += qy * fz - qz * fy
                scores[i, 1] += qz * fx - qx * fz
                scores[i, 2] += qx * fy - qy * fx
                scores[i, 3] += fx
                scores[i, 4] += fy
                scores[i, 5] += fz
        if best < np.inf:
            totals[4] += w
            totals[3] += w * math.exp(-0.5 * best)
            if best < INLIER:
                totals[2] += w
    for k in range(6):
        for j in range(k):
            H[k, j] = H[j, k]
    return H, g, totals


@njit(cache=True, nogil=True)
def clustered_scatter(xyz, scores, size, keys, slots):
    """(6, 6): sum over cells of s s^T, s the sum of the scores (N, 6) of the points (N, 3) in the cell.

    `keys` and `slots` are scratch, at least twice as long as N, overwritten.
    """
    keys[:] = EMPTY
    inverse_size = 1.0 / size
    sums = np.zeros((len(xyz), 6))
    count = 0
    for i in range(len(xyz)):
        key = _key(xyz[i, 0], xyz[i, 1], xyz[i, 2], inverse_size)
        slot = _find(keys, key)
        if keys[slot] == EMPTY:
            keys[slot] = key
            slots[slot] = count
            count += 1
        for k in range(6):
            sums[slots[slot], k] += scores[i, k]
    return sums[:count].T @ sums[:count]
