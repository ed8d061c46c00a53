"""What a depth benchmark prints and draws."""

import cv2
import numpy as np

from eval.depth.metrics import PROTOCOL, evaluate
from eval.depth.plot import plot_risk_coverage
from eval.depth.tables import format_depth

TRUTH = np.linspace(2, 70, 200)


def report():
    """One method that knows its sigma, another that does not."""
    error, everywhere = np.linspace(0, 2, 200) ** 2, np.ones(200, bool)
    sure = evaluate(TRUTH, TRUTH + error, error + 0.1, everywhere)
    unsure = evaluate(TRUTH, TRUTH + 0.5, np.full(200, np.inf), everywhere)
    return {
        "knows": {"image": sure, "full": sure, "ms": 12.34},
        "knows-not": {"image": unsure, "full": unsure, "ms": 5.0},
        "about": {"title": "a drive", "protocol": PROTOCOL},
    }


def test_every_method_has_a_row_in_each_table():
    text = format_depth(report())
    rows = [line for line in text.splitlines() if line.startswith("knows-not ")]
    assert len(rows) == 4
    assert rows[0].split()[1:3] == ["500", "500"]
    assert "-" in rows[0].split()
    assert rows[0].split()[-1] == "5.0"
    assert "..." not in text.replace("k = 1..N", "")
    assert "AUSE: " in text


def test_columns_that_nobody_has_are_left_out():
    figures = {"images": 3, "coverage": 1.0, "mae_mm": 300.0, "rmse_mm": 1200.0, "imae": 1.0, "irmse": 3.0}
    text = format_depth({"method": {"image": figures, "ms": 1.0}, "about": {"protocol": {}}})
    assert "AUSE" not in text
    assert "1200" in text


def test_the_picture_is_whole(tmp_path):
    plot_risk_coverage(report(), tmp_path / "risk.png")
    assert cv2.imread(str(tmp_path / "risk.png")).shape[1] > 1000
    assert [path.name for path in tmp_path.iterdir()] == ["risk.png"]
