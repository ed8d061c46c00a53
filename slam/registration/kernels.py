"""Kernels of registration: voxel hashing, the Gaussian of each cell, NDT's normal equations.

Only @njit functions, and all of them in one file: numba's cache does not see changes in another file.

Hash tables use open addressing with linear probing over a power of two of slots: `table` (S,) int32 has the row of a
cell in the dense arrays, EMPTY if the slot is free; one of these arrays has the keys.
"""

import math

import numpy as np
from numba import njit

EMPTY = np.int32(-1)
INLIER_THRESHOLD = 7.815  # 95 % quantile of chi^2 with 3 degrees of freedom
NEGLIGIBLE = 50.0  # squared Mahalanobis distance from which a point adds nothing to eq. 5: exp(-25) is 1e-11
NO_KEY = np.int64(-1)  # of no cell
PASSES = 8  # of `reaches_overlap` over a scan
_BITS = 21  # of a cell index along one axis: +-1,048,576 cells, 1000 km of 1 m cells
_MASK = (1 << _BITS) - 1
_ABOVE = 1 << (_BITS - 1)  # bit of a key, of points above the sensor; indices along z have one bit less

# Columns of a cell's running sums: weight, weighted sums of the offsets d from the centre of the cell (3) and of d d^T
# (xx xy xz yy yz zz), number of points.
_FIRST, _SECOND, _COUNT, SUMS = 1, 4, 10, 11
# Columns of a Gaussian: mean (3), information (xx xy xz yy yz zz; 0: none), variance of the normal's tilt [rad^2],
# number of points of which it was computed.
_POINTS_USED, GAUSSIAN = 10, 11

# Classification of a cell's surface by its eigenvalues, largest >= middle >= smallest. Chosen on simulated and KITTI
# sequences (docs/odometry.md): 16 rings need a strict elongation, dense scans are hardly sensitive.
MIN_ELONGATION = 2.5  # ratio of largest to middle from which the points form a line: an edge or the trace of a ring
MIN_CROSSING = 0.5  # squared cosine to the direction across the rings, below which a line is the trace of a ring
MAX_FLATNESS = 0.2  # ratio of smallest to middle above which there is no surface
MAX_INDEPENDENT_POINTS = 10.0  # of a cell, for the variance of its normal's tilt
TILT_GATE = 9.0  # factor on the variance of the tilt, three sigma: below it a surface may face a direction by noise


@njit(forceinline=True)
def _key(x, y, z, inverse_size):
    i = np.int64(math.floor(x * inverse_size)) & _MASK
    j = np.int64(math.floor(y * inverse_size)) & _MASK
    k = np.int64(math.floor(z * inverse_size)) & (_MASK >> 1)
    return (i << (2 * _BITS)) | (j << _BITS) | k


@njit(forceinline=True)
def _sided(key, z, top):
    """The key for a point at a height `z`: those above `top`, the lowest a ceiling may be, have cells of their own.

    Otherwise a floor would be matched to the ceiling beneath it, which is 0.2 m away and in the same cell.
    """
    return key | _ABOVE if z > top else key


@njit(forceinline=True)
def _index(bits, count):
    """The signed cell index along an axis, given by the lowest `count` of the bits."""
    sign = np.int64(1) << (count - 1)
    return ((bits & (2 * sign - 1)) ^ sign) - sign


@njit(forceinline=True)
def _centre(key, size):
    """Centre of the cell with `key`."""
    i, j, k = _index(key >> (2 * _BITS), _BITS), _index(key >> _BITS, _BITS), _index(key, _BITS - 1)
    return (i + 0.5) * size, (j + 0.5) * size, (k + 0.5) * size


@njit(forceinline=True)
def _find(table, keys, key):
    """Slot of `key`, or the free slot for it.

    The four cells of a 2 x 2 block are hashed to slots in one cache line: adjacent points fall into adjacent cells, and
    most of a map is not in the cache.
    """
    mask = len(table) - 1
    x, y = (key >> (2 * _BITS)) & 1, (key >> _BITS) & 1
    block = key & ~((np.int64(1) << (2 * _BITS)) | (np.int64(1) << _BITS))
    h = block * np.int64(-7046029254386353131)  # 2^64 / golden ratio: the product's high bits are well mixed
    slot = ((np.int64(h ^ (h >> 32)) & ~np.int64(3)) | (x << 1) | y) & mask
    while table[slot] != EMPTY and keys[table[slot]] != key:
        slot = (slot + 1) & mask
    return slot


@njit(forceinline=True)
def _lookup(table, keys, key):
    """Row of the cell with `key`; -1 if there is none."""
    return np.int64(table[_find(table, keys, key)])


