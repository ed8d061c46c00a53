"""Drawings as SVG; text stays text."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from html import escape

import numpy as np

from slam.data.cloud import Array
from slam.data.drawing.fonts import FAMILY
from slam.data.drawing.raster import png
from slam.data.drawing.shapes import DASHES, Area, Box, Drawing, Line, Picture, Shape, Text

QUALITY = 90  # of photographs, in JPEG


def svg(drawing: Drawing) -> str:
    """Return a drawing as an SVG file."""
    boxes: dict[Box, str] = {}
    for shape in drawing.shapes:
        if isinstance(shape, Line | Area) and shape.box:
            boxes.setdefault(shape.box, f"box-{len(boxes)}")
    texts = [_text(shape) for shape in drawing.shapes if isinstance(shape, Text)]
    others = [_shape(shape, boxes) for shape in drawing.shapes if not isinstance(shape, Text)]
    clips = [f'<clipPath id="{name}"><rect {_place(box)}/></clipPath>' for box, name in boxes.items()]
    size = f'width="{drawing.width}" height="{drawing.height}"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {drawing.width} {drawing.height}" '
        f'font-family="{FAMILY}" fill="none" stroke-linecap="round" stroke-linejoin="round">',
        *(["<defs>", *clips, "</defs>"] if clips else []),
        f'<rect {size} fill="{drawing.ground}"/>',
        *others,
        *texts,
        "</svg>\n",
    ]
    return "\n".join(lines)


def _shape(shape: Shape, boxes: dict[Box, str]) -> str:
    if isinstance(shape, Picture):
        return _image(shape)
    assert isinstance(shape, Line | Area)
    style = f' opacity="{shape.opacity:g}"' if shape.opacity < 1 else ""
    style += f' clip-path="url(#{boxes[shape.box]})"' if shape.box else ""
    if isinstance(shape, Area):
        return f'<path d="{_path([shape.points])}Z" fill="{shape.colour}"{style}/>'
    if shape.dash != "solid":
        lengths = " ".join(f"{shape.width * length:.2f}" for length in DASHES[shape.dash])
        style += f' stroke-dasharray="{lengths}"'
    stretches = list(shape.stretches())
    return f'<path d="{_path(stretches)}" stroke="{shape.colour}" stroke-width="{shape.width:g}"{style}/>'


def _image(picture: Picture) -> str:
    kind, data = ("jpeg", _jpeg(picture.pixels)) if picture.photograph else ("png", png(picture.pixels))
    sharp = "" if picture.photograph else ' style="image-rendering:pixelated"'
    link = f"data:image/{kind};base64,{b64encode(data).decode('ascii')}"
    return f'<image {_place(picture.box)} preserveAspectRatio="none"{sharp} href="{link}"/>'


def _jpeg(pixels: Array) -> bytes:
    import cv2

    done, file = cv2.imencode(".jpg", cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    assert done
    return bytes(file)


def _text(text: Text) -> str:
    anchor, turned, y = text.anchor, "", text.y + (0.36 * text.size if text.middle else 0)  # half of a capital
    x = text.x
    if text.upright:
        anchor, turned = "middle", f' transform="rotate(-90 {text.x:.1f} {text.y:.1f})"'
        y = text.y + 0.36 * text.size
    weight = ' font-weight="bold"' if text.bold else ""
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" font-size="{text.size:.1f}" text-anchor="{anchor}" fill="{text.colour}"'
        f"{weight}{turned}>{escape(text.text, quote=False)}</text>"
    )


def _path(stretches: Sequence[Array]) -> str:
    """Path data of polylines; a single point is a line of no length, which its round ends show."""
    parts = []
    for stretch in stretches:
        points = stretch if len(stretch) > 1 else np.repeat(stretch, 2, axis=0)
        parts.append("M" + "L".join(f"{x:.2f},{y:.2f}" for x, y in points.tolist()))
    return "".join(parts)


def _place(box: Box) -> str:
    return f'x="{box.left:.2f}" y="{box.top:.2f}" width="{box.width:.2f}" height="{box.height:.2f}"'
