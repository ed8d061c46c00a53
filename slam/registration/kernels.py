"""The loops behind registration: voxel hashing, Gaussians a cell, NDT's normal equations. Nothing but @njit here,
and all in one file: numba's cache does not see a change in another.

Hash tables are open addressing with linear probing over a power of two of slots: `table` (S, 2) int64, the key of a
cell, EMPTY where the slot is free, and its row in the dense arrays.
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
# Columns of a Gaussian: mean (3), information (xx xy xz yy yz zz; 0: it tells nothing), variance of its tilt [rad^2],
# points seen when it was made.
_MADE_OF, GAUSSIAN = 10, 11

# What a cell's eigenvalues, most >= middle >= least, say of the surface in it. Chosen on simulated and KITTI drives
# (docs/odometry.md): plain 16 rings want the elongation strict, dense ones hardly mind.
ELONGATED = 2.5  # most beyond so many times the middle: a line of points, an edge or a ring's trace
CROSSING = 0.5  # squared cosine: a line that turns less across the rings is a ring's trace
FLAT = 0.2  # least beyond this share of the middle: no surface
INDEPENDENT = 10.0  # points of a cell that count as independent where the tilt of its surface is reckoned
TILTED = 9.0  # times the variance of its tilt: what a surface may have along a direction by that, three sigma


@njit(inline="always")
def _key(x, y, z, inverse_size):
    i = np.int64(math.floor(x * inverse_size)) & _MASK
    j = np.int64(math.floor(y * inverse_size)) & _MASK
    k = np.int64(math.floor(z * inverse_size)) & _MASK
    return (i << (2 * _BITS)) | (j << _BITS) | k


@njit(inline="always")
def _find(table, key):
    """Slot that holds `key`, or the free one where it belongs.

    The four cells of a block of 2 x 2 begin at slots that share a cache line: points next to each other fall into cells
    next to each other, and of a map, most is not in the cache.
    """
    mask = len(table) - 1
    x, y = (key >> (2 * _BITS)) & 1, (key >> _BITS) & 1
    block = key & ~((np.int64(1) << (2 * _BITS)) | (np.int64(1) << _BITS))
    h = block * np.int64(-7046029254386353131)  # 2^64 / golden ratio: the product's high bits are well mixed
    slot = ((np.int64(h ^ (h >> 32)) & ~np.int64(3)) | (x << 1) | y) & mask
    while table[slot, 0] != EMPTY and table[slot, 0] != key:
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
def downsample(xyz, weight, size, min_range, max_range, table):
    """Weighted centroid of the points of each cell, in the order in which the cells were first met.

    Points nearer to the origin than `min_range` or further than `max_range`, and those not finite, are left out.
    xyz (N, 3) float32, weight (N,) float32 -> centroids (M, 3) float32, mean weights (M,) float32, source (M,) int64:
    the first point of each cell. `table` is scratch, overwritten. The fourth value is False where it was too small, and
    the others then are of no use.
    """
    table[:, 0] = EMPTY
    inverse_size = 1.0 / size
    sums = np.empty((min(len(xyz), len(table) // 2), 8), np.float32)  # weight, xyz from the first point, points, that
    source = np.empty(len(sums), np.int64)
    count, fits = 0, True
    last_key, cell = EMPTY, 0
    for i in range(len(xyz)):
        x, y, z, w = xyz[i, 0], xyz[i, 1], xyz[i, 2], weight[i]
        squared = x * x + y * y + z * z
        if not min_range * min_range <= squared <= max_range * max_range:
            continue
        key = _key(x, y, z, inverse_size)
        if key != last_key:  # neighbours in a scan mostly share the cell
            last_key = key
            slot = _find(table, key)
            if table[slot, 0] == EMPTY:
                if count == len(sums):
                    fits = False
                    break
                table[slot, 0] = key
                table[slot, 1] = count
                sums[count, :5] = 0.0
                sums[count, 5], sums[count, 6], sums[count, 7] = x, y, z
                source[count] = i
                count += 1
            cell = table[slot, 1]
        # relative to the cell's first point: float32 sums far from the origin would lose digits
        row = sums[cell]
        row[0] += w
        row[1] += w * (x - row[5])
        row[2] += w * (y - row[6])
        row[3] += w * (z - row[7])
        row[4] += 1.0
    centroids = np.empty((count, 3), np.float32)
    weights = np.empty(count, np.float32)
    for cell in range(count):
        row = sums[cell]
        for axis in range(3):
            centroids[cell, axis] = row[5 + axis] + row[1 + axis] / row[0]
        weights[cell] = row[0] / row[4]
    return centroids, weights, source[:count].copy(), fits


@njit(inline="always")
def eigenvalues(A):
    """Of a symmetric A (3, 3), least to most: the roots of its cubic by their angle (Smith 1961)."""
    mean = (A[0, 0] + A[1, 1] + A[2, 2]) / 3.0
    xx, yy, zz = A[0, 0] - mean, A[1, 1] - mean, A[2, 2] - mean
    xy, xz, yz = A[0, 1], A[0, 2], A[1, 2]
    squared = (xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0
    if squared <= 0.0:
        return mean, mean, mean
    spread = math.sqrt(squared)
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    angle = math.acos(min(1.0, max(-1.0, 0.5 * determinant / (squared * spread)))) / 3.0
    most = mean + 2.0 * spread * math.cos(angle)
    least = mean + 2.0 * spread * math.cos(angle + 2.0 * math.pi / 3.0)
    return least, 3.0 * mean - least - most, most


@njit(inline="always")
def eigenvector(A, value):
    """The unit eigenvector of a symmetric A (3, 3) to an eigenvalue that stands apart from the others: across two rows
    of A - value I, those that differ most in direction."""
    xx, yy, zz = A[0, 0] - value, A[1, 1] - value, A[2, 2] - value
    xy, xz, yz = A[0, 1], A[0, 2], A[1, 2]
    ax, ay, az = xy * yz - xz * yy, xz * xy - xx * yz, xx * yy - xy * xy
    bx, by, bz = xy * zz - xz * yz, xz * xz - xx * zz, xx * yz - xy * xz
    cx, cy, cz = yy * zz - yz * yz, yz * xz - xy * zz, xy * yz - yy * xz
    a, b, c = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz, cx * cx + cy * cy + cz * cz
    if b > a and b >= c:
        a, ax, ay, az = b, bx, by, bz
    elif c > a:
        a, ax, ay, az = c, cx, cy, cz
    if a <= 0.0:
        return 0.0, 0.0, 1.0
    inverse = 1.0 / math.sqrt(a)
    return ax * inverse, ay * inverse, az * inverse


@njit(inline="always")
def _across_rings(x, y, z, mean, pose):
    """Squared cosine between a unit vector and the direction in which a sensor at `pose` steps from ring to ring."""
    rx, ry, rz = mean[0] - pose[0, 3], mean[1] - pose[1, 3], mean[2] - pose[2, 3]
    squared = rx * rx + ry * ry + rz * rz + 1e-12
    along = (pose[0, 2] * rx + pose[1, 2] * ry + pose[2, 2] * rz) / squared
    ex, ey, ez = pose[0, 2] - along * rx, pose[1, 2] - along * ry, pose[2, 2] - along * rz
    return (x * ex + y * ey + z * ez) ** 2 / (ex * ex + ey * ey + ez * ez + 1e-12)


@njit(inline="always")
def _hold_by_covariance(cell, A, ridge, gaussians):
    """The whole inverse covariance, as the paper's eq. 4 has it."""
    xx, yy, zz = A[0, 0] + ridge, A[1, 1] + ridge, A[2, 2] + ridge
    xy, xz, yz = A[0, 1], A[0, 2], A[1, 2]
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    inverse = 1.0 / (xx * a + xy * b + xz * c)
    gaussians[cell, 3] = a * inverse
    gaussians[cell, 4] = b * inverse
    gaussians[cell, 5] = c * inverse
    gaussians[cell, 6] = (xx * zz - xz * xz) * inverse
    gaussians[cell, 7] = (xy * xz - xx * yz) * inverse
    gaussians[cell, 8] = (xx * yy - xy * xy) * inverse