@njit(forceinline=True)
def _met(table, keys, gaussians, key, z, top):
    """Row of the Gaussian that a point at a height `z` meets in the cell with `key`; -1 if there is none.

    Points on the other side of `top`, the lowest a ceiling may be, show the same walls, but other floors and ceilings.
    """
    sided = _sided(key, z, top)
    cell = _lookup(table, keys, sided)
    if cell >= 0 and _has_information(gaussians[cell]):
        return cell
    if top == math.inf:
        return np.int64(-1)
    cell = _lookup(table, keys, sided ^ _ABOVE)
    if cell >= 0 and _has_information(gaussians[cell]) and not _is_level(gaussians[cell]):
        return cell
    return np.int64(-1)


@njit(forceinline=True)
def _is_level(S):
    """Whether a Gaussian constrains mostly the height."""
    return S[8] > 0.5 * (S[3] + S[6] + S[8])


@njit(forceinline=True)
def _rotated(pose, x, y, z):
    """The vector [x y z] rotated by a pose."""
    return (
        pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z,
        pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z,
        pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z,
    )


@njit(cache=True, nogil=True)
def downsample(xyz, weight, time, size, min_range, max_range, table):
    """Compute the weighted mean of the points of each cell, in the order of their first points.

    Args:
        xyz: Points (N, 3) float32; points that are not finite are left out.
        weight: Their weights (N,) float32.
        time: Their times (N,) float32 [s], or empty.
        size: Size of the cells [m].
        min_range: Points nearer to the origin are left out [m].
        max_range: Points further from the origin are left out [m].
        table: Hash table, overwritten.

    Returns:
        Centroids (M, 3) float32, mean weights (M,) float32, mean times (M,) float32 (0 without times), and whether
        `table` was large enough; if not, the other values are invalid.
    """
    table[:] = EMPTY
    inverse_size = 1.0 / size
    most = min(len(xyz), len(table) // 2)
    keys = np.empty(most, np.int64)
    sums = np.empty((most, 6))  # columns: weight, weighted sums of x, y, z and time, number of points
    count, fits, cell = 0, True, 0
    last_key = NO_KEY
    w, wx, wy, wz, wt, seen = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0  # of successive points in one cell: most of a scan's are
    for i in range(len(xyz)):
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        squared = x * x + y * y + z * z
        if not min_range * min_range <= squared <= max_range * max_range:
            continue
        key = _key(x, y, z, inverse_size)
        if key != last_key:
            if last_key != NO_KEY:
                _add_sums(sums[cell], w, wx, wy, wz, wt, seen)
            last_key = key
            w, wx, wy, wz, wt, seen = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            slot = _find(table, keys, key)
            if table[slot] == EMPTY:
                if count == most:
                    fits = False
                    break
                table[slot] = count
                keys[count] = key
                sums[count] = 0.0
                count += 1
            cell = table[slot]
        u = np.float64(weight[i])
        w += u
        wx += u * x
        wy += u * y
        wz += u * z
        if len(time):
            wt += u * time[i]
        seen += 1.0
    if count and fits:
        _add_sums(sums[cell], w, wx, wy, wz, wt, seen)
    centroids = np.empty((count, 3), np.float32)
    weights, times = np.empty(count, np.float32), np.empty(count, np.float32)
    for cell in range(count):
        row = sums[cell]
        inverse = 1.0 / row[0]
        for axis in range(3):
            centroids[cell, axis] = row[1 + axis] * inverse
        weights[cell] = row[0] / row[5]
        times[cell] = row[4] * inverse
    return centroids, weights, times, fits


@njit(forceinline=True)
def _add_sums(row, w, wx, wy, wz, wt, seen):
    """Add the sums over some points to a row of `downsample`."""
    row[0] += w
    row[1] += wx
    row[2] += wy
    row[3] += wz
    row[4] += wt
    row[5] += seen


@njit
def eigenvalues(A):
    """Return the eigenvalues of a symmetric A (3, 3), ascending, by the trigonometric solution (Smith 1961)."""
    mean = (A[0, 0] + A[1, 1] + A[2, 2]) / 3.0
    xx, yy, zz = A[0, 0] - mean, A[1, 1] - mean, A[2, 2] - mean
    xy, xz, yz = A[0, 1], A[0, 2], A[1, 2]
    squared = (xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0
    spread = math.sqrt(squared)
    cubed = squared * spread
    if cubed <= 0.0:  # also by underflow: equal eigenvalues
        return mean, mean, mean
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    angle = math.acos(min(1.0, max(-1.0, 0.5 * determinant / cubed))) / 3.0
    largest = mean + 2.0 * spread * math.cos(angle)
    smallest = mean + 2.0 * spread * math.cos(angle + 2.0 * math.pi / 3.0)
    return smallest, 3.0 * mean - smallest - largest, largest


@njit
def eigenvector(A, value):
    """Return the unit eigenvector of a symmetric A (3, 3) for a simple eigenvalue.

    It is the largest cross product of two rows of A - value I.
    """
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


@njit
def _across_rings(x, y, z, mean, pose):
    """Squared cosine between a unit vector and the direction from ring to ring at a cell, for a sensor at `pose`."""
    rx, ry, rz = mean[0] - pose[0, 3], mean[1] - pose[1, 3], mean[2] - pose[2, 3]
    squared = rx * rx + ry * ry + rz * rz + 1e-12
    along = (pose[0, 2] * rx + pose[1, 2] * ry + pose[2, 2] * rz) / squared
    ex, ey, ez = pose[0, 2] - along * rx, pose[1, 2] - along * ry, pose[2, 2] - along * rz
    return (x * ex + y * ey + z * ez) ** 2 / (ex * ex + ey * ey + ez * ez + 1e-12)


@njit
def _information_from_covariance(cell, A, ridge, gaussians):
    """Set the information to the full inverse covariance, as in the paper's eq. 4."""
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


@njit(forceinline=True)
def _information_from_surface(cell, A, ridge, size, count, pose, gaussians):
    """Set the information along the directions in which a surface is thin: a plane's normal, both sides of an edge.

    The spread of points along a surface depends on the borders of the cell and on the rings in it, not on the position
    of an object. A line of points is an edge only if it crosses rings; otherwise it is the trace of one ring.
    """
    smallest, middle, largest = eigenvalues(A)
    smallest, middle = max(smallest, 0.0), max(middle, 0.0)
    gaussians[cell, 9] = (smallest + ridge) / ((middle + ridge) * min(count, MAX_INDEPENDENT_POINTS))
    if smallest > MAX_FLATNESS * middle + 1e-9 * largest:  # for a line without width, both are rounding errors
        return
    if MIN_ELONGATION * middle >= largest:
        x, y, z = eigenvector(A, smallest)
        _add_information(cell, x, y, z, smallest, ridge, size, gaussians)
        return
    wx, wy, wz = eigenvector(A, largest)
    if _across_rings(wx, wy, wz, gaussians[cell], pose) < MIN_CROSSING:
        return
    x, y, z = eigenvector(A, smallest)
    x, y, z = _perpendicular(x, y, z, wx, wy, wz)
    _add_information(cell, x, y, z, smallest, ridge, size, gaussians)
    _add_information(cell, y * wz - z * wy, z * wx - x * wz, x * wy - y * wx, middle, ridge, size, gaussians)


@njit
def _perpendicular(x, y, z, wx, wy, wz):
    """The component of a vector perpendicular to the unit vector w, normalised.

    Where it is zero, as for a line without width, any perpendicular unit vector is returned.
    """
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


@njit(forceinline=True)
def _add_information(cell, x, y, z, variance, ridge, size, gaussians):
    """Add information along a unit vector; none if the points spread over the whole cell."""
    gain = max(0.0, 1.0 - 12.0 * variance / (size * size)) / (variance + ridge)
    gaussians[cell, 3] += gain * x * x
    gaussians[cell, 4] += gain * x * y
    gaussians[cell, 5] += gain * x * z
    gaussians[cell, 6] += gain * y * y
    gaussians[cell, 7] += gain * y * z
    gaussians[cell, 8] += gain * z * z


@njit(forceinline=True)
def _update_gaussian(cell, key, sums, gaussians, regularisation, size, surfaces, pose, A):
    """Compute a cell's mean and information from its sums; `floor` of the trace keeps flat cells invertible."""
    row = sums[cell]
    inverse = 1.0 / row[0]
    mx, my, mz = row[_FIRST] * inverse, row[_FIRST + 1] * inverse, row[_FIRST + 2] * inverse
    unbiased = row[_COUNT] / (row[_COUNT] - 1.0)
    scale = inverse * unbiased
    A[0, 0] = row[_SECOND] * scale - mx * mx * unbiased
    A[0, 1] = A[1, 0] = row[_SECOND + 1] * scale - mx * my * unbiased
    A[0, 2] = A[2, 0] = row[_SECOND + 2] * scale - mx * mz * unbiased
    A[1, 1] = row[_SECOND + 3] * scale - my * my * unbiased
    A[1, 2] = A[2, 1] = row[_SECOND + 4] * scale - my * mz * unbiased
    A[2, 2] = row[_SECOND + 5] * scale - mz * mz * unbiased
    ridge = regularisation * (A[0, 0] + A[1, 1] + A[2, 2]) + 1e-6
    cx, cy, cz = _centre(key, size)
    gaussians[cell, 0], gaussians[cell, 1], gaussians[cell, 2] = cx + mx, cy + my, cz + mz
    gaussians[cell, 3:] = 0.0
    gaussians[cell, _POINTS_USED] = row[_COUNT]
    if surfaces:
        _information_from_surface(cell, A, ridge, size, row[_COUNT], pose, gaussians)
    else:
        _information_from_covariance(cell, A, ridge, gaussians)


@njit(forceinline=True)
def _has_information(S):
    """Whether a cell's Gaussian constrains a point along any direction."""
    return S[3] + S[6] + S[8] > 0.0


@njit(forceinline=True)
def _add_cell(key, slot, cell, table, sums, gaussians, cell_keys):
    """Add an empty cell at a free slot."""
    table[slot] = cell
    cell_keys[cell] = key
    sums[cell] = 0.0
    gaussians[cell] = 0.0


@njit(cache=True, nogil=True)
def insert(
    xyz,
    weight,
    pose,
    size,
    ceiling,
    min_points,
    max_points,
    regularisation,
    surfaces,
    table,
    sums,
    gaussians,
    cell_keys,
    count,
):
    """Add points to the cells' running sums, and update the Gaussians of these cells.

    Unbiased covariance, from sums about the centre of the cell, where hardly a digit cancels. A cell with `max_points`
    is not updated any more. The information of a Gaussian is 0 while the cell has fewer than `min_points`, and, with
    `surfaces`, if it has no surface.

    Args:
        xyz: Points (N, 3).
        weight: Their weights (N,).
        pose: Pose (4, 4) by which the points are transformed.
        size: Size of the cells [m].
        ceiling: As in `VoxelGaussians`.
        min_points: As in `VoxelGaussians`.
        max_points: As in `VoxelGaussians`.
        regularisation: As in `VoxelGaussians`.
        surfaces: As in `VoxelGaussians`.
        table: Hash table.
        sums: Running sums (C, SUMS), a row per cell.
        gaussians: Gaussians (C, GAUSSIAN), a row per cell.
        cell_keys: Keys (C,) of the cells.
        count: Number of cells in use.

    Returns:
        The new number of cells.
    """
    A = np.empty((3, 3))
    inverse_size = 1.0 / size
    top = pose[2, 3] + ceiling
    cells = np.empty(len(xyz), np.int64)
    last_key, cell = NO_KEY, np.int64(0)
    for i in range(len(xyz)):  # a loop of its own, as in `_cells_of`
        x, y, z = _rotated(pose, np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2]))
        x, y, z = x + pose[0, 3], y + pose[1, 3], z + pose[2, 3]
        key = _sided(_key(x, y, z, inverse_size), z, top)
        if key != last_key:
            last_key = key
            slot = _find(table, cell_keys, key)
            if table[slot] == EMPTY:
                _add_cell(key, slot, count, table, sums, gaussians, cell_keys)
                count += 1
            cell = np.int64(table[slot])
        cells[i] = cell
    touched = np.empty(len(xyz), np.int64)
    touches = 0
    last_cell = -1
    cx, cy, cz = 0.0, 0.0, 0.0
    for i in range(len(xyz)):
        cell = cells[i]
        if cell != last_cell:
            last_cell = cell
            cx, cy, cz = _centre(cell_keys[cell], size)
            if sums[cell, _COUNT] < max_points:
                touched[touches] = cell
                touches += 1
        row = sums[cell]
        if row[_COUNT] >= max_points:
            continue
        x, y, z = _rotated(pose, np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2]))
        dx, dy, dz, w = x + pose[0, 3] - cx, y + pose[1, 3] - cy, z + pose[2, 3] - cz, np.float64(weight[i])
        row[0] += w
        _add_moments(row, w * dx, w * dy, w * dz, dx, dy, dz)
        row[_COUNT] += 1.0
    for i in range(touches):
        seen = sums[touched[i], _COUNT]
        if seen >= min_points and seen > gaussians[touched[i], _POINTS_USED]:
            key = cell_keys[touched[i]]
            _update_gaussian(touched[i], key, sums, gaussians, regularisation, size, surfaces, pose, A)
    return count


