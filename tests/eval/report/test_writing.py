"""The files of a report: a page that needs nothing else, figures, tables."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from eval.report.content import Report, report_of
from eval.report.writing import write_report
from eval.runs import Row, Track

FIGURES = ("trajectory", "error", "segments", "height", "scan", "image", "maps", "health", "timings")
MOST_BYTES = 15e6


def test_every_figure_is_a_png_and_an_svg(written: Path) -> None:
    for name in FIGURES:
        assert (written / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert "<svg" in (written / "figures" / f"{name}.svg").read_text()
    assert "| 16 |" in (written / "figures" / "tables.md").read_text()
    assert r"\toprule" in (written / "figures" / "tables.tex").read_text()


def test_the_page_needs_nothing_from_elsewhere(written: Path) -> None:
    page = (written / "report.html").read_text()
    assert len(page) < MOST_BYTES
    outside = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.findall(r"""(?:src|href)=["'](?!data:|#)[^"']*""", outside)
    assert "@import" not in outside
    assert "url(" not in outside


def test_names_are_text_in_the_page(written: Path) -> None:
    page = (written / "report.html").read_text()
    assert "Street &lt;1&gt;" in page
    assert "<b>&" not in page
    assert "lidarlift compare street" in page


def test_the_page_has_all_sections(written: Path) -> None:
    page = (written / "report.html").read_text()
    for section in ("verdict", "results", "errors", "scan-section", "maps-section", "loops", "frames", "protocol"):
        assert f'<section id="{section}"' in page
    assert len(re.findall(r"<img[^>]* alt=\"[^\"]+\"", page)) == 3
    assert page.count('class="chart"') == page.count('role="img" aria-label="') - 1  # and the 3-D view


def test_a_run_without_ground_truth(run_folder: Callable[..., Path]) -> None:
    folder = run_folder("16", 101.0, reference=None)
    page = write_report(folder, report_of("Street", {"16": folder})).read_text()
    assert "no ground truth" in page
    assert "Accuracy against" not in page
    assert (folder / "figures" / "height.png").exists()


def test_figures_of_an_earlier_report_are_removed(run_folder: Callable[..., Path]) -> None:
    folder = run_folder("16", 101.0)
    (folder / "figures").mkdir()
    for name in ("image.png", "mine.png"):
        (folder / "figures" / name).write_bytes(b"of another run")
    write_report(folder, report_of("Street", {"16": folder}))
    assert not (folder / "figures" / "image.png").exists()
    assert (folder / "figures" / "mine.png").exists()  # the user's


def test_a_single_pose(tmp_path: Path) -> None:
    page = write_report(tmp_path, Report("One", [Row("mine", Track(np.eye(4)[None]))])).read_text()
    assert "1 frame over 0.0 m" in page


def test_a_sensor_that_stood(tmp_path: Path) -> None:
    still = Track(np.tile(np.eye(4), (5, 1, 1)), np.arange(5.0))
    page = write_report(tmp_path, Report("Still", [Row("a", still), Row("b", still)])).read_text()
    assert "b 0.0 cm" in page


def test_trajectories_without_common_instants(tmp_path: Path) -> None:
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, 0, 3] = range(5)
    rows = [Row("a", Track(poses, np.arange(5.0))), Row("b", Track(poses, np.arange(5.0) + 100))]
    assert "no common instants" in write_report(tmp_path, Report("Two", rows)).read_text()


@pytest.mark.parametrize("name", ["map.pcd", "scan.npz"])
def test_a_damaged_file_is_named(run_folder: Callable[..., Path], name: str) -> None:
    from slam.data.errors import InputError

    folder = run_folder("16", 101.0)
    (folder / name).write_bytes(b"no such file")
    with pytest.raises(InputError, match=name):
        write_report(folder, report_of("Street", {"16": folder}))
