"""The report of runs and trajectories: report.html, figures as PNG and SVG, tables as Markdown and LaTeX."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path

from eval.report import results
from eval.report.chart import Chart
from eval.report.content import Report
from eval.report.draw import drawn, save
from eval.report.health import health_charts
from eval.report.map_view import map_controls, map_view
from eval.report.maps import figures_of, read_maps, thinned
from eval.report.page import Image, Section, page
from eval.report.pictures import Picture, maps_beside, on_dark, scan_from_above, scan_in_image
from eval.report.protocol import protocol, repeat
from eval.report.scan import read_scan
from eval.report.table import Table, latex, markdown
from eval.report.trajectories import trajectory_charts
from eval.report.verdict import verdict
from slam.data.atomic import write_text
from slam.data.plot_style import pixels

PAGE, FIGURES = "report.html", "figures"
#: Figures that not every report has.
MAYBE = ("error", "segments", "height", "scan", "image", "maps", "health", "timings")
PAGE_DPI = 110  # of pictures in the page


def write_report(folder: Path, report: Report) -> Path:
    """Write the report into a folder: report.html, and figures/ with each figure as PNG and SVG and the tables.

    Args:
        folder: The folder of a run or of a comparison.
        report: The content.

    Returns:
        The page.

    Raises:
        InputError: A file of a run is damaged, or the folder cannot be written.
    """
    maps = read_maps(report)
    some, share = thinned(maps)
    map_figures = {label: figures_of(points.xyz) for label, points in maps.items()}
    scans = {row.label: scan for row, run in report.runs if (scan := read_scan(run.folder))}
    scan_pictures = [scan_from_above(scans), scan_in_image(scans)] if scans else []
    map_pictures = [maps_beside(maps)] if maps else []
    charts = trajectory_charts(report)
    health, timings = health_charts(report)
    tables = [
        results.accuracy(report),
        results.paper_table(report),
        results.distance_table(report),
        results.map_table(report, map_figures),
        results.time_table(report),
        results.ledger(report),
    ]
    pictures = [picture for picture in (*scan_pictures, *map_pictures) if picture]
    _write_files(folder / FIGURES, [*charts, *health, *timings], pictures, [table for table in tables if table])
    images = {picture.key: _image(picture) for picture in pictures}
    accuracy, paper, distances, map_table, time_table, ledger = tables
    sections = [
        Section("results", "Results", _there(charts[0], accuracy, map_table)),
        Section("errors", "Errors" if report.truth else "Differences", _there(*charts[1:], paper, distances)),
        Section("scan-section", "One scan", _there(images.get("scan"), images.get("image"))),
        Section("maps-section", "Maps", _there(map_controls(some, share) if some else None, images.get("maps"))),
        Section("loops", "Loops", _there(ledger)),
        Section("frames", "Frames and time", _there(time_table, *health, *timings)),
        Section("protocol", "Protocol", [protocol(report)]),
        Section("repeat", "Repeat it", [repeat(report)]),
    ]
    view = map_view(report, some, share) if some else None
    write_text(folder / PAGE, page(report.title, verdict(report), sections, view))
    return folder / PAGE


def _there(*parts: Table | Chart | Image | str | None) -> list[Table | Chart | Image | str]:
    return [part for part in parts if part is not None]


def _write_files(folder: Path, charts: Sequence[Chart], pictures: Sequence[Picture], tables: Sequence[Table]) -> None:
    for name in MAYBE:  # of an earlier report; other files in the folder are the user's
        for suffix in (".png", ".svg"):
            (folder / f"{name}{suffix}").unlink(missing_ok=True)
    for chart in charts:
        save(drawn(chart), folder, chart.key)
    for picture in pictures:
        save(picture.figure, folder, picture.key)
    write_text(folder / "tables.md", "\n".join(map(markdown, tables)))
    write_text(folder / "tables.tex", "\n".join(map(latex, tables)))


def _image(picture: Picture) -> Image:
    """The picture on a dark ground, which suits both themes of the page."""
    from PIL import Image as Pillow
    from PIL import WebPImagePlugin  # noqa: F401  # else Pillow would import all its formats

    webp = BytesIO()
    image = Pillow.fromarray(pixels(on_dark(picture.figure), PAGE_DPI))
    image.save(webp, "WEBP", quality=82, method=2)
    data = f"data:image/webp;base64,{b64encode(webp.getvalue()).decode('ascii')}"
    return Image(picture.key, picture.title, picture.caption, picture.alt, data, image.size)
