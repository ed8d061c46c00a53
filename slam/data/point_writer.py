"""Clouds to PCD and PLY, through Open3D's tensor I/O, which keeps fields beside the coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from slam.data.atomic import written_beside
from slam.data.cloud import Array, PointCloud
from slam.data.errors import InputError


def write_points(path: Path, cloud: PointCloud, fields: Mapping[str, Array] | None = None) -> None:
    """Write x y z intensity, the colour where there is one, and other `fields`, (N,) each, as binary .pcd or .ply.

    Raises InputError on another suffix, on an empty cloud (neither format has one) and where writing fails.
    """
    if path.suffix.lower() not in (".pcd", ".ply"):
        raise InputError(f"{path}: clouds are written as .pcd or .ply")
    if len(cloud) == 0:
        raise InputError(f"{path}: no points to write; were all scans empty?")
    import open3d as o3d  # a second of import, at the end of a run only

    points = o3d.t.geometry.PointCloud(o3d.core.Tensor.from_numpy(cloud.xyz))
    points.point["intensity"] = o3d.core.Tensor.from_numpy(np.ascontiguousarray(cloud.intensity[:, None]))
    if cloud.colour is not None:
        points.point["colors"] = o3d.core.Tensor.from_numpy(cloud.colour)
    for name, values in (fields or {}).items():
        column = np.ascontiguousarray(values[:, None], np.uint8 if values.dtype == bool else values.dtype)
        points.point[name] = o3d.core.Tensor.from_numpy(column)
    with written_beside(path) as temporary:
        if not o3d.t.io.write_point_cloud(temporary, points, write_ascii=False, compressed=False):
            raise OSError("Open3D could not write the points; is the disk full?")