@njit(forceinline=True)
def _add_moments(row, ax, ay, az, dx, dy, dz):
    """Add weighted offsets a = w d of a point, and a d^T, to a row of sums."""
    row[_FIRST] += ax
    row[_FIRST + 1] += ay
    row[_FIRST + 2] += az
    row[_SECOND] += ax * dx
    row[_SECOND + 1] += ax * dy
    row[_SECOND + 2] += ax * dz
    row[_SECOND + 3] += ay * dy
    row[_SECOND + 4] += ay * dz
    row[_SECOND + 5] += az * dz


@njit(cache=True, nogil=True)
def evict(centre, radius, size, table, sums, gaussians, cell_keys, count):
    """Remove the cells with a centre further than `radius` [m] from `centre` (3,); return the number that remains."""
    table[:] = EMPTY
    kept = 0
    for cell in range(count):
        x, y, z = _centre(cell_keys[cell], size)
        if (x - centre[0]) ** 2 + (y - centre[1]) ** 2 + (z - centre[2]) ** 2 > radius * radius:
            continue
        for column in range(sums.shape[1]):
            sums[kept, column] = sums[cell, column]
        for column in range(gaussians.shape[1]):
            gaussians[kept, column] = gaussians[cell, column]
        cell_keys[kept] = cell_keys[cell]
        table[_find(table, cell_keys, cell_keys[kept])] = kept
        kept += 1
    return kept


