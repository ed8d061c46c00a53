"""`lidarlift study`: the paper's two studies, on any sequence with a camera."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarlift.cli.arguments import frame_slice
from lidarlift.cli.console import messages, progress
from lidarlift.cli.data_options import DataOptions, with_data_options
from slam.data.atomic import require_writable

if TYPE_CHECKING:
    from enrichment.studies.depth_image import DepthImage
    from enrichment.studies.figures import F, Figures
    from lidarlift.studies import StudyReport

FRAMES = 20  # default number of frames, evenly spaced

study = typer.Typer(
    no_args_is_help=True,
    help="""Study depth images: how sparse they are in frequency, and how image edges predict their discontinuities.

    Example: `lidarlift study sparsity 2011_09_26/2011_09_26_drive_0005_sync`
    """,
)
Drive = Annotated[
    Path, typer.Argument(help="A sequence with a camera; the exact depth of a simulated one is studied too.")
]
Frames = Annotated[str | None, typer.Option(help=f"FROM:TO or FROM:TO:STEP. Default: {FRAMES} frames, evenly spaced.")]
Out = Annotated[Path, typer.Option(help="Folder for the results and the figure.")]

#: Column title, attribute of the figures, factor, decimals.
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
@with_data_options
def sparsity(
    dataset: Drive, reading: DataOptions, frames: Frames = None, out: Out = Path("runs/study-sparsity")
) -> None:
    """Measure what few coefficients of the cosine transform preserve of a depth image and of its discontinuities.

    Example: `lidarlift study sparsity kitti/sequences/04 --frames ::5 --out runs/sparsity-04`
    """
    from enrichment.studies import pictures
    from enrichment.studies import sparsity as this

    report = _studied(dataset, reading, frames, out, this.sparsity, this.PROTOCOL)
    _write(report, "Coefficients kept", SPARSITY, out, pictures.draw_sparsity)


@study.command()
@with_data_options
def edges(dataset: Drive, reading: DataOptions, frames: Frames = None, out: Out = Path("runs/study-edges")) -> None:
    """Measure how many image edges lie on depth discontinuities, and how many discontinuities have an image edge.

    Example: `lidarlift study edges kitti/sequences/04 --frames ::5 --out runs/edges-04`
    """
    from enrichment.studies import edges as this
    from enrichment.studies import pictures

    report = _studied(dataset, reading, frames, out, this.edges, this.PROTOCOL)
    _write(report, "Edges, threshold", EDGES, out, pictures.draw_edges)


def _studied(
    dataset: Path,
    reading: DataOptions,
    frames: str | None,
    out: Path,
    study: Callable[[DepthImage], Figures[F]],
    protocol: Mapping[str, str],
) -> StudyReport[F]:
    from lidarlift.studies import study_sequence
    from slam.data.dataset import chosen_positions

    require_writable(out)
    data = reading.opened(dataset)
    chosen = frame_slice(frames) if frames else slice(None, None, -(-len(data) // FRAMES))
    with progress(data.name, len(chosen_positions(data, chosen))) as advance:
        report = study_sequence(data, study, protocol, chosen, advance)
    for fault in report.left_out:
        messages.print(f"Note: left out: {fault}", style="yellow", markup=False)
    return report


def _write(report: StudyReport[F], first: str, columns: Columns, out: Path, draw: Callable[..., None]) -> None:
    """Write study.json and study.png, and print the tables."""
    from eval.evaluation import write_json
    from eval.text import number, protocol_text, text_table

    write_json(out / "study.json", report.as_dict())
    draw(report.shown, report.sources, f"{report.title}; shown: {report.shown.number}", out / "study.png")
    print(report.title + "\n")
    for source, figures in report.sources.items():
        rows = [
            [
                f"{tried} {_amount(amount)}",
                *(number(getattr(entry, name), decimals, factor) for _, name, factor, decimals in columns),
            ]
            for tried, amounts in figures.items()
            for amount, entry in amounts.items()
        ]
        print(text_table([f"{source}\n{first}", *(title for title, *_ in columns)], rows))
    print(protocol_text(report.protocol))
    print(f"Written to {out}: study.json, study.png")


def _amount(value: float) -> str:
    """Format 0.25 as 1/4, and thresholds unchanged."""
    return f"1/{round(1 / value)}" if value < 1 else f"{value:g}"
