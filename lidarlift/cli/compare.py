"""`lidarlift compare`: one drive at 16 channels, enriched and at 64, beside each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lidarlift.cli.arguments import EnricherOption, frame_slice, require_writable
from lidarlift.running import input_name, run_into
from slam.config import load_config, preset_names

if TYPE_CHECKING:
    from slam.data.dataset import Dataset
    from slam.settings import Config

INPUTS = ("16", "enriched", "64")
TRAINING_FREE = "ray-segment"  # an enricher, and its row


def compare(
    dataset: Annotated[Path, typer.Argument(help="A KITTI odometry or raw folder, or a folder of scans.")],
    sequence: Annotated[str | None, typer.Option(help="Which sequence or drive, where the folder has several.")] = None,
    enricher: EnricherOption = None,
    config: Annotated[str | None, typer.Option(help=f"A YAML file or a preset: {', '.join(preset_names())}.")] = None,
    set_: Annotated[list[str] | None, typer.Option("--set", help="One setting: odometry.voxel_size=1.0")] = None,
    frames: Annotated[str, typer.Option(help="A slice of the drive, FROM:TO or FROM:TO:STEP.")] = ":",
    sensor: Annotated[str | None, typer.Option(help="hdl64, vlp16 or a YAML file with the beams.")] = None,
    out: Annotated[Path | None, typer.Option(help="The folder for the runs. Default: runs/NAME-compared.")] = None,
    strict: Annotated[
        bool, typer.Option("--strict", help="Stop at the first damaged file instead of going on.")
    ] = False,
) -> None:
    """Drive through a data set with 16 channels, with these enriched, and with 64, and compare: a run folder each.

    Example: `lidarlift compare kitti/sequences/04 --frames 0:50 --out runs/04`

    Beside another enricher ray-segment, which learned nothing, has a row of its own.
    """
    from slam.data.dataset import open_dataset

    data = open_dataset(dataset, sequence, sensor)
    folder = out or Path("runs") / f"{data.name.lower().replace(' ', '-')}-compared"

    rows = rows_for(inputs_of(data), enricher, config, set_ or ())
    compare_into(folder, data, rows, frame_slice(frames), strict=strict)


def inputs_of(data: Dataset) -> Sequence[str]:
    """What there is to compare: a sensor of 16 rings or fewer has no 64, one of another number no 16."""
    rings = 64 if data.sensor is None else data.sensor.ring_count
    return [name for name in INPUTS if name == "enriched" or (name == "16" and rings in (*range(17), 64)) or rings > 16]


def rows_for(
    inputs: Sequence[str], enricher: str | None = None, source: str | None = None, overrides: Sequence[str] = ()
) -> dict[str, Config]:
    """The configuration of each row: the inputs, and ray-segment before another enricher, if that can run here.

    Raises InputError as `load_config` and, on the enricher's name, `Registry.load` do.
    """
    from enrichment.methods.registry import METHODS, runnable

    rows = {}
    for channels in inputs:
        settings = load_config(source, overrides, input=channels, enricher=enricher)
        if channels == "enriched":
            METHODS.load(settings.front_end.enricher)  # a wrong name is refused before the first row is run
            if settings.front_end.enricher in set(runnable()) - {TRAINING_FREE}:
                rows[TRAINING_FREE] = load_config(source, overrides, input=channels, enricher=TRAINING_FREE)
        rows[channels] = settings
    return rows


def compare_into(
    folder: Path,
    data: Dataset,
    rows: Mapping[str, Config],
    frames: slice = slice(None),
    *,
    name: str | None = None,
    strict: bool = False,
) -> dict[str, Any]:
    """A run folder for each row, compare.json and compare.md beside them, and the table on stdout.

    Raises InputError as `run_into` does, and before any work where a folder cannot be written.
    """
    from eval.compare import compare_runs
    from eval.evaluation import write_json
    from eval.tables import comparison_markdown, format_comparison
    from slam.data.atomic import write_text

    folders = {row: folder / row for row in rows}
    for each in folders.values():
        require_writable(each)
    for row, settings in rows.items():
        run_into(folders[row], data, settings, frames, name=name, strict=strict)
    comparison = compare_runs(folders)
    write_json(folder / "compare.json", comparison)
    title = f"{name or data.name}, {len(range(len(data))[frames])} frames, {input_name(rows['enriched'])}"
    write_text(folder / "compare.md", comparison_markdown(comparison, title))
    print(f"\n{title}\n")
    print(format_comparison(comparison))
    for each in folders.values():
        print(f"{each}: map.pcd, map.png, trajectory_tum.txt (and _kitti), trajectory.png, loops.csv, metrics.json")
    print(f"{folder / 'compare.json'}, {folder / 'compare.md'}: the tables above")
    return comparison
