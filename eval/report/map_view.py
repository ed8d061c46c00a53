"""The maps as the page's 3-D view reads them: thinned, in 16-bit coordinates, with colours from a palette."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

import numpy as np

from eval.report.content import Report
from eval.report.pictures import HIGHEST, LOWEST
from eval.report.plotly_chart import packed
from slam.data.cloud import Array
from slam.data.point_files import Points

STEPS = 65535  # of a coordinate over the map's extent
PALETTE = 256  # colours of the camera that are kept
POSITIONS = 2000  # of a trajectory, at most
UNSEEN = 70, 78, 86  # colour of points that no camera saw
LOOKS = {
    **{"above": "from above", "side": "from the side", "left": "turn left", "right": "turn right"},
    **{"nearer": "nearer", "farther": "farther", "start": "reset"},
}


def map_view(report: Report, maps: Mapping[str, Points], share: float) -> dict[str, Any]:
    """Return the content of the 3-D view.

    Args:
        report: The report.
        maps: Thinned maps by label, at least one.
        share: Share of the points that they keep.

    Returns:
        For JSON: extent, limits of the colours, and for each label points and trajectory.
    """
    xyz = np.concatenate([points.xyz for points in maps.values()])
    low, high = xyz.min(axis=0).astype(float), xyz.max(axis=0).astype(float)
    scale = np.maximum(high - low, 1e-3) / STEPS
    tracks = {row.label: row.track.poses[:, :3, 3] for row in report.rows if row.label in maps}
    return {
        "low": low.round(4).tolist(),
        "scale": scale.tolist(),
        "heights": np.quantile(xyz[:, 2], (LOWEST, HIGHEST)).round(3).tolist(),
        "share": share,
        "maps": {
            label: {
                "xyz": packed(np.round((points.xyz - low) / scale), "u2"),
                "intensity": packed(_intensity(points), "u1"),
                **_camera(points),
                "track": packed(tracks[label][:: max(1, -(-len(tracks[label]) // POSITIONS))].ravel(), "f4"),
                "colour": report.colours[label],
            }
            for label, points in maps.items()
        },
    }


def map_controls(maps: Mapping[str, Points], share: float) -> str:
    """Return the place of the 3-D view and its controls, as HTML.

    Args:
        maps: The maps of `map_view`.
        share: Share of the points that they keep.
    """
    first = "enriched" if "enriched" in maps else next(iter(maps))
    coloured = any(points.colour is not None and points.colour.any() for points in maps.values())
    colours = ("height", "intensity", "camera") if coloured else ("height", "intensity")
    buttons = "".join(f'<button type="button" data-look="{key}">{name}</button>' for key, name in LOOKS.items())
    kept = f"All maps show the same {100 * share:.1f} % of their points, so that densities compare; map.pcd has all."
    unseen = " Grey: points that no camera saw." if coloured else ""
    return (
        '<figure id="map-3d"><h3>Map in 3-D</h3>'
        f"{_radios('map', maps, first)}{_radios('colour', colours, 'height')}"
        f'<fieldset><legend>View</legend>{buttons}</fieldset><div id="space" class="space" role="img" '
        f'aria-label="The map in 3-D with the trajectory: {escape(", ".join(maps), quote=True)}. The buttons turn it.">'
        "</div><figcaption>Drag to turn, scroll to zoom; the buttons do the same from the keyboard. The line is the "
        f"trajectory. {kept if share < 1 else 'All points of map.pcd.'}{unseen}</figcaption></figure>"
    )


def _radios(name: str, values: Iterable[str], first: str) -> str:
    inputs = (
        f'<label><input type="radio" name="{name}" value="{escape(value, quote=True)}"'
        f"{' checked' if value == first else ''}>{escape(value)}</label>"
        for value in values
    )
    return f"<fieldset><legend>{name.capitalize()}</legend>{''.join(inputs)}</fieldset>"


def _intensity(points: Points) -> Array:
    """Intensities (N,) from 0 to 255, the brightest two per cent cut off."""
    assert points.intensity is not None
    most = max(float(np.quantile(points.intensity, 0.98)), 1e-6)
    return np.clip(255 * points.intensity / most, 0, 255)


def _camera(points: Points) -> dict[str, Any]:
    """Palette and colour index of each point; nothing if the camera saw no point."""
    if points.colour is None or not points.colour.any():
        return {}
    from PIL import Image

    seen = points.colour.any(axis=1, keepdims=True)  # what is black was not seen
    colours = np.where(seen, points.colour, UNSEEN).astype(np.uint8)
    picture = Image.fromarray(colours[None]).quantize(PALETTE, method=Image.Quantize.MAXCOVERAGE)
    palette = np.array(picture.getpalette(), np.uint8).reshape(-1, 3)
    return {
        "palette": [f"rgb({red},{green},{blue})" for red, green, blue in palette.tolist()],
        "camera": packed(np.array(picture)[0], "u1"),
    }
