"""`lidarlift enrich`: a drive's scans with what lies between their rings filled in."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.arguments import (
    ColumnsOption,
    ConfigOption,
    DatasetArgument,
    EnricherOption,
    FramesOption,
    SensorOption,
    SequenceOption,
    frame_slice,
)
from lidarlift.cli.console import Console, progress
from lidarlift.enriching import enrich as enriched
from lidarlift.folders import require_apart
from lidarlift.reporting import note_problems
from slam.data.atomic import require_writable

if TYPE_CHECKING:
    from slam.data.cloud import PointCloud


class Format(StrEnum):
    BIN = "bin"
    PCD = "pcd"
    PLY = "ply"


def enrich(
    dataset: DatasetArgument,
    out: Annotated[Path, typer.Option(help="The folder for the clouds, one a scan, named as the scans are numbered.")],
    sequence: SequenceOption = None,
    format: Annotated[
        Format,
        typer.Option(help="bin: x y z intensity, as KITTI; pcd and ply: also ring, time, sigma and measured."),
    ] = Format.PCD,
    enricher: EnricherOption = None,
    config: ConfigOption = None,
    set_: Annotated[list[str] | None, typer.Option("--set", help="One setting: front_end.coverage=0.8")] = None,
    frames: FramesOption = ":",
    sensor: SensorOption = None,
    columns: ColumnsOption = None,
) -> None:
    """Write the scans of 16 rings, with the rest of about 64 filled in; each point with its sigma.

    Example: `lidarlift enrich kitti/sequences/04 --out enriched/04 --frames 0:10 --format ply`

    Of 64-ring scans every fourth ring is taken (front_end.phase, front_end.drop); of other sensors all. The clouds are
    as recorded: neither deskewed nor vertically corrected.
    """
    from slam.data.dataset import open_dataset
    from slam.data.images import found_in_reading

    data, chosen = open_dataset(dataset, sequence, sensor, columns=columns), frame_slice(frames)
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
    print(f"{done} scans: {measured // max(done, 1):,} measured points a scan became {total // max(done, 1):,}")
    if empty:
        print(f"{empty} scans were empty, damaged or off the laser lines, and have no file")
    print(f"Written to {out}")


def _write(path: Path, cloud: PointCloud) -> None:
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
