"""Walls, floors and ceilings of the rooms, with their doors and windows."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from slam.data.cloud import Array
from slam.simulation.indoors.plan import CEILING, FOOT, HALF, OPENINGS, STOREY, Opening, Room
from slam.simulation.mesh import Colour, Mesh, box, joined, quads
from slam.simulation.palette import pick, shade

Finish = tuple[str, Colour]  # a material and its colour
Rectangle = tuple[float, float, float, float]  # along the wall from and to, height from and to

DADO, SKIRTING = 1.25, 0.09  # metres: heights of a painted lower wall, and of the board along the floor
PANE_DEPTH, REVEAL = 0.12, 0.2  # metres behind the middle of an outer wall
WALLS: list[Colour] = [(222, 214, 196), (206, 214, 206), (214, 202, 178), (196, 206, 216), (224, 220, 212)]
DADOS: list[Colour] = [(126, 146, 136), (150, 130, 104), (112, 132, 156)]
LEAVES: list[Colour] = [(168, 128, 88), (138, 98, 66), (206, 204, 196), (112, 130, 146)]
PARQUET: list[Colour] = [(150, 112, 74), (128, 92, 60), (172, 138, 98)]
CARPET: list[Colour] = [(92, 98, 112), (112, 82, 74), (96, 106, 88)]
LINOLEUM: list[Colour] = [(150, 146, 132), (128, 140, 138), (146, 122, 104)]
BRICKS: list[Colour] = [(196, 190, 178), (168, 112, 90)]
FRAME: Colour = (224, 222, 214)
STEEL: Colour = (150, 152, 154)


class Style(NamedTuple):
    """The surfaces of one room; `dado` is the lower part of its walls."""

    wall: Finish
    dado: Finish
    floor: Finish
    ceiling: Finish

    @staticmethod
    def of(room: Room, rng: np.random.Generator) -> Style:
        """As such rooms often are."""
        tiles: Finish = ("ceiling", (226, 226, 222))
        if room.kind in ("corridor", "stairs"):
            stone: Finish = ("paving", (164, 160, 150)) if room.kind == "stairs" else ("linoleum", shade(rng, LINOLEUM))
            return Style(("plaster", (224, 220, 208)), ("wallpaper", pick(rng, DADOS)), stone, tiles)
        if room.kind == "store":
            upper, lower = (("brick", shade(rng, BRICKS)) for _ in range(2))
            return Style(upper, lower, ("concrete", (150, 148, 142)), ("concrete", (190, 188, 182)))
        wall: Finish = (pick(rng, ["wallpaper", "plaster", "wallpaper"]), shade(rng, WALLS))
        floors: list[Finish] = [("parquet", shade(rng, PARQUET)), ("carpet", shade(rng, CARPET))]
        floor = ("linoleum", shade(rng, LINOLEUM)) if room.kind in ("classroom", "canteen") else pick(rng, floors)
        return Style(wall, wall, floor, tiles)


def room_shell(room: Room, style: Style) -> Mesh:
    """Create the inner faces of a room at their place in the building, with its openings, floor and ceiling."""
    inner = [(low + HALF, high - HALF) for low, high in (room.x, room.y)]
    parts: list[Mesh] = []
    for across, spans in enumerate((room.x, room.y)):
        for line, inside in zip(spans, (1, -1), strict=True):
            holes = [_hole(opening) for opening in openings_of(room, across, line)]
            parts += _face(inner[1 - across], across, line + inside * HALF, inside, holes, style, _wall_height(room))
    parts += _floor_and_ceiling(room, style)
    return joined(parts).placed(0, 0, room.floor * STOREY)


def openings_of(room: Room, across: int, line: float) -> list[Opening]:
    """Return the openings in a wall of a room."""
    low, high = (room.y, room.x)[across]
    return [
        opening
        for opening in OPENINGS
        if (opening.floor, opening.across, opening.line) == (room.floor, across, line) and low < opening.at < high
    ]


def opening_parts(opening: Opening, rng: np.random.Generator) -> Mesh:
    """Create the parts of an opening at its place in the building: reveals, frame, door or panes."""
    upright = joined(_window(opening, rng) if opening.kind == "window" else _door(opening, rng))
    turn = 0.0 if opening.across else np.pi / 2  # built along x, with its room or its door's leaf at the side of +y
    x, y = (opening.at, opening.line) if opening.across else (opening.line, opening.at)
    if opening.side * (1 if opening.across else -1) < 0:
        turn += np.pi
    return upright.placed(x, y, opening.floor * STOREY, turn)


def _wall_height(room: Room) -> float:
    return STOREY if room.kind == "stairs" and room.floor == 0 else CEILING


def _hole(opening: Opening) -> Rectangle:
    half = opening.width / 2
    return opening.at - half, opening.at + half, opening.foot, opening.foot + opening.height


def _face(
    span: tuple[float, float], across: int, plane: float, inside: int, holes: list[Rectangle], style: Style, top: float
) -> Iterator[Mesh]:
    """One wall as seen from inside: piers around the holes, and the skirting board before them."""
    for low, high, finish, lift in (
        (0.0, DADO, style.dado, 0.0), (DADO, top, style.wall, 0.0), (0.0, SKIRTING, ("laminate", FRAME), 0.012)
    ):  # fmt: skip
        pieces = list(_piers(span, (low, high), holes))
        if pieces:
            yield quads(_upright(np.array(pieces), across, plane + inside * lift), *finish)


def _piers(span: tuple[float, float], heights: tuple[float, float], holes: list[Rectangle]) -> Iterator[Rectangle]:
    """A wall's rectangle without its holes, as rectangles."""
    levels = {*heights, *(z for hole in holes for z in hole[2:] if heights[0] < z < heights[1])}
    for low, high in pairwise(sorted(levels)):
        here = sorted(hole for hole in holes if hole[2] < high and hole[3] > low)
        edges = [span[0], *(edge for hole in here for edge in hole[:2]), span[1]]
        yield from ((left, right, low, high) for left, right in zip(edges[::2], edges[1::2], strict=True))