@njit(cache=True, nogil=True)
def rehash(cell_keys, count, table):
    """Fill a table, after it has grown, with the existing cells."""
    table[:] = EMPTY
    for cell in range(count):
        table[_find(table, cell_keys, cell_keys[cell])] = cell


@njit(forceinline=True)
def _add_point(H, g, u, S, qx, qy, qz, fx, fy, fz):
    """Add u J^T S J to the upper triangle of H and J^T f to g, for J = [-[q]_x, I], the products written out."""
    xx, xy, xz, yy, yz, zz = u * S[3], u * S[4], u * S[5], u * S[6], u * S[7], u * S[8]
    # A = [q]_x S, the block of rotation and translation
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


@njit(forceinline=True)
def _cells_of(xyz, pose, size, ceiling, neighbours, table, cell_keys, gaussians):
    """Rows (N, neighbours) of the cells of points, -1 where there is none.

    In a loop of its own, many of the lookups, which miss the cache, are under way at once.
    """
    cells = np.empty((len(xyz), neighbours), np.int64)
    inverse_size = 1.0 / size
    top = pose[2, 3] + ceiling
    for i in range(len(xyz)):
        x, y, z = _rotated(pose, np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2]))
        x, y, z = x + pose[0, 3], y + pose[1, 3], z + pose[2, 3]
        for n in range(neighbours):
            step = size if n % 2 == 1 else -size
            axis = (n + 1) // 2
            key = _key(
                x + (step if axis == 1 else 0.0),
                y + (step if axis == 2 else 0.0),
                z + (step if axis == 3 else 0.0),
                inverse_size,
            )
            cells[i, n] = _met(table, cell_keys, gaussians, key, z, top)
    return cells


