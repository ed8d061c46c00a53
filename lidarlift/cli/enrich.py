"""`lidarlift enrich`: enriched scans of a data set, as files."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.arguments import (
    ConfigOption,
    DatasetArgument,
    EnricherOption,
    FramesOption,
    frame_slice,
)
from lidarlift.cli.console import Console, progress
from lidarlift.cli.data_options import DataOptions, with_data_options
from lidarlift.enriching import enrich as enriched
from lidarlift.folders import require_apart
from lidarlift.reporting import note_problems
from slam.data.atomic import require_writable

if TYPE_CHECKING:
    from slam.data.cloud import PointCloud


class Format(StrEnum):
    """File format of the clouds."""

    BIN = "bin"
    PCD = "pcd"
    PLY = "ply"


@with_data_options
def enrich(
    dataset: DatasetArgument,
    out: Annotated[Path, typer.Option(help="Folder for the clouds, one file per scan, named by the scan's number.")],
    reading: DataOptions,
    format: Annotated[
        Format,
        typer.Option(help="bin: x y z intensity, as in KITTI; pcd and ply: also ring, time, sigma and measured."),
    ] = Format.PCD,
    enricher: EnricherOption = None,
    config: ConfigOption = None,
    set_: Annotated[list[str] | None, typer.Option("--set", help="One setting: front_end.coverage=0.8")] = None,
    frames: FramesOption = ":",
) -> None:
    """Write enriched scans: 16 measured rings and virtual beams, about 64 in total; each point has a sigma.

    Example: `lidarlift enrich kitti/sequences/04 --out enriched/04 --frames 0:10 --format ply`

    64-ring scans are reduced to every fourth ring (front_end.phase, front_end.ring_selection); scans of other sensors
    keep all rings. The clouds are neither deskewed nor vertically corrected.
    """
    from slam.data.images import found_in_reading

    data, chosen = reading.opened(dataset), frame_slice(frames)
    require_apart(out, data)
    require_writable(out)
    dense = enriched(data, enricher=enricher, config=config, overrides=set_ or (), frames=chosen)
    measured = total = done = empty = 0
    problems = [*data.problems]
    with progress(f"{data.name}, enriched", len(range(len(data))[chosen])) as advance:
        for frame, cloud in dense:
            problems.extend((*frame.problems, *found_in_reading(frame)))
            if len(cloud) and cloud.ring is not None:
                _write(out / f"{frame.index:06d}.{format.value}", cloud)
                done, measured, total = done + 1, measured + int(cloud.measured.sum()), total + len(cloud)
            else:
                empty += 1
            advance()
    note_problems(problems, Console(), "")
    print(
        f"{done} scans enriched: {measured // max(done, 1):,} measured points per scan, "
        f"{total // max(done, 1):,} with the predicted points"
    )
    if empty:
        print(f"{empty} scans were empty, damaged or not on the laser lines, and have no file")
    print(f"Written to {out}")


def _write(path: Path, cloud: PointCloud) -> None:
    """Write a cloud in the format of the file's suffix."""
    import numpy as np

    from slam.data.atomic import written_beside
    from slam.data.point_writer import write_points

    if path.suffix == ".bin":
        with written_beside(path) as temporary:
            np.column_stack([cloud.xyz, cloud.intensity]).astype("<f4").tofile(temporary)
    else:
        assert cloud.ring is not None
        time = {} if cloud.time is None else {"time": cloud.time}
        ring = cloud.ring.astype("uint16" if path.suffix == ".pcd" else "int32")  # Open3D drops 16 bits of a PLY
        fields = {"ring": ring, "sigma": cloud.sigma, "measured": cloud.measured}
        write_points(path, cloud, fields | time)
