"""The command line: the one place where slam and eval meet."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from slam.config import load_config, preset_names
from slam.data.cloud import Array
from slam.data.dataset import Dataset, open_dataset
from slam.data.errors import InputError
from slam.data.se3 import inverse
from slam.pipeline import FrameRecord, Pipeline, Run, compile_kernels
from slam.session import read_report, save_run

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="""LiDAR SLAM for people with a cheap LiDAR: a drive's scans become a trajectory, a map and an honest report.

    Example: `lidarlift run 2011_09_26/2011_09_26_drive_0013_sync --input 16 --out runs/0013`
    """,
)
messages = Console(stderr=True, highlight=False, soft_wrap=True, emoji=False)


class Input(StrEnum):
    SIXTY_FOUR = "64"
    SIXTEEN = "16"


class Format(StrEnum):
    KITTI = "kitti"
    TUM = "tum"
    PCD = "pcd"
    PLY = "ply"


class Axes(StrEnum):
    LIDAR = "lidar"
    CAMERA = "camera"


@app.command()
def run(
    dataset: Annotated[Path, typer.Argument(help="A KITTI odometry or raw folder, or a folder of scans.")],
    sequence: Annotated[str | None, typer.Option(help="Which sequence or drive, where the folder has several.")] = None,
    input: Annotated[
        Input | None, typer.Option(help="64: the scan as recorded; 16: rings dropped. Default: what the sensor has.")
    ] = None,
    config: Annotated[str | None, typer.Option(help=f"A YAML file or a preset: {', '.join(preset_names())}.")] = None,
    set_: Annotated[list[str] | None, typer.Option("--set", help="One setting: odometry.voxel_size=1.0")] = None,
    frames: Annotated[str, typer.Option(help="A slice of the drive, FROM:TO or FROM:TO:STEP.")] = ":",
    sensor: Annotated[str | None, typer.Option(help="hdl64, vlp16 or a YAML file with the beams.")] = None,
    out: Annotated[Path | None, typer.Option(help="The run folder. Default: runs/NAME-INPUT.")] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Stop at the first damaged file instead of going on.")
    ] = False,
) -> None:
    """Drive through a data set: trajectory, map, and ATE, RPE and drift where there is ground truth.

    Example: `lidarlift run kitti/sequences/04 --frames 0:50 --set odometry.voxel_size=1.25 --out runs/04`
    """
    from eval.evaluation import evaluate_run
    from eval.plot import plot_run
    from eval.tables import format_table

    data = open_dataset(dataset, sequence, sensor)
    few_rings = data.sensor is not None and data.sensor.ring_count <= 16
    if few_rings and input is Input.SIXTY_FOUR:
        raise InputError(f"{dataset}: its sensor has no 64 rings; leave --input out")
    channels = input.value if input else "16" if few_rings else None
    settings = load_config(config, set_ or (), input=channels)
    folder = out or Path("runs") / f"{data.name.lower().replace(' ', '-')}-{settings.front_end.input}"

    _check_folder(folder)
    compile_kernels(settings, lambda: messages.print("Compiling kernels, once: about 20 seconds ..."))
    with _progress(data, _slice(frames)) as on_frame:
        result = Pipeline(settings).run(data, _slice(frames), strict=strict, on_frame=on_frame)
    save_run(result, folder)
    _report_problems(result)
    metrics = evaluate_run(folder)
    plot_run(folder, f"{data.name}, {settings.front_end.input} channels")
    print(_summary(result))
    if metrics:
        protocol = metrics.pop("protocol")
        print(format_table({"odometry": metrics["odometry"]}, protocol))
    else:
        print("No ground truth: no ATE, RPE or drift.")
    print(f"Written to {folder}: {', '.join(sorted(file.name for file in folder.iterdir()))}")


@app.command()
def evaluate(
    estimate: Annotated[Path, typer.Argument(help="Trajectory, KITTI or TUM format.")],
    reference: Annotated[Path, typer.Argument(help="Ground truth, KITTI or TUM format.")],
    calib: Annotated[
        Path | None, typer.Option(help="KITTI calib.txt: brings a camera-0 reference into the LiDAR's frame.")
    ] = None,
) -> None:
    """Compare a trajectory with ground truth: ATE, RPE and KITTI's drift, each with its protocol.

    Example: `lidarlift evaluate runs/04/trajectory_kitti.txt poses/04.txt --calib sequences/04/calib.txt`
    """
    from eval.evaluation import evaluate_files
    from eval.tables import format_table

    metrics = evaluate_files(estimate, reference, calib)
    protocol = metrics.pop("protocol")
    print(format_table({estimate.name: metrics}, protocol))


@app.command()
def export(
    folder: Annotated[Path, typer.Argument(metavar="RUN", help="A folder that `lidarlift run` wrote.")],
    out: Annotated[Path, typer.Argument(help="The file to write.")],
    format: Annotated[
        Format | None, typer.Option(help="kitti or tum: the trajectory; pcd or ply: the map. Default: by the suffix.")
    ] = None,
    frame: Annotated[
        Axes, typer.Option(help="lidar: x forward, z up, as in the run; camera: KITTI's camera 0, z forward.")
    ] = Axes.LIDAR,
) -> None:
    """Write a run's trajectory or map in another format or frame.

    Example: `lidarlift export runs/04 04.txt --format kitti --frame camera`
    """
    from slam.data.atomic import write_text
    from slam.data.cloud import PointCloud
    from slam.data.point_files import read_points
    from slam.data.point_writer import write_points
    from slam.data.pose_files import kitti_text, read_poses, tum_text

    report = read_report(folder)
    T = _camera_from_lidar(report, folder) if frame is Axes.CAMERA else np.eye(4)
    kind = format or _format_of(out)
    if kind in (Format.KITTI, Format.TUM):
        stamps, poses = read_poses(folder / "trajectory_tum.txt")
        poses = T @ poses @ inverse(T)
        write_text(out, kitti_text(poses) if kind is Format.KITTI else tum_text(np.asarray(stamps), poses))
    else:
        points = read_points(folder / "map.pcd")
        intensity = np.zeros(len(points.xyz)) if points.intensity is None else points.intensity
        suffix = f".{kind.value}"
        out = out if out.suffix.lower() == suffix else out.with_name(out.name + suffix)
        write_points(out, PointCloud(points.xyz, intensity).transformed(T))
    print(f"Written to {out}")


def main() -> None:
    """Entry point: 0 done, 1 a clear error on stderr, 2 usage."""
    try:
        app()
    except InputError as error:
        messages.print(f"Error: {error}", style="red", markup=False)
        sys.exit(1)


def _check_folder(folder: Path) -> None:
    """Before the run, so that no work is lost to a mistake in the name; nothing is made yet."""
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise InputError(f"{folder}: {existing} is no folder that can be written to; choose another --out")


def _slice(text: str) -> slice:
    try:
        parts = [int(part) if part else None for part in text.split(":")]
        if len(parts) not in (2, 3) or (len(parts) == 3 and (parts[2] is not None and parts[2] < 1)):
            raise ValueError
    except ValueError as error:
        raise InputError(f"--frames {text}: write FROM:TO or FROM:TO:STEP, as in 0:50 or ::2") from error
    return slice(*parts)


@contextmanager
def _progress(data: Dataset, frames: slice) -> Iterator[Callable[[FrameRecord], None]]:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]} frames/s"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=messages) as bar:
        task = bar.add_task(data.name, total=len(range(len(data))[frames]), rate="-")

        def on_frame(record: FrameRecord) -> None:
            del record
            speed = bar.tasks[task].speed
            bar.update(task, advance=1, rate=f"{speed:.1f}" if speed else "-")

        yield on_frame


def _summary(result: Run) -> str:
    """What was run, and how it went, in a few lines."""
    counts = result.counts()
    length = np.linalg.norm(np.diff(result.poses[:, :3, 3], axis=0), axis=1).sum()
    times = {stage: np.median([r.milliseconds[stage] for r in result.records]) for stage in ("odometry", "map")}
    protocol: dict[str, Any] = {
        "deskew": "on" if result.deskewed else "off",
        "vertical correction": f"{np.rad2deg(result.vertical_correction):.3f} deg",
        "registration": f"{result.config.odometry.registration} against the {result.config.odometry.target}",
    }
    return (
        f"{result.dataset.name}, {result.config.front_end.input} channels, "
        + ", ".join(f"{name} {value}" for name, value in protocol.items())
        + f"\n{counts['frames']} frames, {length:.2f} m; {counts['retried']} registered after a search, "
        f"{counts['failed']} failed; map of {len(result.map):,} points"
        f"\nMedian a frame: odometry {times['odometry']:.1f} ms, map {times['map']:.1f} ms\n"
    )


def _report_problems(result: Run) -> None:
    """The first problem of each kind, and how many there were, on stderr; run.json has them all."""
    kinds: dict[str, list[str]] = {}
    for problem in result.problems:
        kinds.setdefault(problem.kind, []).append(problem.message)
    for kind, found in kinds.items():
        more = f" (and {len(found) - 1} more, see run.json)" if len(found) > 1 else ""
        messages.print(f"Note: {kind}: {found[0]}{more}", style="yellow", markup=False)


def _camera_from_lidar(report: dict[str, Any], folder: Path) -> Array:
    T = report.get("T_camera0_lidar")
    if T is None:
        raise InputError(f"{folder / 'run.json'}: the run had no calibration of a camera 0; export with --frame lidar")
    return np.array(T)


def _format_of(out: Path) -> Format:
    suffix = out.suffix.lower().removeprefix(".")
    if suffix not in ("pcd", "ply"):
        raise InputError(f"{out}: say what to write, --format kitti, tum, pcd or ply")
    return Format(suffix)


if __name__ == "__main__":
    main()
