"""`lidarlift depth-benchmark`: how well methods predict what a sparse scan does not show."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.arguments import ColumnsOption, FramesOption, SensorOption, SequenceOption, frame_slice
from lidarlift.cli.console import progress
from slam.data.atomic import require_writable

if TYPE_CHECKING:
    from eval.depth.report import DepthReport
    from slam.data.dataset import Dataset


def depth_benchmark(
    dataset: Annotated[
        Path, typer.Argument(help="A drive whose scans have rings, or KITTI's depth completion images with truth.")
    ],
    sequence: SequenceOption = None,
    frames: FramesOption = ":",
    sensor: SensorOption = None,
    columns: ColumnsOption = None,
    phase: Annotated[int, typer.Option(min=0, max=3, help="The first ring that is kept; then every fourth.")] = 0,
    method: Annotated[list[str] | None, typer.Option(help="Only this one; may be given several times.")] = None,
    out: Annotated[Path, typer.Option(help="The folder for the figures.")] = Path("runs/depth"),
) -> None:
    """Measure how well methods predict depth: they see 16 of 64 rings, and the other rings' returns are the answers.

    Example: `lidarlift depth-benchmark kitti/sequences/04 --frames ::5 --out runs/depth-04`

    Of sensors with fewer rings, every second is held out. A folder like KITTI's val_selection_cropped (velodyne_raw,
    groundtruth_depth, image) is recognised and measured by that benchmark's own rules.
    """
    from eval.depth.maps import is_depth_map_folder
    from eval.depth.plot import plot_risk_coverage
    from eval.depth.tables import format_report
    from eval.evaluation import write_json
    from slam.data.dataset import open_dataset

    require_writable(out)
    chosen = frame_slice(frames)
    if is_depth_map_folder(dataset):
        report = _of_depth_maps(dataset, method or (), chosen)
    else:
        report = _of_drive(open_dataset(dataset, sequence, sensor, columns=columns), method or (), chosen, phase)
    write_json(out / "depth.json", report.as_dict())
    written = ["depth.json"]
    if any(each.full for each in report.methods.values()):
        plot_risk_coverage(report, out / "risk_coverage.png")
        written.append("risk_coverage.png")
    print(report.about.title + "\n\n" + format_report(report))
    print(f"Written to {out}: {', '.join(written)}")


def _of_drive(data: Dataset, names: Collection[str], frames: slice, phase: int) -> DepthReport:
    from enrichment.methods.registry import make_methods, runnable
    from lidarlift.depth_benchmark import frames_to_measure, report_of_drive

    methods = make_methods(names or runnable())
    with progress(data.name, len(frames_to_measure(data, frames, phase))) as advance:
        return report_of_drive(data, methods, frames, phase, advance)


def _of_depth_maps(folder: Path, names: Collection[str], images: slice) -> DepthReport:
    from lidarlift.depth_benchmark import completions, depth_maps_to_measure, report_of_depth_maps

    methods = completions(names)
    with progress(folder.name, len(depth_maps_to_measure(folder, images))) as advance:
        return report_of_depth_maps(folder, methods, images, advance)
