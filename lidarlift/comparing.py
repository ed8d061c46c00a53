"""Comparison of one sequence at 16 channels, enriched and at 64 channels."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lidarlift.folders import require_apart
from lidarlift.front_ends import (
    FEW_RINGS,
    TRAINING_FREE,
    input_name,
    opened,
    recorded_input,
    why_not_enriched,
    with_runnable_enricher,
)
from lidarlift.reporting import Quiet, Reporter
from lidarlift.reports import report_runs
from lidarlift.running import run_into
from slam.data.atomic import require_no_links, require_writable, write_text

if TYPE_CHECKING:
    from eval.compare import Comparison
    from slam.data.dataset import Dataset
    from slam.settings import Config

INPUTS = ("16", "enriched", "64")


def compare(
    dataset: Dataset | str | Path,
    out: str | Path,
    *,
    sequence: str | None = None,
    sensor: str | Path | None = None,
    enricher: str | None = None,
    config: str | Path | None = None,
    overrides: Sequence[str] = (),
    frames: slice = slice(None),
    strict: bool = False,
    reporter: Reporter | None = None,
) -> Comparison:
    """Run SLAM on a data set with 16 channels, with these enriched, and with 64, and compare the results.

    If the enricher is not ray-segment, ray-segment gets a row as well: it needs no training.

    Args:
        dataset: An open data set; or a path that `open_dataset` takes, with `sequence` and `sensor`.
        out: The folder for a run folder each, compare.json, compare.md and report.html.
        sequence: Name of the sequence, if the folder has several.
        sensor: Name of the LiDAR or a YAML file with its beams, if the folder does not say.
        enricher: The enrichment method; by default that of the settings.
        config: A preset's name or a YAML file.
        overrides: Single settings, as in 'odometry.voxel_size=1.0'.
        frames: Positions in the data set, as a slice of a list.
        strict: Stop at the first problem in the data instead of skipping it.
        reporter: Receives progress and notes.

    Returns:
        The figures of each row: accuracy, loop closures, density, run times.

    Raises:
        InputError: As `lidarlift.run`.
        ValueError: `sequence` or `sensor` is given for a data set that is already open.
    """
    data = opened(dataset, sequence, sensor)
    rows = rows_for(available_inputs(data), enricher, config, overrides)
    return compare_into(Path(out), data, rows, frames, reporter or Quiet(), strict=strict)


def available_inputs(data: Dataset) -> Sequence[str]:
    """Return the inputs that can be compared, named by what they are: 16, enriched, and 64 or full.

    A LiDAR of 16 rings or fewer has no sparser input, one without rings only the full scan; without laser lines scans
    are not enriched.
    """
    from slam.data.dataset import ring_count

    rings = ring_count(data)
    if rings is None:
        return ["full"]
    sparse, *dense = [*(["16"] if rings > FEW_RINGS else []), recorded_input(rings)]
    return [sparse, *(["enriched"] if data.sensor else []), *dense]


def rows_for(
    inputs: Sequence[str],
    enricher: str | None = None,
    config: str | Path | None = None,
    overrides: Sequence[str] = (),
) -> dict[str, Config]:
    """Return the settings of each row: one row per input, and ray-segment before any other enricher.

    Enriched are 16 rings, those of row 16, of a LiDAR with any number of rings.

    Raises:
        InputError: As `load_config` and `with_runnable_enricher`.
    """
    from slam.config import load_config  # pydantic takes a while to import

    rings = load_config(config, overrides).front_end.enriched_rings or FEW_RINGS
    rows = {}
    for channels in inputs:
        chosen = {"input": channels, "enriched_rings": rings if channels == "enriched" else None}
        settings = with_runnable_enricher(load_config(config, overrides, enricher=enricher, **chosen))
        if channels == "enriched" and settings.front_end.enricher != TRAINING_FREE:
            rows[TRAINING_FREE] = load_config(config, overrides, enricher=TRAINING_FREE, **chosen)
        rows[channels] = settings
    return rows


def compare_into(
    folder: Path,
    data: Dataset,
    rows: Mapping[str, Config],
    frames: slice,
    reporter: Reporter,
    *,
    name: str | None = None,
    strict: bool = False,
    on_row: Callable[[str], None] | None = None,
    command: str | None = None,
) -> Comparison:
    """Write a run folder for each row, with compare.json, compare.md and the report.

    `on_row` is called when a row is done; `command` is the command line that repeats the comparison, for the report.

    Raises:
        InputError: As `lidarlift.run`. A folder that cannot be written, or is the data set's own, is reported
                before any work.
    """
    from eval.compare import compare_runs
    from eval.evaluation import write_json
    from eval.report.writing import FIGURES
    from eval.tables import comparison_markdown

    folders = {row: folder / row for row in rows}
    require_apart(folder, data)
    require_no_links(folder, (*rows, FIGURES))
    for each in folders.values():
        require_writable(each)
    for row, settings in rows.items():
        run_into(folders[row], data, settings, frames, reporter, name=name, strict=strict, report=False)
        if on_row:
            on_row(row)
    comparison = compare_runs(folders)
    write_json(folder / "compare.json", comparison.as_dict())
    title = comparison_title(data, rows, frames, name)
    write_text(folder / "compare.md", comparison_markdown(comparison, title))
    report_runs(folder, title, folders, command)
    return comparison


def comparison_title(data: Dataset, rows: Mapping[str, Config], frames: slice, name: str | None = None) -> str:
    """Return the title of a comparison: the sequence, the number of frames, and the enricher or why there is none."""
    from slam.data.dataset import ring_count

    reason = why_not_enriched(data.sensor, ring_count(data))
    enriched = input_name(rows["enriched"]) if "enriched" in rows else f"not enriched: {reason}"
    return f"{name or data.name}, {len(range(len(data))[frames])} frames, {enriched}"
