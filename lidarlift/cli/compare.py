"""`lidarlift compare`: one drive at 16 channels, enriched and at 64, beside each other."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.arguments import (
    ColumnsOption,
    ConfigOption,
    DatasetArgument,
    EnricherOption,
    FramesOption,
    PointTimeOption,
    SensorOption,
    SequenceOption,
    SetOption,
    StampOption,
    StrictOption,
    frame_slice,
)
from lidarlift.cli.console import Console
from lidarlift.comparing import compare_into, inputs_of, rows_for, title_of

if TYPE_CHECKING:
    from eval.compare import Comparison


def compare(
    dataset: DatasetArgument,
    sequence: SequenceOption = None,
    enricher: EnricherOption = None,
    config: ConfigOption = None,
    set_: SetOption = None,
    frames: FramesOption = ":",
    sensor: SensorOption = None,
    stamp: StampOption = None,
    point_time: PointTimeOption = None,
    columns: ColumnsOption = None,
    out: Annotated[Path | None, typer.Option(help="The folder for the runs. Default: runs/NAME-compared.")] = None,
    strict: StrictOption = False,
) -> None:
    """Drive through a data set with 16 channels, with these enriched, and with 64, and compare: a run folder each.

    Example: `lidarlift compare kitti/sequences/04 --frames 0:50 --out runs/04`

    Beside another enricher ray-segment, which learned nothing, has a row of its own.
    """
    from slam.data.dataset import open_dataset

    said = {"stamp": stamp and stamp.value, "point_time": point_time, "columns": columns}
    data = open_dataset(dataset, sequence, sensor, **said)
    folder = out or Path("runs") / f"{data.name.lower().replace(' ', '-')}-compared"
    rows, chosen = rows_for(inputs_of(data), enricher, config, set_ or ()), frame_slice(frames)
    comparison = compare_into(folder, data, rows, chosen, Console(), strict=strict)
    print_comparison(comparison, title_of(data, rows, chosen), folder, rows)


def print_comparison(comparison: Comparison, title: str, folder: Path, rows: Iterable[str]) -> None:
    """The tables on stdout, and which files there are."""
    from eval.tables import format_comparison

    print(f"\n{title}\n")
    print(format_comparison(comparison))
    files = "map.pcd, map.png, trajectory_tum.txt (and _kitti), trajectory.png, loops.csv, metrics.json"
    for row in rows:
        print(f"{folder / row}: {files}")
    print(f"{folder / 'compare.json'}, {folder / 'compare.md'}: the tables above")
