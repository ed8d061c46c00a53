"""Roofs of houses, with their dormers and chimneys."""

from __future__ import annotations

import numpy as np

from slam.simulation.mesh import Colour, Mesh, box, joined, prism
from slam.simulation.palette import BRICK, pick, shade
from slam.simulation.town.facades import Opening, Style, glazing

EAVES = 0.5  # no roof reaches further beyond its walls

TILES: list[Colour] = [(140, 72, 54), (122, 66, 52), (104, 74, 64), (84, 84, 88)]


def roof(rng: np.random.Generator, style: Style, width: float, depth: float, eaves: float) -> tuple[Mesh, float, float]:
    """With its dormers and chimneys, and how high the gables below it rise on the street and at the sides."""
    kind = pick(rng, ["gable", "gable", "gable", "hip", "flat"] + ["front gable"] * 2 * (width < 11 and eaves < 10))
    across = kind == "front gable" or (kind == "hip" and width < depth)  # the ridge runs away from the street
    length, span = (depth, width) if across else (width, depth)
    rise = 0.0 if kind == "flat" else round(min(span / 2 * np.tan(np.deg2rad(rng.uniform(28, 46))), 5.5), 3)
    if kind == "flat":
        over = pick(rng, [0.1, 0.6])
        parts = [box((width + over, depth + over, 0.4), "concrete", style.trim)]
        parts.append(box((width - 0.4, depth - 0.4, 0.42), "concrete", (128, 126, 122)))  # gravel
    else:
        parts = [_slopes(shade(rng, TILES), length, span, rise, rng.uniform(0.25, EAVES), kind == "hip")]
    if kind == "gable" and rise > 3.5 and rng.random() < 0.65:
        ahead = pick(rng, [[0.0], [-0.25, 0.25], [-0.33, 0.0, 0.33]])
        parts += [_dormer(rng, style, 2 * rise / depth).placed(x * width, -depth / 2, 0) for x in ahead]
    for _ in range(rng.integers(1, 3)):
        stack = box((rng.uniform(0.45, 0.9), 0.5, rise + 0.9), "brick", shade(rng, BRICK))
        parts.append(stack.placed(rng.uniform(-0.15, 0.15) * length, rng.uniform(-0.08, 0.08) * span, 0))
    top = joined(parts).placed(0, depth / 2, eaves, np.pi / 2 * across)
    return top, rise * (kind == "front gable"), rise * (kind == "gable")


def _slopes(colour: Colour, length: float, span: float, rise: float, overhang: float, hip: bool) -> Mesh:
    """A roof over the origin, its ridge along x; on z = 0 at the walls."""
    a, b = length / 2 + (overhang if hip else 0.12), span / 2 + overhang
    ridge = max((length - span) / 2, 0.3) if hip else a
    low = -overhang * rise / (span / 2)
    faces = [np.array([(-a, -b, low), (a, -b, low), (ridge, 0, rise), (-ridge, 0, rise)])]
    if hip:
        faces.append(np.array([(a, -b, low), (a, b, low), (ridge, 0, rise)]))
    half = joined([prism(face, 0.2, "roof", colour) for face in faces])
    return joined([half, half.placed(0, 0, 0, np.pi)])


def _dormer(rng: np.random.Generator, style: Style, slope: float) -> Mesh:
    """On a roof that rises by `slope` from the x axis: a box with a window and a flat lid."""
    front, base = 0.7, 0.7 * slope - 0.1
    length = (base + 1.5) / slope - front
    body = box((1.5, length, 1.5), "metal", style.wall[1]).placed(0, front + length / 2, base)
    lid = box((1.8, length + 0.4, 0.12), "metal", (112, 116, 116)).placed(0, front + length / 2 - 0.1, base + 1.5)
    window = glazing(rng, style, Opening.at(0, 1.2, 0.3, 1.1)).placed(0, front - 0.02 - style.recess, base)
    return joined([body, lid, window])
