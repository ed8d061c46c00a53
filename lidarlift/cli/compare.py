"""`lidarlift compare`: one sequence at 16 channels, enriched and at 64 channels."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.arguments import (
    ConfigOption,
    DatasetArgument,
    EnricherOption,
    FramesOption,
    SetOption,
    StrictOption,
    frame_slice,
)
from lidarlift.cli.console import Console
from lidarlift.cli.data_options import DataOptions, with_data_options
from lidarlift.comparing import available_inputs, compare_into, comparison_title, rows_for

if TYPE_CHECKING:
    from eval.compare import Comparison


@with_data_options
def compare(
    dataset: DatasetArgument,
    reading: DataOptions,
    enricher: EnricherOption = None,
    config: ConfigOption = None,
    set_: SetOption = None,
    frames: FramesOption = ":",
    out: Annotated[Path | None, typer.Option(help="The folder for the runs. Default: runs/NAME-compared.")] = None,
    strict: StrictOption = False,
) -> None:
    """Run a data set with 16 channels, with these enriched, and with 64, and compare: one run folder each.

    Example: `lidarlift compare kitti/sequences/04 --frames 0:50 --out runs/04`

    If the enricher is not ray-segment, ray-segment gets a row as well: it needs no training.
    """
    data = reading.opened(dataset)
    folder = out or Path("runs") / f"{data.name.lower().replace(' ', '-')}-compared"
    rows, chosen = rows_for(available_inputs(data), enricher, config, set_ or ()), frame_slice(frames)
    comparison = compare_into(folder, data, rows, chosen, Console(), strict=strict)
    print_comparison(comparison, comparison_title(data, rows, chosen), folder, rows)


def print_comparison(comparison: Comparison, title: str, folder: Path, rows: Iterable[str]) -> None:
    """Print the tables and the list of files that were written."""
    from eval.tables import format_comparison

    print(f"\n{title}\n")
    print(format_comparison(comparison))
    files = "map.pcd, map.png, trajectory_tum.txt (and _kitti), trajectory.png, loops.csv, metrics.json"
    for row in rows:
        print(f"{folder / row}: {files}")
    print(f"{folder / 'compare.json'}, {folder / 'compare.md'}: the tables above")