@njit(cache=True, nogil=True)
def normal_equations(xyz, weight, pose, size, ceiling, neighbours, kernel, table, cell_keys, gaussians, scores, scored):
    """Linearise NDT: sum over points of w rho'(m) J^T S^-1 [J | r], with m = r^T S^-1 r and r = T x - mean.

    The perturbation is a rotation about the sensor and a translation of the sensor, both in the axes of the map:
    J = [-[R x]_x, I]. The robust weight is Cauchy's, 1 / (1 + m / kernel^2).

    Args:
        xyz: Points (N, 3).
        weight: Their weights (N,).
        pose: Pose (4, 4) of the points in the map.
        size: Size of the cells [m].
        ceiling: As in `VoxelGaussians`.
        neighbours: 1, the point's own cell, or 7, with the six face neighbours.
        kernel: Scale of the robust weight.
        table: Hash table of the cells.
        cell_keys: Keys of the cells.
        gaussians: Gaussians of the cells.
        scores: (N, 6) or empty; each point's contribution to the gradient is added to its row, and the last two sums
            are computed.
        scored: Whether the paper's eq. 5 is computed.

    Returns:
        H (6, 6), gradient (6,), and eight sums: robust weights; robust weights x m; weights of the points with a
        minimum m below the 95 % quantile of chi^2(3); the paper's eq. 5 (weights x exp(-m / 2), best cell), if it is
        computed; weights of the points in a cell with a Gaussian; all weights; the third and the fifth sum of the
        points whose Gaussian is not level.
    """
    cells = _cells_of(xyz, pose, size, ceiling, neighbours, table, cell_keys, gaussians)
    H = np.zeros((6, 6))
    g = np.zeros(6)
    totals = np.zeros(8)
    inverse_kernel = 1.0 / (kernel * kernel)
    for i in range(len(xyz)):
        px, py, pz, w = np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2]), np.float64(weight[i])
        qx, qy, qz = _rotated(pose, px, py, pz)
        x, y, z = qx + pose[0, 3], qy + pose[1, 3], qz + pose[2, 3]
        best, upright = np.inf, False
        totals[5] += w
        for n in range(neighbours):
            cell = cells[i, n]
            if cell < 0:
                continue
            S = gaussians[cell]
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
                upright = upright or not _is_level(S)
                scores[i, 0] += qy * fz - qz * fy
                scores[i, 1] += qz * fx - qx * fz
                scores[i, 2] += qx * fy - qy * fx
                scores[i, 3] += fx
                scores[i, 4] += fy
                scores[i, 5] += fz
        if best < np.inf:
            totals[4] += w
            if scored:
                totals[3] += w * math.exp(-0.5 * best)
            if best < INLIER_THRESHOLD:
                totals[2] += w
            if upright:
                totals[6] += w if best < INLIER_THRESHOLD else 0.0
                totals[7] += w
    for k in range(6):
        for j in range(k):
            H[k, j] = H[j, k]
    return H, g, totals