@njit(inline="always")
def _hold_by_surface(cell, A, ridge, size, row, pose, gaussians):
    """Information along the directions in which a surface is thin: a plane's normal, both sides of an edge.

    How far points spread along a surface says where the cell ends and how the rings fell into it, not where anything
    is. A line of points is an edge only where it crosses rings; along them it is a ring's own trace.
    """
    least, middle, most = eigenvalues(A)
    least, middle = max(least, 0.0), max(middle, 0.0)
    gaussians[cell, 9] = (least + ridge) / ((middle + ridge) * min(row[_COUNT], INDEPENDENT))
    if least > FLAT * middle + 1e-9 * most:  # of a line without any width, both are nothing but rounding
        return
    if ELONGATED * middle >= most:
        x, y, z = eigenvector(A, least)
        _hold_along(cell, x, y, z, least, ridge, size, gaussians)
        return
    wx, wy, wz = eigenvector(A, most)
    if _across_rings(wx, wy, wz, row[_MEAN : _MEAN + 3], pose) < CROSSING:
        return
    x, y, z = eigenvector(A, least)
    x, y, z = _across(x, y, z, wx, wy, wz)
    _hold_along(cell, x, y, z, least, ridge, size, gaussians)
    _hold_along(cell, y * wz - z * wy, z * wx - x * wz, x * wy - y * wx, middle, ridge, size, gaussians)


