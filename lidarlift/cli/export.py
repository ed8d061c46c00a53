"""`lidarlift export`: a run's trajectory or map in another format or frame."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.console import messages
from slam.data.errors import InputError

if TYPE_CHECKING:
    from slam.data.cloud import Array, PointCloud


class Format(StrEnum):
    """File format of the trajectory or map."""

    KITTI = "kitti"
    TUM = "tum"
    PCD = "pcd"
    PLY = "ply"
    LAS = "las"
    LAZ = "laz"
    MCAP = "mcap"


class Axes(StrEnum):
    """Coordinate frame of the output."""

    LIDAR = "lidar"
    CAMERA = "camera"


def export(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="A folder written by `lidarlift run`.")],
    out: Annotated[Path, typer.Argument(help="The file to write.")],
    format: Annotated[
        Format | None,
        typer.Option(
            help="kitti or tum: the trajectory; pcd, ply, las or laz: the map; mcap: both, for RViz and Foxglove. "
            "Default: from the suffix."
        ),
    ] = None,
    frame: Annotated[
        Axes, typer.Option(help="lidar: x forward, z up, as in the run; camera: that of KITTI's camera 0, z forward.")
    ] = Axes.LIDAR,
) -> None:
    """Write a run's trajectory or map in another format or frame.

    Example: `lidarlift export runs/04 04.txt --format kitti --frame camera`
    """
    T = _new_axes(folder, frame)
    kind = format or _format_of(out)
    if kind in (Format.KITTI, Format.TUM):
        _export_trajectory(folder, out, kind, T)
    else:
        suffix = f".{kind.value}"
        out = out if out.suffix.lower() == suffix else out.with_name(out.name + suffix)
        (_export_recording if kind is Format.MCAP else _export_map)(folder, out, T)
    print(f"Written to {out}")


def _new_axes(folder: Path, frame: Axes) -> Array:
    """Transform (4, 4) from the LiDAR's axes, those of a run, to the axes of `frame`."""
    import numpy as np

    from slam.session import read_report

    report = read_report(folder)
    if frame is Axes.LIDAR:
        return np.eye(4)
    T = report.get("T_camera0_lidar")
    if T is None:
        raise InputError(f"{folder / 'run.json'}: the run has no calibration of camera 0; use --frame lidar")
    return np.array(T)


def _format_of(out: Path) -> Format:
    """The format of the file's suffix."""
    suffix = out.suffix.lower().removeprefix(".")
    if suffix not in ("pcd", "ply", "las", "laz", "mcap"):
        raise InputError(f"{out}: the suffix is no format; use --format kitti, tum, pcd, ply, las, laz or mcap")
    return Format(suffix)


def _export_trajectory(folder: Path, out: Path, kind: Format, T: Array) -> None:
    import numpy as np

    from slam.data.atomic import write_text
    from slam.data.pose_files import kitti_text, read_poses, tum_text
    from slam.data.se3 import inverse

    stamps, poses = read_poses(folder / "trajectory_tum.txt", "xyzw")
    poses = T @ poses @ inverse(T)
    write_text(out, kitti_text(poses) if kind is Format.KITTI else tum_text(np.asarray(stamps), poses))


def _export_map(folder: Path, out: Path, T: Array) -> None:
    from slam.data.point_writer import write_points

    write_points(out, _map(folder).transformed(T))


def _export_recording(folder: Path, out: Path, T: Array) -> None:
    import numpy as np

    from slam.data.pose_files import read_poses
    from slam.data.recordings.export import write_mcap
    from slam.data.se3 import inverse

    stamps, poses = read_poses(folder / "trajectory_tum.txt")
    write_mcap(out, np.asarray(stamps), T @ poses @ inverse(T), _map(folder).transformed(T))


def _map(folder: Path) -> PointCloud:
    import numpy as np

    from slam.data.cloud import PointCloud
    from slam.data.point_files import read_cloud

    points = read_cloud(folder / "map.pcd")
    for problem in points.problems:
        if problem.kind == "missing scan":
            raise InputError(problem.message)
        messages.print(f"Note: {problem.message}", style="yellow", markup=False)
    intensity = np.zeros(len(points.xyz)) if points.intensity is None else points.intensity
    return PointCloud(points.xyz, intensity, colour=points.colour)
