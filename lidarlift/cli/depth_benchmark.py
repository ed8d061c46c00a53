"""`lidarlift depth-benchmark`: accuracy of the depth that enrichment methods predict."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.arguments import FramesOption, frame_slice
from lidarlift.cli.console import progress
from lidarlift.cli.data_options import DataOptions, with_data_options
from slam.data.atomic import require_writable

if TYPE_CHECKING:
    from eval.depth.report import DepthReport
    from slam.data.dataset import Dataset


@with_data_options
def depth_benchmark(
    dataset: Annotated[
        Path,
        typer.Argument(help="A sequence with ring indices, or KITTI's depth completion images with ground truth."),
    ],
    reading: DataOptions,
    frames: FramesOption = ":",
    phase: Annotated[
        int, typer.Option(min=0, max=3, help="Index of the first ring that is kept, then every fourth.")
    ] = 0,
    method: Annotated[
        list[str] | None, typer.Option(help="Measure this method only; may be given several times.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the results.")] = Path("runs/depth"),
) -> None:
    """Measure the depth that enrichment methods predict from 16 of 64 rings; the other rings are the reference.

    Example: `lidarlift depth-benchmark kitti/sequences/04 --frames ::5 --out runs/depth-04`

    For sensors with fewer rings, every second ring is held out. A folder in the layout of KITTI's val_selection_cropped
    (velodyne_raw, groundtruth_depth, image) is recognised and measured by the rules of that benchmark.
    """
    from eval.depth.maps import is_depth_map_folder
    from eval.depth.plot import plot_risk_coverage
    from eval.depth.tables import format_report
    from eval.evaluation import write_json

    require_writable(out)
    chosen = frame_slice(frames)
    if is_depth_map_folder(dataset):
        report = _of_depth_maps(dataset, method or (), chosen)
    else:
        report = _of_drive(reading.opened(dataset), method or (), chosen, phase)
    write_json(out / "depth.json", report.as_dict())
    written = ["depth.json"]
    if any(each.full for each in report.methods.values()):
        plot_risk_coverage(report, out / "risk_coverage.png")
        written.append("risk_coverage.png")
    print(report.about.title + "\n\n" + format_report(report))
    print(f"Written to {out}: {', '.join(written)}")


def _of_drive(data: Dataset, names: Collection[str], frames: slice, phase: int) -> DepthReport:
    from enrichment.methods.registry import make_methods, runnable
    from lidarlift.depth_benchmark import frames_to_measure, sequence_report

    methods = make_methods(names or runnable())
    with progress(data.name, len(frames_to_measure(data, frames, phase))) as advance:
        return sequence_report(data, methods, frames, phase, advance)


def _of_depth_maps(folder: Path, names: Collection[str], images: slice) -> DepthReport:
    from lidarlift.depth_benchmark import completions, depth_map_report, depth_maps_to_measure

    methods = completions(names)
    with progress(folder.name, len(depth_maps_to_measure(folder, images))) as advance:
        return depth_map_report(folder, methods, images, advance)