@njit(cache=True, nogil=True)
def fits(xyz, poses, size, ceiling, table, cell_keys, gaussians):
    """Compute how well points fit the Gaussians of their cells at each of several poses.

    Args:
        xyz: Points (N, 3).
        poses: Poses (P, 4, 4) of the points in the map.
        size: Size of the cells [m].
        ceiling: As in `VoxelGaussians`.
        table: Hash table of the cells.
        cell_keys: Keys of the cells.
        gaussians: Gaussians of the cells.

    Returns:
        The paper's eq. 5, and the number of points with an m below the 95 % quantile of chi^2(3), (P, 2); both as sums
        over the points in their own cells.
    """
    sums = np.zeros((len(poses), 2))
    inverse_size = 1.0 / size
    for p in range(len(poses)):
        pose = poses[p]
        top = pose[2, 3] + ceiling
        score, inliers = 0.0, 0
        for i in range(len(xyz)):
            x, y, z = _rotated(pose, np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2]))
            x, y, z = x + pose[0, 3], y + pose[1, 3], z + pose[2, 3]
            cell = _met(table, cell_keys, gaussians, _key(x, y, z, inverse_size), z, top)
            if cell < 0:
                continue
            S = gaussians[cell]
            m = _mahalanobis(S, x, y, z)
            if m < NEGLIGIBLE:
                score += math.exp(-0.5 * m)
                inliers += m < INLIER_THRESHOLD
        sums[p, 0], sums[p, 1] = score, inliers
    return sums


@njit(cache=True, nogil=True)
def overlap(xyz, weight, pose, size, ceiling, table, cell_keys, gaussians):
    """Compute the share of the points, by weight, whose own cell has a Gaussian with information.

    Args:
        xyz: Points (N, 3).
        weight: Their weights (N,).
        pose: Pose (4, 4) of the points in the map.
        size: Size of the cells [m].
        ceiling: As in `VoxelGaussians`.
        table: Hash table of the cells.
        cell_keys: Keys of the cells.
        gaussians: Gaussians of the cells.
    """
    met, total = 0.0, 1e-9
    inverse_size = 1.0 / size
    top = pose[2, 3] + ceiling
    for i in range(len(xyz)):
        x, y, z = _rotated(pose, np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2]))
        x, y, z = x + pose[0, 3], y + pose[1, 3], z + pose[2, 3]
        cell = _met(table, cell_keys, gaussians, _key(x, y, z, inverse_size), z, top)
        total += weight[i]
        if cell >= 0:
            met += weight[i]
    return met / total


@njit(cache=True, nogil=True)
def reaches_overlap(xyz, weight, pose, size, ceiling, share, table, cell_keys, gaussians):
    """Whether the `overlap` is at least `share`. Most of the points need not be looked at where it is large.

    They are looked at in several passes over the scan, whose parts differ: upper rings meet fewer surfaces.
    """
    met, total = 0.0, 1e-9
    for i in range(len(xyz)):
        total += weight[i]
    inverse_size = 1.0 / size
    top = pose[2, 3] + ceiling
    for start in range(PASSES):
        for i in range(start, len(xyz), PASSES):
            x, y, z = _rotated(pose, np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2]))
            x, y, z = x + pose[0, 3], y + pose[1, 3], z + pose[2, 3]
            cell = _met(table, cell_keys, gaussians, _key(x, y, z, inverse_size), z, top)
            if cell >= 0:
                met += weight[i]
        if met / total >= share:
            return True
    return False


@njit(cache=True, nogil=True)
def support(xyz, weight, pose, size, ceiling, kernel, table, cell_keys, gaussians):
    """Compute the directions that the surfaces face to which the points are matched.

    Args:
        xyz: Points (N, 3).
        weight: Their weights (N,).
        pose: Pose (4, 4) of the points in the map.
        size: Size of the cells [m].
        ceiling: As in `VoxelGaussians`.
        kernel: Scale of the robust weights, which are those of `normal_equations`.
        table: Hash table of the cells.
        cell_keys: Keys of the cells.
        gaussians: Gaussians of the cells.

    Returns:
        The weighted mean (3, 3) of n n^T over the surface normals n, trace 1, in the axes of the map; the rows (N,) of
        the points' cells; and the weights (N,) of their surfaces in the mean, 0 without a surface.
    """
    normals, counted = np.zeros((3, 3)), np.zeros(len(xyz))
    total = 1e-12
    inverse_kernel = 1.0 / (kernel * kernel)
    cells = _cells_of(xyz, pose, size, ceiling, 1, table, cell_keys, gaussians)[:, 0]
    for i in range(len(xyz)):
        cell = cells[i]
        if cell < 0:
            continue
        x, y, z = _rotated(pose, np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2]))
        S = gaussians[cell]
        m = _mahalanobis(S, x + pose[0, 3], y + pose[1, 3], z + pose[2, 3])
        counted[i] = weight[i] / (1.0 + m * inverse_kernel)
        total += counted[i]
        u = counted[i] / (S[3] + S[6] + S[8])
        normals[0, 0] += u * S[3]
        normals[0, 1] += u * S[4]
        normals[0, 2] += u * S[5]
        normals[1, 1] += u * S[6]
        normals[1, 2] += u * S[7]
        normals[2, 2] += u * S[8]
    for i in range(3):
        for j in range(i):
            normals[i, j] = normals[j, i]
    return normals / total, cells, counted / total


