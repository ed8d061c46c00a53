"""Tables and figures of a depth benchmark."""

import cv2
import numpy as np

from eval.depth.maps import DepthMapFigures
from eval.depth.metrics import PROTOCOL, range_figures
from eval.depth.plot import plot_risk_coverage
from eval.depth.report import AboutDepthMaps, AboutSequence, DepthReport, MethodReport
from eval.depth.tables import format_report

TRUTH = np.linspace(2, 70, 200)


def report():
    """One method that knows its sigma, another that does not."""
    error, everywhere = np.linspace(0, 2, 200) ** 2, np.ones(200, bool)
    sure = range_figures(TRUTH, TRUTH + error, error + 0.1, everywhere)
    unsure = range_figures(TRUTH, TRUTH + 0.5, np.full(200, np.inf), everywhere)
    return DepthReport(
        methods={"knows": MethodReport(12.34, sure, sure, 1000), "knows-not": MethodReport(5.0, unsure, unsure)},
        about=AboutSequence("a drive", "KITTI raw 0005", (3, 4), (4,), "hdl64", 4, 0, 2000, PROTOCOL),
    )


def test_every_method_has_a_row_in_each_table():
    text = format_report(report())
    rows = [line for line in text.splitlines() if line.startswith("knows-not ")]
    assert len(rows) == 4
    assert rows[0].split()[1:3] == ["500", "500"]
    assert "-" in rows[0].split()
    assert rows[0].split()[-2:] == ["5.0", "-"]
    assert "..." not in text.replace("k = 1..N", "")
    assert "AUSE: " in text


def test_empty_columns_are_left_out():
    figures = DepthMapFigures(images=3, coverage=1.0, mae_mm=300.0, rmse_mm=1200.0, imae=1.0, irmse=3.0)
    text = format_report(DepthReport({"method": MethodReport(1.0, figures)}, AboutDepthMaps("three", (), {})))
    assert "AUSE" not in text
    assert "1200" in text


def test_the_risk_coverage_plot_is_written(tmp_path):
    plot_risk_coverage(report(), tmp_path / "risk.png")
    assert cv2.imread(str(tmp_path / "risk.png")).shape[1] > 1000
    assert [path.name for path in tmp_path.iterdir()] == ["risk.png"]


def test_depth_json_keeps_its_keys():
    """Other programs read this file."""
    content = report().as_dict()
    assert list(content) == ["knows", "knows-not", "about"]
    assert list(content["knows"]) == ["image", "full", "ms", "parameters"]
    assert list(content["knows-not"]) == ["image", "full", "ms"]
    errors = ["mae_mm", "rmse_mm", "imae", "irmse", "median_mm", "worse_0.3m", "worse_1m"]
    full = content["knows"]["full"]
    assert list(full) == [
        "returns", "coverage", *errors, "trusted", "ause_mm", "calibration", "at_80", "risk_coverage", "bands",
    ]  # fmt: skip
    assert list(full["trusted"]) == list(full["bands"]["0-10"]) == ["returns", "coverage", *errors]
    assert list(full["at_80"]) == errors
    assert list(full["risk_coverage"]) == ["coverage", "mae_mm", "oracle_mm"]
    assert list(content["about"]) == [
        "title", "dataset", "frames", "frames_left_out", "sensor", "ring_step", "phase", "columns", "protocol",
    ]  # fmt: skip


def test_depth_json_of_depth_maps_keeps_its_keys():
    figures = DepthMapFigures(images=3, coverage=1.0, mae_mm=300.0, rmse_mm=1200.0, imae=1.0, irmse=3.0)
    content = DepthReport({"method": MethodReport(1.0, figures)}, AboutDepthMaps("three", ("a.png",), {})).as_dict()
    assert list(content["method"]) == ["image", "ms"]
    assert list(content["method"]["image"]) == ["images", "coverage", "mae_mm", "rmse_mm", "imae", "irmse"]
    assert list(content["about"]) == ["title", "images", "protocol"]
