"""Comparison of run folders."""

import json

import numpy as np
import pytest

from eval.compare import compare_runs
from eval.evaluation import write_json
from eval.tables import COMPARISON_COLUMNS, comparison_markdown, format_comparison
from slam.data.errors import InputError


def test_comparison_has_the_figures_of_each_input(run_folder):
    comparison = compare_runs({"16": run_folder("a", 101.0, failed=2), "64": run_folder("b", 100.0)})
    sixteen, sixty_four = comparison.inputs["16"], comparison.inputs["64"]
    assert sixteen.ate_m == pytest.approx(0.01 * np.std(np.linspace(0, 100, 101)), abs=1e-6)
    assert sixteen.rpe_m == pytest.approx(0.01)
    assert sixteen.drift_percent == pytest.approx(1.0, rel=0.03)
    assert sixteen.drift_name == "short drive, 50 m"
    assert (sixteen.frames, sixteen.failed, sixteen.loops, sixteen.path_m) == (101, 2, 7, 101.0)
    assert (sixteen.map_points, sixteen.points_per_scan) == (1_234_567, 10_000)
    assert (sixteen.front_end_ms, sixteen.odometry_ms) == (1.25, 12.5)
    assert sixteen.to_full_m == pytest.approx(sixteen.ate_m, abs=1e-6)
    assert sixteen.table_iii_m.mean == pytest.approx(0.01)
    assert sixty_four.to_full_m is None
    assert (sixty_four.ate_m, sixty_four.failed) == (pytest.approx(0, abs=1e-9), 0)


def test_notes_of_a_run_are_kept(run_folder):
    comparison = compare_runs({"16": run_folder("a", 101.0, notes=["3 of 101 frames degenerate"])})
    assert "3 of 101 frames degenerate" in comparison.inputs["16"].notes
    assert "16: 3 of 101 frames degenerate" in format_comparison(comparison)


def test_compare_json_keeps_its_keys(run_folder, tmp_path):
    comparison = compare_runs({"16": run_folder("a", 101.0), "64": run_folder("b", 100.0)})
    write_json(tmp_path / "compare.json", comparison.as_dict())
    content = json.loads((tmp_path / "compare.json").read_text())
    assert list(content) == ["inputs", "protocol"]
    assert list(content["inputs"]) == ["16", "64"]
    for figures in content["inputs"].values():
        assert list(figures) == [
            "ate_m", "table_iii_m", "rpe_m", "rpe_deg", "drift_percent", "drift_deg_per_100m", "drift_name", "notes",
            "path_m", "frames", "failed", "loops", "map_points", "points_per_scan", "front_end_ms", "odometry_ms",
            "to_full_m",
        ]  # fmt: skip
        assert list(figures["table_iii_m"]) == ["rmse", "mean", "median", "std", "min", "max", "sse"]
    assert content["inputs"]["64"]["to_full_m"] is None


def test_the_table_has_a_row_per_input(run_folder):
    folders = {"16": run_folder("a", 101.0, failed=2), "enriched": run_folder("b", 100.0)}
    text = format_comparison(compare_runs(folders))
    above, below, _, sixteen, enriched = text.splitlines()[:5]
    words = " ".join(title for title, _, _ in COMPARISON_COLUMNS).split()
    assert sorted([*above.split(), *below.split()]) == sorted(["Input", *words])
    assert sixteen.split()[0] == "16"
    assert sixteen.split()[-8:] == ["101.0", "101", "2", "7", "1,234,567", "10,000", "1.2", "12.5"]
    assert enriched.split()[:3] == ["enriched", "0.000", "0.0000"]
    assert "ATE after SE(3) Umeyama alignment" in text
    assert "drift: KITTI devkit's odometry metric, no alignment; short drive, 50 m" in text
    assert "16: " in text.partition("Notes")[2]  # on a line the alignment is not unique


def test_without_ground_truth_accuracy_is_missing(run_folder):
    comparison = compare_runs({"64": run_folder("a", 100.0, reference=None)})
    assert comparison.inputs["64"].ate_m is None
    row = format_comparison(comparison).splitlines()[3]
    assert row.split() == ["64", *6 * ["-"], "100.0", "101", "0", "7", "1,234,567", "10,000", "1.2", "12.5"]
    assert "64: no ground truth" in format_comparison(comparison)


def test_a_short_sequence_has_no_drift(run_folder):
    comparison = compare_runs({"64": run_folder("a", 5.0, reference=5.0)})
    figures = comparison.inputs["64"]
    assert figures.drift_percent is None
    assert figures.ate_m is not None
    assert "64: no drift, the reference path of 5.0 m" in format_comparison(comparison)


def test_markdown_has_the_same_tables(run_folder):
    comparison = compare_runs({"16": run_folder("a", 101.0), "64": run_folder("b", 100.0)})
    lines = comparison_markdown(comparison, "A drive").splitlines()
    assert lines[0] == "# A drive"
    header, sixteen = lines[2], next(line for line in lines if line.startswith("| 16 |"))
    assert header.count("|") == sixteen.count("|") == len(COMPARISON_COLUMNS) + 2
    assert "| 16 | 0.010 | 0.010 | 0.010 | 0.010 | 0.000 |" in lines  # Table III: max, mean, min, rmse, std


@pytest.mark.parametrize("file", ["run.json", "metrics.json", "timings.csv"])
@pytest.mark.parametrize("content", ["", "[]", "{}"])
def test_an_incomplete_run_is_an_error(run_folder, file, content):
    folder = run_folder("a", 100.0)
    (folder / file).write_text(content)
    with pytest.raises(InputError, match="not a complete run"):
        compare_runs({"64": folder})


@pytest.mark.parametrize("file", ["run.json", "timings.csv"])
def test_a_missing_file_of_a_run_is_an_error(run_folder, file):
    folder = run_folder("a", 100.0)
    (folder / file).unlink()
    with pytest.raises(InputError, match=file):
        compare_runs({"64": folder})