def _upright(pieces: Array, across: int, plane: float) -> Array:
    """(N, 4, 3): the corners of rectangles (N, 4) in the plane where the coordinate `across` has that value."""
    left, right, low, high = pieces.T
    along = np.stack([left, right, right, left], axis=1)
    corners = np.stack([along, along, np.stack([low, low, high, high], axis=1)], axis=-1)
    corners[..., across] = plane
    return corners


def _level(x: tuple[float, float], y: tuple[float, float], z: float, finish: Finish) -> Mesh:
    return quads(np.array([(x[0], y[0], z), (x[1], y[0], z), (x[1], y[1], z), (x[0], y[1], z)]), *finish)


def _floor_and_ceiling(room: Room, style: Style) -> Iterator[Mesh]:
    """To the middles of the walls, so that doorways have a floor; those over stairs end where the flights begin."""
    before = (room.y[0], FOOT)
    stairs = room.kind == "stairs"
    yield _level(room.x, before if stairs and room.floor else room.y, 0.0, style.floor)
    yield _level(room.x, before if stairs and not room.floor else room.y, CEILING, style.ceiling)
    if stairs and not room.floor:
        edge = np.array([[room.x[0], room.x[1], CEILING, STOREY]])
        yield quads(_upright(edge, 1, FOOT), "concrete", (176, 174, 168))


def _lining(opening: Opening, near: float, far: float, finish: Finish) -> Mesh:
    """The four sides of a hole between two depths, along x around the origin."""
    half, low, high = opening.width / 2, opening.foot, opening.foot + opening.height
    ring = np.array([(-half, low), (half, low), (half, high), (-half, high)])
    front, back = np.insert(ring, 1, near, axis=1), np.insert(ring, 1, far, axis=1)
    sides = np.stack([front, np.roll(front, -1, 0), np.roll(back, -1, 0), back], axis=1)
    return quads(sides if opening.foot else sides[1:], *finish)


def _around(opening: Opening, board: tuple[float, float], y: float, finish: Finish, sill: bool) -> list[Mesh]:
    """A frame of boards (width, depth) around the edge of a hole, inwards from it where the width is negative."""
    (width, depth), half = board, opening.width / 2
    low, high = opening.foot, opening.foot + opening.height
    broad = abs(width)
    side, over, under = half + width / 2, high + min(width, 0), low - max(width, 0)
    post = box((broad, depth, opening.height), *finish)
    beam = box((opening.width + max(2 * width, 0), depth, broad), *finish)
    parts = [post.placed(-side, y, low), post.placed(side, y, low), beam.placed(0, y, over)]
    return [*parts, beam.placed(0, y, under)] if sill else parts


def _door(opening: Opening, rng: np.random.Generator) -> list[Mesh]:
    """The lining of a passage and its casing on both sides; the leaf opens towards +y, its hinge at -x."""
    casing: Finish = ("laminate", FRAME if opening.kind == "door" else STEEL)
    parts = [_lining(opening, -HALF, HALF, casing)]
    for face in (-1, 1):
        parts += _around(opening, (0.08, 0.03), face * HALF, casing, sill=False)
    if opening.leaf is not None:
        parts.append(_leaf(opening, pick(rng, LEAVES)).placed(-opening.width / 2, HALF - 0.02, 0, opening.leaf))
    return parts


def _leaf(opening: Opening, colour: Colour) -> Mesh:
    """Closed, with a handle on either side, its hinge at the origin."""
    width = opening.width
    parts = [box((width - 0.02, 0.04, opening.height - 0.02), "laminate", colour).placed(width / 2, 0, 0.01)]
    for face in (-1, 1):
        parts.append(box((0.13, 0.02, 0.02), "metal", STEEL).placed(width - 0.14, face * 0.06, 1.04))
        parts.append(box((0.04, 0.012, 0.2), "metal", STEEL).placed(width - 0.09, face * 0.024, 0.94))
    return joined(parts)


def _window(opening: Opening, rng: np.random.Generator) -> list[Mesh]:
    """Two casements in a deep reveal, a board below them and at times a blind; the room lies towards +y."""
    half, top = opening.width / 2, opening.foot + opening.height
    white: Finish = ("laminate", (232, 232, 228))
    parts = [_lining(opening, HALF, -REVEAL, ("plaster", (226, 224, 216)))]
    parts += _around(opening, (-0.07, 0.06), -PANE_DEPTH, white, sill=True)
    parts.append(box((0.1, 0.06, opening.height), *white).placed(0, -PANE_DEPTH, opening.foot))
    glass = np.array([[-half, half, opening.foot, top]])
    parts.append(quads(_upright(glass, 1, -PANE_DEPTH), "pane"))
    board = box((opening.width + 0.1, 0.3, 0.03), "laminate", (214, 210, 200))
    parts.append(board.placed(0, HALF - 0.08, opening.foot - 0.03))
    if rng.random() < 0.4:
        drop = rng.uniform(0.2, 0.7) * opening.height
        slat = box((opening.width - 0.06, 0.035, 0.012), "laminate", (196, 190, 176))
        parts += [slat.placed(0, 0, top - 0.05 - z) for z in np.arange(0.0, drop, 0.05)]
    return parts