@njit(cache=True, nogil=True)
def facing(cells, weight, axes, gaussians):
    """Compute the part (K,) of the surfaces that face each of several axes by more than the tilt of their normals.

    Args:
        cells: Rows (N,) of the points' cells, as of `support`.
        weight: Weights (N,) of their surfaces.
        axes: Unit vectors (K, 3), one per row, in the axes of the map.
        gaussians: Gaussians of the cells.
    """
    shares = np.zeros(len(axes))
    for i in range(len(cells)):
        if weight[i] == 0.0:
            continue
        S = gaussians[cells[i]]
        trace = S[3] + S[6] + S[8]
        for k in range(len(axes)):
            share = _information_along(S, axes[k, 0], axes[k, 1], axes[k, 2]) / trace
            if share > TILT_GATE * S[9]:
                shares[k] += weight[i] * share
    return shares


@njit(forceinline=True)
def _information_along(S, x, y, z):
    """v^T S v: the information of a Gaussian along a direction."""
    return x * (S[3] * x + 2.0 * (S[4] * y + S[5] * z)) + y * (S[6] * y + 2.0 * S[7] * z) + z * S[8] * z


@njit(forceinline=True)
def _mahalanobis(S, x, y, z):
    """Squared Mahalanobis distance of a point to a Gaussian."""
    return _information_along(S, x - S[0], y - S[1], z - S[2])


@njit(cache=True, nogil=True)
def evidence(xyz, weight, pose, relevance, size, ceiling, block, max_weight, table, cell_keys, gaussians, blocks):
    """Compute the evidence for a pose: the sum of the fit over cubic blocks, times the mean fit.

    The mean fit corrects for the amount of points that can fit, which is larger where a scan meets its own ring
    pattern. The weight of a point is n^T R n, with the normal n of its surface and the relevance R; its fit is
    exp(-m / 2) (the paper's eq. 5).

    Args:
        xyz: Points (N, 3).
        weight: Their weights (N,).
        pose: Pose (4, 4) of the points in the map.
        relevance: R (3, 3).
        size: Size of the cells [m].
        ceiling: As in `VoxelGaussians`.
        block: Size of the blocks [m].
        max_weight: Maximum weight of a block, so that a lorry that drives along has no more weight than a lamp post.
        table: Hash table of the cells.
        cell_keys: Keys of the cells.
        gaussians: Gaussians of the cells.
        blocks: Hash table with at least 2 N rows, overwritten.
    """
    blocks[:] = EMPTY
    block_keys = np.empty(len(xyz), np.int64)
    inverse_size, inverse_block = 1.0 / size, 1.0 / block
    top = pose[2, 3] + ceiling
    mass = np.zeros((len(xyz), 2))
    count = 0
    for i in range(len(xyz)):
        x, y, z = _rotated(pose, np.float64(xyz[i, 0]), np.float64(xyz[i, 1]), np.float64(xyz[i, 2]))
        x, y, z = x + pose[0, 3], y + pose[1, 3], z + pose[2, 3]
        cell = _met(table, cell_keys, gaussians, _key(x, y, z, inverse_size), z, top)
        if cell < 0:
            continue
        S = gaussians[cell]
        relevant = (
            relevance[0, 0] * S[3]
            + relevance[1, 1] * S[6]
            + relevance[2, 2] * S[8]
            + 2.0 * (relevance[0, 1] * S[4] + relevance[0, 2] * S[5] + relevance[1, 2] * S[7])
        )
        relevant *= weight[i] / (S[3] + S[6] + S[8])
        key = _key(x, y, z, inverse_block)
        slot = _find(blocks, block_keys, key)
        if blocks[slot] == EMPTY:
            blocks[slot] = count
            block_keys[count] = key
            count += 1
        mass[blocks[slot], 0] += relevant
        mass[blocks[slot], 1] += relevant * math.exp(-0.5 * _mahalanobis(S, x, y, z))
    total, possible = 0.0, 1e-12
    for k in range(count):
        if mass[k, 0] > 0.0:
            counted = min(1.0, max_weight / mass[k, 0])
            total += mass[k, 1] * counted
            possible += mass[k, 0] * counted
    return total * total / possible


@njit(cache=True, nogil=True)
def merge(
    fine_sums,
    fine_keys,
    fine_count,
    fine_size,
    size,
    min_points,
    regularisation,
    pose,
    table,
    sums,
    gaussians,
    cell_keys,
):
    """Fill empty cells of a larger `size` with the moments of finer cells; return their number.

    The Gaussians have surface information, for a sensor at `pose` (4, 4).
    """
    A = np.empty((3, 3))
    inverse_size = 1.0 / size
    count = 0
    for i in range(fine_count):
        fine = fine_sums[i]
        x, y, z = _centre(fine_keys[i], fine_size)
        key = _key(x, y, z, inverse_size) | (fine_keys[i] & _ABOVE)
        slot = _find(table, cell_keys, key)
        if table[slot] == EMPTY:
            _add_cell(key, slot, count, table, sums, gaussians, cell_keys)
            count += 1
        row = sums[table[slot]]
        cx, cy, cz = _centre(key, size)
        dx, dy, dz = x - cx, y - cy, z - cz  # sums of w (d + o) and of w (d + o) (d + o)^T, for the offset d of a cell
        for k in range(SUMS):
            row[k] += fine[k]
        ox, oy, oz = fine[_FIRST], fine[_FIRST + 1], fine[_FIRST + 2]
        row[_SECOND] += 2.0 * dx * ox
        row[_SECOND + 1] += dx * oy + dy * ox
        row[_SECOND + 2] += dx * oz + dz * ox
        row[_SECOND + 3] += 2.0 * dy * oy
        row[_SECOND + 4] += dy * oz + dz * oy
        row[_SECOND + 5] += 2.0 * dz * oz
        _add_moments(row, fine[0] * dx, fine[0] * dy, fine[0] * dz, dx, dy, dz)
    for cell in range(count):
        if sums[cell, _COUNT] >= min_points:
            _update_gaussian(cell, cell_keys[cell], sums, gaussians, regularisation, size, True, pose, A)
    return count


