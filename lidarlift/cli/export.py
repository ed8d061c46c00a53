"""`lidarlift export`: a run's trajectory or map in another format or frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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
    run = _finished(folder) if (folder / "run.json").is_file() else _unfinished(folder)
    T = _new_axes(run, frame)
    kind = format or _format_of(out)
    if kind in (Format.KITTI, Format.TUM):
        _export_trajectory(run, out, kind, T)
    else:
        suffix = f".{kind.value}"
        out = out if out.suffix.lower() == suffix else out.with_name(out.name + suffix)
        (_export_recording if kind is Format.MCAP else _export_map)(run, out, T)
    if run.note:
        messages.print(f"Note: {run.note}", style="yellow", markup=False)
    print(f"Written to {out}")


@dataclass(frozen=True)
class _Run:
    """What is exported.

    Attributes:
        source: The file or folder, for errors.
        T_camera0_lidar: (4, 4), None if it is unknown.
        trajectory: Returns the stamps (N,) [s] and the poses (N, 4, 4) T_world_lidar.
        map: Returns the map.
        note: For the user, '' for none.
    """

    source: Path
    T_camera0_lidar: Array | None
    trajectory: Callable[[], tuple[Array, Array]]
    map: Callable[[], PointCloud]
    note: str = ""


def _finished(folder: Path) -> _Run:
    """A finished run, from its files."""
    import numpy as np

    from slam.data.pose_files import read_poses
    from slam.session import read_report

    def trajectory() -> tuple[Array, Array]:
        stamps, poses = read_poses(folder / "trajectory_tum.txt", "xyzw")
        return np.asarray(stamps), poses

    T = read_report(folder).get("T_camera0_lidar")
    return _Run(folder / "run.json", None if T is None else np.array(T), trajectory, lambda: _map(folder))


def _unfinished(folder: Path) -> _Run:
    """A run that was killed or stopped, or is under way, from its session."""
    from slam.recovery import recovered, session_of
    from slam.session import read_report

    path = session_of(folder)
    if path is None:
        read_report(folder)  # says what is wrong
        raise InputError(f"{folder}: no run")
    run = recovered(path)
    note = f"{folder}: the run did not finish; its first {len(run.poses)} frames are exported"
    return _Run(path, run.T_camera0_lidar, lambda: (run.stamps, run.poses), run.map, note)


def _new_axes(run: _Run, frame: Axes) -> Array:
    """Transform (4, 4) from the LiDAR's axes, those of a run, to the axes of `frame`."""
    import numpy as np

    if frame is Axes.LIDAR:
        return np.eye(4)
    if run.T_camera0_lidar is None:
        raise InputError(f"{run.source}: the run has no calibration of camera 0; use --frame lidar")
    return run.T_camera0_lidar


def _format_of(out: Path) -> Format:
    """The format of the file's suffix."""
    suffix = out.suffix.lower().removeprefix(".")
    if suffix not in ("pcd", "ply", "las", "laz", "mcap"):
        raise InputError(f"{out}: the suffix is no format; use --format kitti, tum, pcd, ply, las, laz or mcap")
    return Format(suffix)


def _export_trajectory(run: _Run, out: Path, kind: Format, T: Array) -> None:
    from slam.data.atomic import write_text
    from slam.data.pose_files import kitti_text, tum_text
    from slam.data.se3 import inverse

    stamps, poses = run.trajectory()
    poses = T @ poses @ inverse(T)
    write_text(out, kitti_text(poses) if kind is Format.KITTI else tum_text(stamps, poses))


def _export_map(run: _Run, out: Path, T: Array) -> None:
    from slam.data.point_writer import write_points

    write_points(out, run.map().transformed(T))


def _export_recording(run: _Run, out: Path, T: Array) -> None:
    from slam.data.recordings.export import write_mcap
    from slam.data.se3 import inverse

    stamps, poses = run.trajectory()
    write_mcap(out, stamps, T @ poses @ inverse(T), run.map().transformed(T))


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
