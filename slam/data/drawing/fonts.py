"""The font of drawings: DejaVu Sans, which matplotlib brings, found without importing matplotlib."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

FAMILY = "DejaVu Sans, Verdana, Geneva, sans-serif"
FILES = {False: "DejaVuSans.ttf", True: "DejaVuSans-Bold.ttf"}  # by whether it is bold


@cache
def font(size: float, bold: bool = False) -> Any:
    """Return Pillow's font of a height [pixels]."""
    from PIL import ImageFont

    spec = find_spec("matplotlib")
    assert spec is not None
    assert spec.origin is not None
    path = Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf" / FILES[bold]
    return ImageFont.truetype(str(path), size, layout_engine=ImageFont.Layout.BASIC)


def text_width(text: str, size: float, bold: bool = False) -> float:
    """Return the width of a text [pixels]."""
    return float(font(size, bold).getlength(text))