@njit(cache=True, nogil=True)
def stepped(pose, H, gradient, free, ridge):
    """Take one Gauss-Newton step: a rotation about the sensor and a translation of it, both in the target's axes.

    Written as loops: numpy's product and solver of matrices take four times as long to compile as all other kernels of
    a step.

    Args:
        pose: Pose (4, 4).
        H: Normal matrix (6, 6).
        gradient: Gradient (6,).
        free: Orthonormal directions (6, K), one per column, along which a step may be taken.
        ridge: Share of the trace of the normal matrix on its diagonal.

    Returns:
        The new pose (4, 4), and the step (6,).
    """
    count = free.shape[1]
    A, b, step = np.zeros((count, count)), np.zeros(count), np.zeros(6)
    trace = 0.0
    for i in range(count):
        for k in range(6):
            b[i] -= free[k, i] * gradient[k]
            for j in range(i + 1):
                for m in range(6):
                    A[i, j] += free[k, i] * H[k, m] * free[m, j]
        trace += A[i, i]
    for i in range(count):
        A[i, i] += ridge * max(trace, 1e-12)
    _solve_by_cholesky(A, b)
    for k in range(6):
        for i in range(count):
            step[k] += free[k, i] * b[i]
    out = pose.copy()
    _rotate(out, step[0], step[1], step[2])
    for axis in range(3):
        out[axis, 3] += step[3 + axis]
    return out, step


@njit
def _solve_by_cholesky(A, b):
    """Replace b by the solution of A x = b, for a symmetric, positive definite A, of which the lower half is used."""
    for i in range(len(b)):
        for j in range(i + 1):
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k]
            if j < i:
                A[i, j] /= A[j, j]
            else:
                A[i, i] = math.sqrt(A[i, i])
        for k in range(i):
            b[i] -= A[i, k] * b[k]
        b[i] /= A[i, i]
    for i in range(len(b) - 1, -1, -1):
        for k in range(i + 1, len(b)):
            b[i] -= A[k, i] * b[k]
        b[i] /= A[i, i]


@njit
def _rotate(pose, x, y, z):
    """Turn the axes of a pose (4, 4) by a rotation vector [rad], and make them orthonormal again."""
    squared = x * x + y * y + z * z
    angle = math.sqrt(squared)
    if angle < 1e-6:
        a, b = 1.0, 0.5
    else:
        a, b = math.sin(angle) / angle, 2.0 * (math.sin(0.5 * angle) / angle) ** 2
    for j in range(3):
        u, v, w = pose[0, j], pose[1, j], pose[2, j]
        along = b * (x * u + y * v + z * w)
        rest = 1.0 - b * squared
        pose[0, j] = rest * u + along * x + a * (y * w - z * v)
        pose[1, j] = rest * v + along * y + a * (z * u - x * w)
        pose[2, j] = rest * w + along * z + a * (x * v - y * u)
    # a Newton step R (3 I - R^T R) / 2 to the nearest rotation: rounding errors accumulate
    G = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                G[i, j] += pose[k, i] * pose[k, j]
    for i in range(3):
        u, v, w = pose[i, 0], pose[i, 1], pose[i, 2]
        for j in range(3):
            pose[i, j] = 0.5 * (3.0 * pose[i, j] - u * G[0, j] - v * G[1, j] - w * G[2, j])


@njit(cache=True, nogil=True)
def clustered_sums(xyz, scores, size, table):
    """Return the sums (C, 6) of the scores (N, 6) of points (N, 3) by cell; `table` (at least 2 N) is overwritten."""
    table[:] = EMPTY
    keys = np.empty(len(xyz), np.int64)
    inverse_size = 1.0 / size
    cells = np.empty(len(xyz), np.int64)
    count = 0
    for i in range(len(xyz)):
        key = _key(xyz[i, 0], xyz[i, 1], xyz[i, 2], inverse_size)
        slot = _find(table, keys, key)
        if table[slot] == EMPTY:
            table[slot] = count
            keys[count] = key
            count += 1
        cells[i] = table[slot]
    sums = np.zeros((count, 6))
    for i in range(len(xyz)):
        for k in range(6):
            sums[cells[i], k] += scores[i, k]
    return sums
