"""`lidarlift fit-lasers`: a sensor's laser lines from scans of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.arguments import ColumnsOption, FramesOption, SequenceOption, frame_slice
from lidarlift.cli.console import messages, progress
from slam.data.atomic import require_writable
from slam.data.errors import InputError

if TYPE_CHECKING:
    from slam.data.laser_lines import LaserLines


#: Raw scans lie nearer to their lines [deg]: KITTI's, rounded to 1 mm, within 0.005.
TYPICAL_RESIDUAL = 0.02


def fit_lasers(
    dataset: Annotated[Path, typer.Argument(help="A KITTI raw folder, or a folder of raw scans.")],
    sequence: SequenceOption = None,
    rings: Annotated[
        int | None,
        typer.Option(min=2, help="How many lasers the sensor has. Default: what the data set or most scans say."),
    ] = None,
    frames: FramesOption = ":",
    columns: ColumnsOption = None,
    out: Annotated[Path, typer.Option(help="The file to write; it must not exist yet.")] = Path("sensor.yaml"),
) -> None:
    """Fit elevation and height of each laser to raw scans, for a sensor.yaml: place it beside the scans.

    Any spinning LiDAR; the more different the distances that its lasers see, the better. Files need a ring field
    (.pcd, .ply, .npy), or to be stored ring after ring, as KITTI's are.

    Example: `lidarlift fit-lasers my-scans --rings 32 --out my-scans/sensor.yaml`
    """
    import numpy as np

    from slam.data.atomic import write_text
    from slam.data.dataset import chosen_positions, open_dataset
    from slam.data.laser_lines import fit_dataset, sensor_text

    if out.exists():
        raise InputError(f"{out}: exists already; choose another --out, or move it away")
    require_writable(out.parent)
    data = open_dataset(dataset, sequence, columns=columns)
    positions = chosen_positions(data, frame_slice(frames))
    with progress(f"{data.name}: reading scans", len(positions)) as advance:
        lines, problems = fit_dataset(data, positions, rings, advance)
    for problem in problems:
        messages.print(f"Note: {problem.kind}: {problem.message}", style="yellow", markup=False)
    off = float(np.rad2deg(np.median(lines.residual)))
    if off > TYPICAL_RESIDUAL:
        text = f"points lie {off:.3f} deg off their lines; raw scans are expected, not motion-compensated ones"
        messages.print(f"Note: {data.path}: {text}", style="yellow", markup=False)
    name, correction = (data.sensor.name, data.sensor.vertical_correction) if data.sensor else (data.name, 0.0)
    write_text(out, sensor_text(lines, name, correction))
    print(_table(lines))
    print(f"Written to {out}")


def _table(lines: LaserLines) -> str:
    """A line a ring, top first, each figure with its standard error."""
    import numpy as np

    degrees = np.rad2deg([lines.elevation, lines.elevation_error, lines.residual])
    heading = "ring  elevation [deg]      +-  offset [mm]      +-  residual [deg]   points"
    rows = [
        f"{k:4d}  {degrees[0, k]:15.5f} {degrees[1, k]:7.5f}  {1e3 * lines.offset[k]:11.2f} "
        f"{1e3 * lines.offset_error[k]:7.3f}  {degrees[2, k]:14.4f}  {lines.points[k]:7d}"
        for k in range(len(lines.points))
    ]
    return "\n".join([heading, *rows])
