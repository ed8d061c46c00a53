"""Walls with recessed windows and doors, facing -y in the plane y = 0, and the balconies and bays before them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np

from slam.data.cloud import Array
from slam.simulation.mesh import Colour, Mesh, box, fan, joined, quads
from slam.simulation.palette import pick

STOREY = 2.9
BAY = 0.7  # how far bays stand out

Finish = tuple[str, Colour]  # a material and its colour

PANE: list[Colour] = [(60, 74, 88), (46, 56, 66), (74, 84, 92), (128, 130, 126)]  # the last has a curtain behind it


class Style(NamedTuple):
    """Style shared by the parts of a house."""

    wall: Finish
    ground: Finish  # of the ground floor
    plinth: Finish
    trim: Colour  # of reveals, sills and string courses
    frame: Colour
    leaf: Colour  # of doors and folding shutters
    floor: float  # height of the ground floor, which the plinth reaches
    recess: float  # of windows behind the wall
    glazed: float  # share of a facade's width that is window
    height: float  # of windows
    beside: Literal["nothing", "shutters", "stone"]  # of windows on the street


class Opening(NamedTuple):
    """A hole in a wall, by its edges."""

    left: float
    right: float
    bottom: float
    top: float
    kind: Literal["window", "door", "garage"] = "window"

    @staticmethod
    def at(x: float, width: float, bottom: float, height: float) -> Opening:
        """Around x; to the millimetre, so that equal heights are equal numbers."""
        left, right = round(float(x - width / 2), 3), round(float(x + width / 2), 3)
        return Opening(left, right, round(bottom, 3), round(bottom + height, 3))

    def free_of(self, others: Sequence[Opening]) -> bool:
        """Whether all others are half a metre beside it, or over or under it."""
        beside = [max(self.left - o.right, o.left - self.right) > 0.5 for o in others]
        return all(b or self.bottom >= o.top or self.top <= o.bottom for b, o in zip(beside, others, strict=True))


def windows(style: Style, centres: Array, storeys: int, french: Sequence[int] = ()) -> list[Opening]:
    """One a column and storey, those of the `french` columns down to the floor but on the ground floor."""
    width = min(style.glazed * (centres[1] - centres[0]), 2.2)
    openings = []
    for floor in style.floor + STOREY * np.arange(storeys):
        for column, x in enumerate(centres):
            low = 0.75 if column in french and floor > style.floor else 0.0
            openings.append(Opening.at(x, width, floor + 0.85 - low, style.height + low))
    return openings


def wall(
    rng: np.random.Generator, style: Style, width: float, foot: float, top: float, rise: float, openings: list[Opening]
) -> Mesh:
    """In the plane y = 0, facing -y, centred in x: a rectangle from `foot` to `top` under a gable that rises."""
    if rise > 2.8:
        openings = [*openings, Opening.at(0, 0.9, top + 0.4, 1.1)]
    ground = round(style.floor + STOREY, 3)
    heights = {foot, top, top + rise, *(z for z in (style.floor, ground) if foot < z < top)}
    heights |= {z for opening in openings for z in (opening.bottom, opening.top)}
    parts = [_closed(rng, style, opening) for opening in openings]
    for low, high in pairwise(sorted(heights)):
        halves = [width / 2 * (1.0 if z <= top else (top + rise - z) / rise) for z in (low, high)]
        holes = sorted(o for o in openings if o.bottom < high and o.top > low)
        edges = [(-halves[0], -halves[1]), *((x, x) for o in holes for x in (o.left, o.right)), (halves[0], halves[1])]
        piers = [
            [(left[0], 0, low), (right[0], 0, low), (right[1], 0, high), (left[1], 0, high)]
            for left, right in zip(edges[::2], edges[1::2], strict=True)
        ]
        finish = style.plinth if high <= style.floor else style.ground if high <= ground else style.wall
        tip = halves[1] == 0  # of a gable: one triangle
        parts.append(fan(np.array(piers[0][:3]), *finish) if tip else quads(np.array(piers), *finish))
    return joined(parts)


def _closed(rng: np.random.Generator, style: Style, opening: Opening) -> Mesh:
    """The reveals of an opening and the window or door at their end."""
    left, right, bottom, top, kind = opening
    near = _panel(left, right, bottom, top, 0)
    far = _panel(left, right, bottom, top, style.recess)
    reveals = np.stack([near, np.roll(near, -1, 0), np.roll(far, -1, 0), far], axis=1)
    if kind == "window":
        return joined([quads(reveals, "concrete", style.trim), glazing(rng, style, opening), _surround(style, opening)])
    leaf = quads(far, "metal", style.frame) if kind == "garage" else quads(far, "wood", style.leaf)
    light = quads(_panel(left + 0.2, right - 0.2, top - 0.6, top - 0.2, style.recess - 0.02), "glass")
    return joined([quads(reveals, "concrete", style.trim), leaf, light])


def glazing(rng: np.random.Generator, style: Style, opening: Opening) -> Mesh:
    """A frame, the panes a little before it, and at times a blind partly down."""
    left, right, bottom, top, _ = opening
    bars = np.linspace(left + 0.03, right - 0.03, 2 if right - left < 0.8 else 3)
    panes = [_panel(a + 0.05, b - 0.05, bottom + 0.08, top - 0.08, style.recess - 0.015) for a, b in pairwise(bars)]
    parts = [quads(_panel(left, right, bottom, top, style.recess), "wood", style.frame)]
    parts.append(quads(np.array(panes), "glass", pick(rng, PANE)))
    if style.beside != "shutters" and rng.random() < 0.25:
        blind = _panel(left, right, top - rng.uniform(0.2, 0.9) * (top - bottom), top, style.recess - 0.05)
        parts.append(quads(blind, "metal", (206, 204, 198)))
    return joined(parts)


def _surround(style: Style, opening: Opening) -> Mesh:
    """A sill, and what frames a window on the street: folded shutters or stone."""
    left, right, bottom, top, _ = opening
    x0, x1 = left - 0.07, right + 0.07
    ledge = [(x0, -0.07, bottom), (x1, -0.07, bottom), (x1, 0, bottom), (x0, 0, bottom)]
    stones = [_panel(x0, x1, bottom - 0.07, bottom, -0.07), ledge]
    parts = [quads(np.array(stones), "concrete", style.trim)]
    if style.beside != "nothing":
        broad = 0.16 if style.beside == "stone" else 0.42 * (right - left)
        finish: Finish = ("concrete", style.trim) if style.beside == "stone" else ("wood", style.leaf)
        sides = [_panel(left - broad, left, bottom, top, -0.04), _panel(right, right + broad, bottom, top, -0.04)]
        parts.append(quads(np.array(sides), *finish))
    return joined(parts)


def balcony(width: float, depth: float, rails: Sequence[tuple[float, float]], finish: Finish) -> Mesh:
    """Centred in x before the plane y = 0, its floor on z = 0, with rails or a panel around it."""
    x, y = width / 2 - 0.04, 0.04 - depth
    corners = [(-x, 0), (-x, y), (x, y), (x, 0)]
    sides = [[(*a, low), (*b, low), (*b, high), (*a, high)] for a, b in pairwise(corners) for low, high in rails]
    return joined([box((width, depth, 0.2), "concrete").placed(0, -depth / 2, -0.2), quads(np.array(sides), *finish)])


def bay(
    rng: np.random.Generator, style: Style, middle: float, width: float, top: float, openings: list[Opening]
) -> Mesh:
    """Stands out above the ground floor, with these windows in its front."""
    bottom = round(style.floor + STOREY - 0.1, 3)
    shifted = [o._replace(left=o.left - middle, right=o.right - middle) for o in openings]
    front = wall(rng, style._replace(beside="nothing"), width, bottom, round(top, 3), 0.0, shifted).placed(0, -BAY, 0)
    cheeks = [[(x, -BAY, bottom), (x, 0, bottom), (x, 0, top), (x, -BAY, top)] for x in (-width / 2, width / 2)]
    floor = box((width + 0.06, BAY + 0.03, 0.2), "concrete", style.trim).placed(0, -BAY / 2, bottom - 0.2)
    lid = box((width + 0.2, BAY + 0.1, 0.15), "metal", (112, 116, 116)).placed(0, -BAY / 2, top)
    return joined([front, quads(np.array(cheeks), *style.wall), floor, lid]).placed(middle, 0, 0)


def _panel(x0: float, x1: float, z0: float, z1: float, y: float) -> Array:
    return np.array([(x0, y, z0), (x1, y, z0), (x1, y, z1), (x0, y, z1)])
