"""Writing of point clouds as .pcd, .ply, .las and .laz."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from slam.data.atomic import written_beside
from slam.data.cloud import Array, PointCloud
from slam.data.errors import InputError

SUFFIXES = (".pcd", ".ply", ".las", ".laz")
#: Points per block that is written.
AT_ONCE = 1 << 18
PLY_TYPES = {
    **{"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "u4": "uint"},
    **{"f4": "float", "f8": "double"},
}


def write_points(path: Path, cloud: PointCloud, fields: Mapping[str, Array] | None = None) -> None:
    """Write a cloud: x y z intensity, and the colour if any.

    PCD and PLY are written binary. PCD has the colour in one float as PCL packs it (`rgb`), PLY in three bytes (`red`,
    `green`, `blue`). LAS and LAZ need laspy.

    Args:
        path: The file, with one of `SUFFIXES`.
        cloud: The cloud.
        fields: Further columns (N,), for .pcd and .ply only.

    Raises:
        InputError: The suffix is unknown, the cloud is empty, there are `fields` for .las, or writing fails.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: unknown suffix; write {', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}")
    if len(cloud) == 0:
        raise InputError(f"{path}: no points to write; check whether all scans are empty")
    with written_beside(path) as temporary:
        if suffix in (".las", ".laz"):
            from slam.data.las import write_las

            if fields:
                raise InputError(f"{path}: .las and .laz files have no {', '.join(fields)}; write .pcd or .ply")
            write_las(temporary, cloud)
            return
        columns = _columns(cloud, fields or {}, packed=suffix == ".pcd")
        point = np.dtype([(name, values.dtype.newbyteorder("<")) for name, values in columns.items()])
        with temporary.open("wb") as file:
            file.write((_pcd_header if suffix == ".pcd" else _ply_header)(point, len(cloud)).encode("ascii"))
            for start in range(0, len(cloud), AT_ONCE):
                some = slice(start, start + AT_ONCE)
                table = np.empty(len(cloud.xyz[some]), point)
                for name, values in columns.items():
                    table[name] = values[some]
                table.tofile(file)


def _columns(cloud: PointCloud, fields: Mapping[str, Array], packed: bool) -> dict[str, Array]:
    columns: dict[str, Array] = dict(zip("xyz", cloud.xyz.T, strict=True))
    columns["intensity"] = cloud.intensity
    if cloud.colour is not None and packed:
        red, green, blue = cloud.colour.T.astype(np.uint32)
        columns["rgb"] = (red << 16 | green << 8 | blue).view(np.float32)
    elif cloud.colour is not None:
        columns.update(zip(("red", "green", "blue"), cloud.colour.T, strict=True))
    for name, values in fields.items():
        columns[name] = values.astype(np.uint8) if values.dtype == bool else values
    return columns


def _pcd_header(point: np.dtype, count: int) -> str:
    kinds = [point[name] for name in point.names or ()]
    lines = {
        "VERSION": ["0.7"],
        "FIELDS": point.names or (),
        "SIZE": [kind.itemsize for kind in kinds],
        "TYPE": [kind.kind.upper() for kind in kinds],
        "COUNT": [1] * len(kinds),
        "WIDTH": [count],
        "HEIGHT": [1],
        "VIEWPOINT": [0, 0, 0, 1, 0, 0, 0],
        "POINTS": [count],
        "DATA": ["binary"],
    }
    entries = (" ".join([key, *map(str, values)]) for key, values in lines.items())
    return "\n".join(["# .PCD v0.7 - Point Cloud Data file format", *entries, ""])


def _ply_header(point: np.dtype, count: int) -> str:
    properties = [f"property {PLY_TYPES[point[name].str[1:]]} {name}" for name in point.names or ()]
    start = ["ply", "format binary_little_endian 1.0", "comment written by lidarlift", f"element vertex {count}"]
    return "\n".join([*start, *properties, "end_header", ""])
