"""Numba kernel of the calibration: the strength of the image at projected LiDAR edges."""

from numba import njit

MIN_DEPTH = 0.1  # m


@njit(cache=True)
def edge_sums(points, step, motion, frame, field, weight, images, K, T, delay, share, sums):
    """Sum the fields of the images at projected points, by frame; a point outside the image counts as 0.

    Args:
        points: (E, 3) in the LiDAR's frame at the scan's stamp [m].
        step: (E, 3) from a point to the next ray [m].
        motion: (E, 3), velocity of the points relative to the LiDAR [m/s].
        frame: (E,) image of each point.
        field: (E,) field of the image in which it is looked up.
        weight: (E,) weight of each point.
        images: (F, 2, H, W) float32.
        K: (3, 3) camera matrix.
        T: (4, 4) T_camera_lidar.
        delay: Time of the images after the scans' stamps [s].
        share: (E,) fraction of `step` at which the edge is.
        sums: (F,) result.
    """
    height, width = images.shape[2], images.shape[3]
    sums[:] = 0.0
    for i in range(len(points)):
        x = points[i, 0] + share[i] * step[i, 0] + delay * motion[i, 0]
        y = points[i, 1] + share[i] * step[i, 1] + delay * motion[i, 1]
        z = points[i, 2] + share[i] * step[i, 2] + delay * motion[i, 2]
        depth = T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3]
        if depth < MIN_DEPTH:
            continue
        u = K[0, 0] * (T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3]) / depth + K[0, 2]
        v = K[1, 1] * (T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3]) / depth + K[1, 2]
        if not (u >= 0.0 and v >= 0.0 and u < width - 1 and v < height - 1):
            continue
        column, row = int(u), int(v)
        a, b = u - column, v - row
        image = images[frame[i], field[i]]
        above = (1 - a) * image[row, column] + a * image[row, column + 1]
        below = (1 - a) * image[row + 1, column] + a * image[row + 1, column + 1]
        sums[frame[i]] += weight[i] * ((1 - b) * above + b * below)
