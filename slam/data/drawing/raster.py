"""Drawings as pixels and as PNG files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from slam.data.atomic import written_beside
from slam.data.cloud import Array
from slam.data.drawing.colours import rgb
from slam.data.drawing.fonts import font
from slam.data.drawing.shapes import DASHES, Area, Box, Drawing, Line, Picture, Text

SHIFT = 4  # bits of a pixel's fraction in OpenCV's coordinates
ANCHORS = {"start": "l", "middle": "m", "end": "r"}  # Pillow's names
COMPRESSION = 2  # of 9: a third of the time of more, and files a tenth larger


def save_png(drawing: Drawing, path: Path) -> None:
    """Write a drawing as PNG.

    Raises:
        InputError: The file cannot be written.
    """
    with written_beside(path) as temporary:
        temporary.write_bytes(png(pixels(drawing)))


def png(image: Array) -> bytes:
    """Return an image (H, W, 3) uint8 RGB as a PNG file."""
    import cv2

    done, file = cv2.imencode(
        ".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_PNG_COMPRESSION, COMPRESSION]
    )
    assert done
    return bytes(file)


def pixels(drawing: Drawing, scale: float = 1.0) -> Array:
    """Draw.

    Args:
        drawing: The drawing.
        scale: Pixels of the result per pixel of the drawing.

    Returns:
        (H, W, 3) uint8 RGB.
    """
    image = np.full((round(scale * drawing.height), round(scale * drawing.width), 3), rgb(drawing.ground), np.uint8)
    for shape in drawing.shapes:
        if not isinstance(shape, Text):
            _draw(image, shape, scale)
    return _written(image, [shape for shape in drawing.shapes if isinstance(shape, Text)], scale)


def _draw(image: Array, shape: Line | Area | Picture, scale: float) -> None:
    import cv2

    if isinstance(shape, Picture):
        view, _ = _view(image, shape.box, scale)
        how = cv2.INTER_AREA if shape.photograph else cv2.INTER_NEAREST
        view[:] = cv2.resize(shape.pixels, view.shape[1::-1], interpolation=how)
        return
    view, corner = _view(image, shape.box, scale) if shape.box else (image, np.zeros(2))
    target = view.copy() if shape.opacity < 1 or shape.box else view  # OpenCV needs contiguous rows
    if isinstance(shape, Area):
        cv2.fillPoly(target, [_fixed(shape.points, corner, scale)], rgb(shape.colour), cv2.LINE_AA, SHIFT)
    else:
        width = max(1, round(scale * shape.width) - 1)  # smooth edges add a pixel
        parts = [_fixed(part, corner, scale) for part in _parts(shape)]
        cv2.polylines(target, parts, False, rgb(shape.colour), width, cv2.LINE_AA, SHIFT)
    if shape.opacity < 1:
        view[:] = cv2.addWeighted(target, shape.opacity, np.ascontiguousarray(view), 1 - shape.opacity, 0)
    elif target is not view:
        view[:] = target


def _view(image: Array, box: Box, scale: float) -> tuple[Array, Array]:
    """The pixels in a box, and its left upper corner (2,) [pixels]."""
    left, top, right, bottom = (round(scale * at) for at in (box.left, box.top, box.right, box.bottom))
    return image[top:bottom, left:right], np.array([left, top])


def _fixed(points: Array, corner: Array, scale: float) -> Array:
    """Points (N, 2) int32 in OpenCV's coordinates: whole numbers are the middles of pixels."""
    return np.rint((scale * points - corner - 0.5) * (1 << SHIFT)).astype(np.int32)


def _parts(line: Line) -> Iterator[Array]:
    """The continuous parts (K, 2) of a line: stretches, or their dashes."""
    for stretch in line.stretches():
        if line.dash == "solid" or len(stretch) < 2:
            yield stretch[[0, 0]] if len(stretch) < 2 else stretch
            continue
        mark, gap = (line.width * length for length in DASHES[line.dash])
        along = np.concatenate([[0], np.hypot(*np.diff(stretch, axis=0).T).cumsum()])
        for start in np.arange(0, along[-1], mark + gap):
            inside = along[(start < along) & (along < start + mark)]
            at = np.concatenate([[start], inside, [min(start + mark, along[-1])]])
            yield np.column_stack([np.interp(at, along, stretch[:, axis]) for axis in (0, 1)])


def _written(image: Array, texts: list[Text], scale: float) -> Array:
    """The image with texts."""
    from PIL import Image, ImageDraw

    picture = Image.fromarray(image)
    pen = ImageDraw.Draw(picture)
    for text in texts:
        shape, colour = font(round(scale * text.size, 1), text.bold), rgb(text.colour)
        x, y = scale * text.x, scale * text.y
        if text.upright:
            left, top, right, bottom = shape.getbbox(text.text, anchor="ls")
            mask = Image.new("L", (right - left + 2, bottom - top + 2))
            ImageDraw.Draw(mask).text((1 - left, 1 - top), text.text, 255, shape, anchor="ls")
            mask = mask.transpose(Image.Transpose.ROTATE_90)
            picture.paste(colour, (round(x - mask.width / 2), round(y - mask.height / 2)), mask)
        else:
            pen.text((x, y), text.text, colour, shape, anchor=ANCHORS[text.anchor] + ("m" if text.middle else "s"))
    return np.array(picture)