@njit(inline="always")
def _across(x, y, z, wx, wy, wz):
    """The part of a vector that is perpendicular to the unit vector w, as a unit vector; any such vector where that
    part is nothing, as of a line without any width."""
    along = x * wx + y * wy + z * wz
    x, y, z = x - along * wx, y - along * wy, z - along * wz
    squared = x * x + y * y + z * z
    if squared < 1e-6:
        if wx * wx < 0.5:
            x, y, z = 1.0 - wx * wx, -wx * wy, -wx * wz
        else:
            x, y, z = -wy * wx, 1.0 - wy * wy, -wy * wz
        squared = x * x + y * y + z * z
    inverse = 1.0 / math.sqrt(squared)
    return x * inverse, y * inverse, z * inverse


@njit(inline="always")
def _hold_along(cell, x, y, z, variance, ridge, size, gaussians):
    """Add information along a unit vector; none where the points spread as far as the cell does."""
    gain = max(0.0, 1.0 - 12.0 * variance / (size * size)) / (variance + ridge)
    gaussians[cell, 3] += gain * x * x
    gaussians[cell, 4] += gain * x * y
    gaussians[cell, 5] += gain * x * z
    gaussians[cell, 6] += gain * y * y
    gaussians[cell, 7] += gain * y * z
    gaussians[cell, 8] += gain * z * z


@njit(inline="always")
def _update_gaussian(cell, sums, gaussians, floor, size, surfaces, pose, A):
    """Mean and information matrix of a cell from its sums; `floor` of the trace keeps flat cells invertible."""
    row = sums[cell]
    scale = 1.0 / row[0] * row[_COUNT] / (row[_COUNT] - 1.0)
    entry = _SCATTER
    for i in range(3):
        for j in range(i, 3):
            A[i, j] = A[j, i] = row[entry] * scale
            entry += 1
    ridge = floor * (A[0, 0] + A[1, 1] + A[2, 2]) + 1e-6
    for axis in range(3):
        gaussians[cell, axis] = row[_MEAN + axis]
    gaussians[cell, 3:] = 0.0
    gaussians[cell, _MADE_OF] = row[_COUNT]
    if surfaces:
        _hold_by_surface(cell, A, ridge, size, row, pose, gaussians)
    else:
        _hold_by_covariance(cell, A, ridge, gaussians)


@njit(inline="always")
def _tells(S):
    """Whether a cell's Gaussian holds a point along any direction."""
    return S[3] + S[6] + S[8] > 0.0


@njit(inline="always")
def _add_cell(key, slot, cell, table, sums, gaussians, cell_keys):
    """An empty cell at a free slot."""
    table[slot, 0] = key
    table[slot, 1] = cell
    cell_keys[cell] = key
    sums[cell] = 0.0
    gaussians[cell] = 0.0


@njit(cache=True, nogil=True)
def insert(xyz, weight, pose, size, min_points, max_points, floor, surfaces, table, sums, gaussians, cell_keys, count):
    """Add points (N, 3), moved by `pose` (4, 4), to the cells' running sums and renew the Gaussians they touch.

    Centred accumulation (West 1979), unbiased covariance. A cell that has seen `max_points` is left as it is. A
    Gaussian's information stays 0 while the cell has fewer than `min_points`, and where it shows no surface
    (`surfaces`). Returns the new number of cells.
    """
    A = np.empty((3, 3))
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
            slot = _find(table, key)
            if table[slot, 0] == EMPTY:
                _add_cell(key, slot, count, table, sums, gaussians, cell_keys)
                count += 1
            cell = table[slot, 1]
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
        seen = sums[touched[i], _COUNT]
        if seen >= min_points and seen > gaussians[touched[i], _MADE_OF]:
            _update_gaussian(touched[i], sums, gaussians, floor, size, surfaces, pose, A)
    return count


