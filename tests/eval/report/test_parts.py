"""Parts of a report on small literal data: tables, verdict, charts, maps, the kept scan."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eval.report.chart import MOST, Curve, colours, shortened
from eval.report.content import report_of
from eval.report.maps import ALL, figures_of, sharpness, thinned
from eval.report.scan import Scan, read_scan, save_scan
from eval.report.table import Column, Table, html, latex, markdown
from eval.report.verdict import verdict
from slam.data.cloud import PointCloud
from slam.data.point_files import Points

TABLE = Table(
    "t",
    "Errors",
    "A note of 5 %.",
    [Column("Input"), Column("ATE", "m", 2, "least"), Column("Points")],
    [["a|b", 1.236, 12345], ["c_d", 0.5, None], ["e", float("nan"), 3]],
)


def test_a_table_in_markdown() -> None:
    lines = markdown(TABLE).splitlines()
    assert lines[2] == "| Input | ATE [m] | Points |"
    assert lines[4:7] == ["| a\\|b | 1.24 | 12,345 |", "| c_d | **0.50** | - |", "| e | - | 3 |"]


def test_a_table_in_latex() -> None:
    text = latex(TABLE)
    assert r"c\_d & \textbf{0.50} & - \\" in text
    assert r"A note of 5 \%." in text
    assert r"\begin{tabular}{lrr}" in text


def test_a_table_in_html_keeps_the_numbers_for_sorting() -> None:
    text = html(TABLE)
    assert '<td data-value="1.236">1.24</td>' in text
    assert "<strong>0.50</strong>" in text
    assert text.count("<td>-</td>") == 2


@pytest.mark.parametrize(
    ("lengths", "sentence"),
    [
        ({"16": 110.0, "enriched": 102.0, "64": 100.0}, "Enrichment lowers the ATE of 16 channels from 2.92 m to 58."),
        (
            {"16": 102.0, "enriched": 110.0},
            "Enrichment raises the ATE of 16 channels from 58.3 cm to 2.92 m (400 % ",
        ),
        (
            {"16": 102.0, "enriched": 102.01, "64": 100.0},
            "Enrichment hardly changes the ATE of 16 channels: 58.3 cm ",
        ),
        ({"mine": 102.0, "theirs": 101.0}, "theirs has the lowest ATE: 29.2 cm; mine 58.3 cm."),
        ({"16": 102.0}, "101 frames over 102.0 m with an ATE of 58.3 cm, 0.58 % of the path; drift 2.0"),
    ],
)
def test_the_verdict_has_the_figures(run_folder: Callable[..., Path], lengths: dict[str, float], sentence: str) -> None:
    folders = {label: run_folder(label, length) for label, length in lengths.items()}
    first, *others = verdict(report_of("Street", folders))
    assert first.startswith(sentence)
    assert others[-1].startswith("Frames that were not registered in all directions: ")
    assert "34 degenerate" in others[-1]


def test_without_ground_truth_the_verdict_calls_nothing_better(run_folder: Callable[..., Path]) -> None:
    folders = {
        label: run_folder(label, length, reference=None) for label, length in (("16", 110.0), ("enriched", 100.0))
    }
    assert "it cannot be said which input is more accurate" in verdict(report_of("Street", folders))[0]


def test_a_false_loop_is_counted(run_folder: Callable[..., Path]) -> None:
    folder = run_folder("16", 101.0)
    assert "1 loop, none of them false" in " ".join(verdict(report_of("Street", {"16": folder})))
    ledger = folder / "loops.csv"
    ledger.write_text(ledger.read_text().replace("accepted,,2,0,0", "accepted,,9,0,0"))
    assert "1 of them false" in " ".join(verdict(report_of("Street", {"16": folder})))


def test_known_inputs_have_their_own_colours() -> None:
    alone, together = colours(["64"]), colours(["a", "16", "64", "b", "enriched"])
    assert alone["64"] == together["64"]
    assert len(set(together.values())) == 5


@settings(max_examples=20)
@given(st.integers(0, 1000), st.integers(MOST + 1, 4 * MOST))
def test_a_shortened_curve_keeps_its_extremes(seed: int, count: int) -> None:
    y = np.random.default_rng(seed).normal(size=count)
    short = shortened(Curve(np.arange(len(y)), y, "a", "#000000"))
    assert len(short.x) <= MOST + 2
    assert (short.y.min(), short.y.max()) == (y.min(), y.max())
    assert (short.x[0], short.x[-1]) == (0, len(y) - 1)
    assert (np.diff(short.x) > 0).all()


def test_a_rough_plane_is_less_sharp() -> None:
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 10, (2, 4000))
    flat, rough = (sharpness(np.column_stack([x, y, rng.normal(0, sigma, 4000)])) for sigma in (0.01, 0.05))
    assert flat is not None
    assert rough is not None
    assert flat.thickness_m == pytest.approx(0.01, rel=0.2)
    assert rough.thickness_m == pytest.approx(0.05, rel=0.2)
    assert flat.entropy < rough.entropy


def test_sharpness_sees_all_neighbours() -> None:
    """Two planes 0.4 m apart: each point has neighbours on both."""
    x, y = (axis.ravel() for axis in np.mgrid[-2:2:0.1, -2:2:0.1])
    plane = np.column_stack([x, y, np.zeros(x.size)])
    found = sharpness(np.concatenate([plane, plane + np.array([0, 0, 0.4])]))
    assert found is not None
    assert 0.1 < found.thickness_m < 0.2


def test_density_is_per_occupied_square() -> None:
    corners = np.array([[0.5, 0.5, 0], [0.6, 0.5, 5], [10.5, 0.5, 0], [10.4, 0.5, 1]])
    figures = figures_of(corners)
    assert (figures.points, figures.density, figures.sharpness) == (4, 2.0, None)


def test_maps_are_thinned_to_the_same_share() -> None:
    sizes = {"16": 100_000, "64": 500_000}
    maps = {label: Points(np.zeros((n, 3), np.float32), np.zeros(n)) for label, n in sizes.items()}
    some, share = thinned(maps)
    kept = {label: len(points.xyz) for label, points in some.items()}
    assert sum(kept.values()) <= ALL
    for label, size in sizes.items():
        assert kept[label] == pytest.approx(share * size, abs=1)


def test_a_kept_scan_is_read_again(tmp_path: Path, cloud: Callable[..., PointCloud]) -> None:
    scan = Scan(7, cloud(10))
    save_scan(tmp_path, scan)
    read = read_scan(tmp_path)
    assert read is not None
    assert (read.number, read.image, read.calibration) == (7, None, None)
    np.testing.assert_array_equal(read.cloud.xyz, scan.cloud.xyz)
    np.testing.assert_array_equal(read.cloud.measured, scan.cloud.measured)
    assert read_scan(tmp_path / "elsewhere") is None
