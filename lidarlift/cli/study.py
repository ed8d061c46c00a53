"""`lidarlift study`: the paper's two studies, on any drive with a camera."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from lidarlift.cli.arguments import SequenceOption, frame_slice
from lidarlift.cli.console import messages, progress
from slam.data.atomic import require_writable
from slam.data.errors import InputError

if TYPE_CHECKING:
    from enrichment.studies.depth_image import DepthImage
    from enrichment.studies.figures import Figures
    from slam.data.dataset import Dataset

FRAMES = 20  # spread evenly over the drive, unless --frames says otherwise
SCAN, EXACT = "returns, filled in", "exact depth"

study = typer.Typer(
    no_args_is_help=True,
    help="""What depth images are like: how few frequencies they need, and what image edges say of them.

    Example: `lidarlift study sparsity 2011_09_26/2011_09_26_drive_0005_sync`
    """,
)
Drive = Annotated[Path, typer.Argument(help="A drive with a camera; of a simulated one the exact depth is used too.")]
Frames = Annotated[str | None, typer.Option(help=f"FROM:TO or FROM:TO:STEP. Default: {FRAMES} over the whole drive.")]
Out = Annotated[Path, typer.Option(help="The folder for figures and picture.")]

#: Column title, key, factor, decimals.
Columns = tuple[tuple[str, str, float, int], ...]
SPARSITY: Columns = (
    ("MAE\n[m]", "mae_m", 1, 3),
    ("RMSE\n[m]", "rmse_m", 1, 3),
    ("MAE at\njumps [m]", "mae_at_jumps_m", 1, 3),
    ("MAE else-\nwhere [m]", "mae_elsewhere_m", 1, 3),
    ("height\nkept [%]", "height_kept", 100, 1),
    ("preserved\n[%]", "preserved", 100, 1),
)
EDGES: Columns = (
    ("edge\npixels [%]", "edges", 100, 1),
    ("precision\n[%]", "precision", 100, 1),
    ("by\nchance", "precision_by_chance", 100, 1),
    ("recall\n[%]", "recall", 100, 1),
    ("by\nchance", "recall_by_chance", 100, 1),
)


@study.command()
def sparsity(
    dataset: Drive, sequence: SequenceOption = None, frames: Frames = None, out: Out = Path("runs/study-sparsity")
) -> None:
    """How much of a depth image few coefficients of its cosine transform keep, above all of its discontinuities.

    Example: `lidarlift study sparsity kitti/sequences/04 --frames ::5 --out runs/sparsity-04`
    """
    from enrichment.studies import pictures
    from enrichment.studies import sparsity as this

    found = _study(dataset, sequence, frames, out, this.sparsity)
    _report(found, "Coefficients kept", SPARSITY, this.PROTOCOL, out, pictures.draw_sparsity)


@study.command()
def edges(
    dataset: Drive, sequence: SequenceOption = None, frames: Frames = None, out: Out = Path("runs/study-edges")
) -> None:
    """How many edges of the image lie on depth discontinuities, and how many discontinuities have an edge.

    Example: `lidarlift study edges kitti/sequences/04 --frames ::5 --out runs/edges-04`
    """
    from enrichment.studies import edges as this
    from enrichment.studies import pictures

    found = _study(dataset, sequence, frames, out, this.edges)
    _report(found, "Edges, threshold", EDGES, this.PROTOCOL, out, pictures.draw_edges)


class _Found(NamedTuple):
    """Figures by the source of depth, the numbers of the frames, and one frame for the picture."""

    title: str
    sources: dict[str, Figures]
    numbers: list[int]
    shown: DepthImage


def _study(
    dataset: Path, sequence: str | None, frames: str | None, out: Path, function: Callable[[DepthImage], Figures]
) -> _Found:
    """A study's mean figures over the frames."""
    from enrichment.studies.depth_image import exact, of_scan
    from enrichment.studies.figures import mean_figures
    from slam.data.dataset import open_dataset

    require_writable(out)
    data = open_dataset(dataset, sequence)
    positions = _positions(data, frames)
    found: dict[str, list[Figures]] = {SCAN: [], EXACT: []}
    shown: DepthImage | None = None
    numbers, faults = list[int](), list[str]()
    with progress(data.name, len(positions)) as advance:
        for position in positions:
            try:
                image, window = of_scan(data[position])
            except InputError as error:
                faults.append(str(error))
            else:
                truth = exact(data.path, image, window)
                found[SCAN].append(function(image))
                found[EXACT] += [function(truth)] if truth else []
                numbers.append(image.number)
                shown = image if position <= positions[len(positions) // 2] or shown is None else shown
            advance()
    if shown is None:
        raise InputError(f"{data.path}: {faults[0]}")
    for fault in faults:
        messages.print(f"Note: left out: {fault}", style="yellow", markup=False)
    sources = {source: mean_figures(images) for source, images in found.items() if images}
    return _Found(f"{data.name}, {len(numbers)} frames", sources, numbers, shown)


def _positions(data: Dataset, frames: str | None) -> list[int]:
    """Which frames. Raises InputError where there are none."""
    every = range(len(data))
    chosen = every[:: -(-len(data) // FRAMES)] if frames is None else every[frame_slice(frames)]
    if not chosen:
        raise InputError(f"{data.path}: no frames in that range; the drive has {len(data)}, from 0")
    return list(chosen)


def _report(
    found: _Found, first: str, columns: Columns, protocol: dict[str, str], out: Path, draw: Callable[..., None]
) -> None:
    """study.json, study.png and the tables."""
    from eval.depth.tables import text_number, text_protocol, text_table
    from eval.evaluation import finite, write_json

    about = {"title": found.title, "frames": found.numbers, "shown": found.shown.number, "protocol": protocol}
    write_json(out / "study.json", {"about": about, **found.sources})
    draw(found.shown, found.sources, f"{found.title}; shown: {found.shown.number}", out / "study.png")
    print(found.title + "\n")
    for source, figures in finite(found.sources).items():
        rows = [
            [
                f"{tried} {_amount(amount)}",
                *(text_number(entry[key], factor, digits) for _, key, factor, digits in columns),
            ]
            for tried, amounts in figures.items()
            for amount, entry in amounts.items()
        ]
        print(text_table([f"{source}\n{first}", *(title for title, *_ in columns)], rows))
    print(text_protocol(protocol))
    print(f"Written to {out}: study.json, study.png")


def _amount(text: str) -> str:
    """0.25 as 1/4; thresholds as they are."""
    value = float(text)
    return f"1/{round(1 / value)}" if value < 1 else f"{value:g}"
