"""Drawings: shapes become pixels and SVG, axes have round ticks."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest

from slam.data.drawing.axes import Axes, Scale, equal_scales, mark
from slam.data.drawing.colours import colours_of
from slam.data.drawing.from_above import highest_last
from slam.data.drawing.raster import pixels, save_png
from slam.data.drawing.shapes import Area, Box, Drawing, Line, Picture, Shape, Text
from slam.data.drawing.svg import svg

BOX = Box(10, 10, 50, 30)
ACROSS = np.array([[0.0, 20.0], [60.0, 20.0]])


def drawn(*shapes: Shape) -> np.ndarray:
    return pixels(Drawing(60, 40, list(shapes)))


def red(image: np.ndarray) -> np.ndarray:
    """Where there is more red than blue."""
    return image[..., 0].astype(int) - image[..., 2] > 100


@pytest.mark.parametrize(
    ("low", "high", "labels"),
    [
        (0.0, 10.0, ["0", "2", "4", "6", "8", "10"]),
        (-0.3, 0.31, ["\N{MINUS SIGN}0.2", "0.0", "0.2"]),
        (0.0, 1.1, ["0.00", "0.25", "0.50", "0.75", "1.00"]),
        (1999.0, 2001.0, ["1999.0", "1999.5", "2000.0", "2000.5", "2001.0"]),
    ],
)
def test_ticks_are_round(low: float, high: float, labels: list[str]) -> None:
    assert [label for _, label in Scale(low, high).ticks(5)] == labels


def test_ticks_of_a_logarithmic_axis() -> None:
    assert [label for _, label in Scale(40, 2100, log=True).ticks(8)] == ["50", "100", "200", "500", "1000", "2000"]
    assert [label for _, label in Scale(1e-3, 1e5, log=True).ticks(5)] == ["0.001", "0.1", "10", "1000", "100000"]


@pytest.mark.parametrize("values", [[], [np.nan], [3.0], [0.0, 0.0], [-2.0, np.nan, 4.0]])
@pytest.mark.parametrize("log", [False, True])
def test_a_scale_has_an_extent(values: list[float], log: bool) -> None:
    scale = Scale.around(np.array(values), log=log)
    assert scale.high > scale.low
    assert len(scale.ticks(5)) < 20


def test_equal_scales_fill_the_box() -> None:
    axes = equal_scales(Box(0, 0, 200, 100), Scale(0, 10), Scale(0, 10))
    assert (axes.y.low, axes.y.high) == (0, 10)
    assert axes.x.high - axes.x.low == pytest.approx(20)
    assert axes.at(np.array([5]), np.array([10])) == pytest.approx(np.array([[100, 0]]))


def test_a_line_ends_at_its_box_and_at_gaps() -> None:
    assert red(drawn(Line(ACROSS, "#FF0000", 4))).any(axis=0).all()
    inside = red(drawn(Line(ACROSS, "#FF0000", 4, box=BOX))).any(axis=0)
    assert (inside[10:50].all(), inside[:10].any(), inside[50:].any()) == (True, False, False)
    gap = np.array([[0, 20], [10, 20], [np.nan, np.nan], [40, 20], [60, 20]])
    assert not red(drawn(Line(gap, "#FF0000", 4)))[:, 20:30].any()


def test_a_dashed_line_has_gaps() -> None:
    shown = red(drawn(Line(ACROSS, "#FF0000", 4, "dash"))).any(axis=0)
    assert 2 <= np.diff(shown.astype(int)).clip(0).sum() <= 4


@pytest.mark.parametrize("symbol", ["circle", "x", "triangle", "square"])
def test_a_mark_is_where_its_point_is(symbol: str) -> None:
    rows, columns = np.nonzero(red(drawn(mark(np.array([30.0, 20.0]), symbol, "#FF0000", 12))))
    assert len(rows) > 20
    assert abs(columns.mean() - 30) < 1.5
    assert abs(rows.mean() - 20) < 2.5


def test_a_picture_keeps_its_pixels() -> None:
    values = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    image = drawn(Picture(Box(8, 8, 48, 28), values))
    assert (image[8:18, 8:18] == values[0, 0]).all()
    assert (image[18:28, 38:48] == values[1, 3]).all()


def test_half_opaque_areas_let_the_ground_through() -> None:
    assert (abs(drawn(Area(BOX.corners, "#000000", 0.5))[20, 30].astype(int) - 128) < 3).all()


@pytest.mark.parametrize("upright", [False, True])
def test_text_is_drawn(upright: bool) -> None:
    image = drawn(Text(30, 25, "m", "#FF0000", 20, "middle", upright=upright))
    assert 20 < red(image).sum() < 400


def test_png_and_svg(tmp_path: Path) -> None:
    axes = Axes(BOX, Scale(0, 1), Scale(0, 1))
    shapes = [
        axes.grid(axes.x_ticks(), axes.y_ticks()),
        Line(ACROSS, "#FF0000", box=BOX, dash="dot"),
        mark(np.array([30.0, 20.0]), "circle", "#00FF00"),
        Picture(BOX, np.zeros((4, 8, 3), np.uint8), photograph=True),
        Text(30, 20, "<a & b>", "#000000"),
    ]
    drawing = Drawing(60, 40, shapes)
    save_png(drawing, tmp_path / "a.png")
    found = cv2.imread(str(tmp_path / "a.png"))
    assert found is not None
    assert np.array_equal(found[..., ::-1], pixels(drawing))
    root = ElementTree.fromstring(svg(drawing))
    assert [element.text for element in root.iter("{http://www.w3.org/2000/svg}text")] == ["<a & b>"]
    assert len(list(root.iter("{http://www.w3.org/2000/svg}image"))) == 1


def test_colours_change_with_the_ground() -> None:
    drawing = Drawing(60, 40, [Text(30, 20, "a", "#222222"), Text(30, 20, "b", "#FF0000")])
    dark = drawing.recoloured("#000000", "#222222", "#EEEEEE")
    assert (dark.ground, [shape.colour for shape in dark.shapes]) == ("#000000", ["#EEEEEE", "#FF0000"])


def test_the_highest_points_are_last() -> None:
    assert highest_last(np.array([0.5, -1.0, 2.0, -1.0])).tolist() == [1, 3, 0, 2]
    assert highest_last(np.zeros(0)).tolist() == []


def test_colours_of_values() -> None:
    dark, middle, bright = colours_of(np.array([-1.0, 0.5, 2.0]), 0, 1, "viridis").astype(int)
    assert abs(dark - [68, 1, 84]).max() < 3
    assert abs(middle - [33, 145, 140]).max() < 3
    assert abs(bright - [253, 231, 37]).max() < 3