@njit(cache=True, nogil=True)
def evict(centre, radius, table, sums, gaussians, cell_keys, count):
    """Forget the cells whose mean is further than `radius` from `centre` (3,); returns how many remain."""
    table[:, 0] = EMPTY
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
        slot = _find(table, cell_keys[kept])
        table[slot, 0] = cell_keys[kept]
        table[slot, 1] = kept
        kept += 1
    return kept


@njit(cache=True, nogil=True)
def rehash(cell_keys, count, table):
    """Fill an empty table, after it has grown, with the cells there are."""
    table[:, 0] = EMPTY
    for cell in range(count):
        slot = _find(table, cell_keys[cell])
        table[slot, 0] = cell_keys[cell]
        table[slot, 1] = cell


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
def normal_equations(xyz, weight, pose, size, neighbours, kernel, table, gaussians, scores):
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
            slot = _find(table, key)
            if table[slot, 0] == EMPTY:
                continue
            S = gaussians[table[slot, 1]]
            if not _tells(S):
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
def support(xyz, weight, pose, size, kernel, axes, table, gaussians):
    """Which directions the surfaces face that hold the points: (3, 3) mean of n n^T, trace 1, in the axes of the map.

    Weighted as in `normal_equations`. Also (3,): what each of the orthonormal `axes` (3, 3), its rows, has of this
    without the surfaces that seem to face it only as far as their normals may be tilted.
    """
    facing, clear = np.zeros((3, 3)), np.zeros(3)
    total = 1e-12
    inverse_size, inverse_kernel = 1.0 / size, 1.0 / (kernel * kernel)
    for i in range(len(xyz)):
        x, y, z = _turned(pose, np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2]))
        x, y, z = x + pose[0, 3], y + pose[1, 3], z + pose[2, 3]
        slot = _find(table, _key(x, y, z, inverse_size))
        if table[slot, 0] == EMPTY or not _tells(gaussians[table[slot, 1]]):
            continue
        S = gaussians[table[slot, 1]]
        u = weight[i] / (1.0 + _mahalanobis(S, x, y, z) * inverse_kernel)
        total += u
        u /= S[3] + S[6] + S[8]
        facing[0, 0] += u * S[3]
        facing[0, 1] += u * S[4]
        facing[0, 2] += u * S[5]
        facing[1, 1] += u * S[6]
        facing[1, 2] += u * S[7]
        facing[2, 2] += u * S[8]
        for k in range(3):
            share = _along(S, axes[k, 0], axes[k, 1], axes[k, 2])
            if share > TILTED * S[9] * (S[3] + S[6] + S[8]):
                clear[k] += u * share
    for i in range(3):
        for j in range(i):
            facing[i, j] = facing[j, i]
    return facing / total, clear / total


@njit(inline="always")
def _along(S, x, y, z):
    """v^T S v: the information that a Gaussian has along a direction."""
    return x * (S[3] * x + 2.0 * (S[4] * y + S[5] * z)) + y * (S[6] * y + 2.0 * S[7] * z) + z * S[8] * z


@njit(inline="always")
def _mahalanobis(S, x, y, z):
    """Squared distance of a point from a Gaussian."""
    return _along(S, x - S[0], y - S[1], z - S[2])


