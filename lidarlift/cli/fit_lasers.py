"""`lidarlift fit-lasers`: fit the laser lines of a sensor to its scans."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.arguments import FramesOption, frame_slice
from lidarlift.cli.console import messages, progress
from lidarlift.cli.data_options import DataOptions, with_data_options
from slam.data.atomic import require_writable
from slam.data.errors import InputError

if TYPE_CHECKING:
    from slam.data.laser_lines import LaserLines


#: Upper bound of the median residual of raw scans [deg]: KITTI's, rounded to 1 mm, reach 0.005.
TYPICAL_RESIDUAL = 0.02


@with_data_options
def fit_lasers(
    dataset: Annotated[Path, typer.Argument(help="A KITTI raw folder, or a folder of raw scans.")],
    reading: DataOptions,
    rings: Annotated[
        int | None,
        typer.Option(min=2, help="Number of lasers. Default: from the data set or the majority of the scans."),
    ] = None,
    frames: FramesOption = ":",
    out: Annotated[Path, typer.Option(help="The file to write; it must not exist yet.")] = Path("sensor.yaml"),
) -> None:
    """Fit elevation and height offset of each laser to raw scans, for a sensor.yaml in the folder of the scans.

    This works for any spinning LiDAR, best if each laser sees a wide range of distances. Files need a ring field
    (.pcd, .ply, .npy), or their points must be stored ring by ring, as in KITTI.

    Example: `lidarlift fit-lasers my-scans --rings 32 --out my-scans/sensor.yaml`
    """
    import numpy as np

    from slam.data.atomic import write_text
    from slam.data.dataset import chosen_positions
    from slam.data.laser_lines import fit_dataset, sensor_text

    if out.exists():
        raise InputError(f"{out}: already exists; choose another --out, or move the file")
    require_writable(out.parent)
    data = reading.opened(dataset)
    positions = chosen_positions(data, frame_slice(frames))
    with progress(f"{data.name}: reading scans", len(positions)) as advance:
        lines, problems = fit_dataset(data, positions, rings, advance)
    for problem in problems:
        messages.print(f"Note: {problem.kind}: {problem.message}", style="yellow", markup=False)
    off = float(np.rad2deg(np.median(lines.residual)))
    if off > TYPICAL_RESIDUAL:
        text = f"median residual {off:.3f} deg; expected are raw scans, not motion-compensated ones"
        messages.print(f"Note: {data.path}: {text}", style="yellow", markup=False)
    name, correction = (data.sensor.name, data.sensor.vertical_correction) if data.sensor else (data.name, 0.0)
    write_text(out, sensor_text(lines, name, correction))
    print(_table(lines))
    print(f"Written to {out}")


def _table(lines: LaserLines) -> str:
    """One line per ring, top first, each figure with its standard error."""
    import numpy as np

    degrees = np.rad2deg([lines.elevation, lines.elevation_error, lines.residual])
    heading = "ring  elevation [deg]      +-  offset [mm]      +-  residual [deg]   points"
    rows = [
        f"{k:4d}  {degrees[0, k]:15.5f} {degrees[1, k]:7.5f}  {1e3 * lines.offset[k]:11.2f} "
        f"{1e3 * lines.offset_error[k]:7.3f}  {degrees[2, k]:14.4f}  {lines.points[k]:7d}"
        for k in range(len(lines.points))
    ]
    return "\n".join([heading, *rows])
