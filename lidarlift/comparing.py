"""One drive at 16 channels, enriched and at 64, beside each other."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lidarlift.folders import require_apart
from lidarlift.front_ends import FEW_RINGS, TRAINING_FREE, input_name, opened, with_runnable_enricher
from lidarlift.reporting import Quiet, Reporter
from lidarlift.running import run_into
from slam.config import load_config
from slam.data.atomic import require_writable, write_text

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
    """Run SLAM over a data set with 16 channels, with these enriched, and with 64, and compare.

    Beside another enricher ray-segment, which learned nothing, has a row of its own.

    Args:
        dataset: An open data set; or a path that `open_dataset` takes, with `sequence` and `sensor`.
        out: The folder for a run folder each, compare.json and compare.md.
        sequence: Which sequence or drive, where the folder has several.
        sensor: The LiDAR's name or a YAML file with its beams, where the folder does not say.
        enricher: The method of enrichment; by default the settings'.
        config: A preset's name or a YAML file.
        overrides: Single settings, as in 'odometry.voxel_size=1.0'.
        frames: Positions in the data set, as in a list's slice.
        strict: Stop at the first damage in the data instead of going on.
        reporter: Where progress and notes go.

    Returns:
        The figures of each row: accuracy, loops, density, times.

    Raises:
        InputError: As `lidarlift.run`.
        ValueError: `sequence` or `sensor` is given for a data set that is open already.
    """
    data = opened(dataset, sequence, sensor)
    rows = rows_for(inputs_of(data), enricher, config, overrides)
    return compare_into(Path(out), data, rows, frames, reporter or Quiet(), strict=strict)


def inputs_of(data: Dataset) -> Sequence[str]:
    """The inputs that can be compared: a sensor of 16 rings or fewer has no 64, one of another number no 16."""
    rings = 64 if data.sensor is None else data.sensor.ring_count
    sixteen, full = rings <= FEW_RINGS or rings == 64, rings > FEW_RINGS
    return [name for name, there in zip(INPUTS, (sixteen, True, full), strict=True) if there]


def rows_for(
    inputs: Sequence[str],
    enricher: str | None = None,
    config: str | Path | None = None,
    overrides: Sequence[str] = (),
) -> dict[str, Config]:
    """The settings of each row: the inputs, and ray-segment before another enricher.

    Raises:
        InputError: As `load_config` and `with_runnable_enricher`.
    """
    rows = {}
    for channels in inputs:
        settings = with_runnable_enricher(load_config(config, overrides, input=channels, enricher=enricher))
        if channels == "enriched" and settings.front_end.enricher != TRAINING_FREE:
            rows[TRAINING_FREE] = load_config(config, overrides, input=channels, enricher=TRAINING_FREE)
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
) -> Comparison:
    """A run folder for each row, compare.json and compare.md beside them; `on_row` is called when a row is done.

    Raises:
        InputError: As `lidarlift.run`, and before any work where a folder cannot be written, or is the drive's own.
    """
    from eval.compare import compare_runs
    from eval.evaluation import write_json
    from eval.tables import comparison_markdown

    folders = {row: folder / row for row in rows}
    require_apart(folder, data)
    for each in folders.values():
        require_writable(each)
    for row, settings in rows.items():
        run_into(folders[row], data, settings, frames, reporter, name=name, strict=strict)
        if on_row:
            on_row(row)
    comparison = compare_runs(folders)
    write_json(folder / "compare.json", comparison.as_dict())
    write_text(folder / "compare.md", comparison_markdown(comparison, title_of(data, rows, frames, name)))
    return comparison


def title_of(data: Dataset, rows: Mapping[str, Config], frames: slice, name: str | None = None) -> str:
    """Of a comparison: the drive, how many frames, and what enriches."""
    return f"{name or data.name}, {len(range(len(data))[frames])} frames, {input_name(rows['enriched'])}"