@njit(cache=True, nogil=True)
def evidence(xyz, weight, pose, relevance, size, block, most, table, gaussians, blocks):
    """How much of the scene supports a pose: sum over cubic blocks of the fit in each, by what its points can tell,
    times the mean fit, for where a scan meets its own rings there is more that can fit.

    A point counts by its surface's normal n, n^T R n with `relevance` R (3, 3), and fits by exp(-m / 2) (the paper's
    eq. 5). A block of side `block` counts at most `most`, so that one lorry that drives along is not worth more than a
    lamp post. `blocks` is scratch, at least twice as long as N, overwritten.
    """
    blocks[:, 0] = EMPTY
    inverse_size, inverse_block = 1.0 / size, 1.0 / block
    mass = np.zeros((len(xyz), 2))
    count = 0
    for i in range(len(xyz)):
        x, y, z = _turned(pose, np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2]))
        x, y, z = x + pose[0, 3], y + pose[1, 3], z + pose[2, 3]
        slot = _find(table, _key(x, y, z, inverse_size))
        if table[slot, 0] == EMPTY or not _tells(gaussians[table[slot, 1]]):
            continue
        S = gaussians[table[slot, 1]]
        told = (
            relevance[0, 0] * S[3]
            + relevance[1, 1] * S[6]
            + relevance[2, 2] * S[8]
            + 2.0 * (relevance[0, 1] * S[4] + relevance[0, 2] * S[5] + relevance[1, 2] * S[7])
        )
        told *= weight[i] / (S[3] + S[6] + S[8])
        slot = _find(blocks, _key(x, y, z, inverse_block))
        if blocks[slot, 0] == EMPTY:
            blocks[slot, 0] = _key(x, y, z, inverse_block)
            blocks[slot, 1] = count
            count += 1
        mass[blocks[slot, 1], 0] += told
        mass[blocks[slot, 1], 1] += told * math.exp(-0.5 * _mahalanobis(S, x, y, z))
    total, possible = 0.0, 1e-12
    for k in range(count):
        if mass[k, 0] > 0.0:
            counted = min(1.0, most / mass[k, 0])
            total += mass[k, 1] * counted
            possible += mass[k, 0] * counted
    return total * total / possible


@njit(cache=True, nogil=True)
def merge(fine_sums, fine_count, size, min_points, floor, pose, table, sums, gaussians, cell_keys):
    """Fill empty cells of a larger `size` with the moments of finer ones, and their Gaussians of surfaces as seen from
    `pose` (4, 4). Returns their number."""
    A = np.empty((3, 3))
    inverse_size = 1.0 / size
    count = 0
    for i in range(fine_count):
        fine = fine_sums[i]
        key = _key(fine[_MEAN], fine[_MEAN + 1], fine[_MEAN + 2], inverse_size)
        slot = _find(table, key)
        if table[slot, 0] == EMPTY:
            _add_cell(key, slot, count, table, sums, gaussians, cell_keys)
            count += 1
        row = sums[table[slot, 1]]
        total = row[0] + fine[0]
        dx, dy, dz = fine[_MEAN] - row[_MEAN], fine[_MEAN + 1] - row[_MEAN + 1], fine[_MEAN + 2] - row[_MEAN + 2]
        between = row[0] * fine[0] / total
        row[_SCATTER] += fine[_SCATTER] + between * dx * dx
        row[_SCATTER + 1] += fine[_SCATTER + 1] + between * dx * dy
        row[_SCATTER + 2] += fine[_SCATTER + 2] + between * dx * dz
        row[_SCATTER + 3] += fine[_SCATTER + 3] + between * dy * dy
        row[_SCATTER + 4] += fine[_SCATTER + 4] + between * dy * dz
        row[_SCATTER + 5] += fine[_SCATTER + 5] + between * dz * dz
        gain = fine[0] / total
        row[_MEAN] += gain * dx
        row[_MEAN + 1] += gain * dy
        row[_MEAN + 2] += gain * dz
        row[0] = total
        row[_COUNT] += fine[_COUNT]
    for cell in range(count):
        if sums[cell, _COUNT] >= min_points:
            _update_gaussian(cell, sums, gaussians, floor, size, True, pose, A)
    return count


@njit(cache=True, nogil=True)
def clustered_scatter(xyz, scores, size, table):
    """(6, 6): sum over cells of s s^T, s the sum of the scores (N, 6) of the points (N, 3) in the cell.

    `table` is scratch, at least twice as long as N, overwritten.
    """
    table[:, 0] = EMPTY
    inverse_size = 1.0 / size
    sums = np.zeros((len(xyz), 6))
    count = 0
    for i in range(len(xyz)):
        key = _key(xyz[i, 0], xyz[i, 1], xyz[i, 2], inverse_size)
        slot = _find(table, key)
        if table[slot, 0] == EMPTY:
            table[slot, 0] = key
            table[slot, 1] = count
            count += 1
        for k in range(6):
            sums[table[slot, 1], k] += scores[i, k]
    return sums[:count].T @ sums[:count]
