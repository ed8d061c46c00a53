"""The plan of the building: its rooms on two floors, the openings between them, and its two stairs.

x runs along the corridors, y to the north; the ground floor lies at z = 0. Rooms are given by the middles of their
walls.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

STOREY, CEILING = 3.15, 2.85  # metres from floor to floor, and from a floor to its ceiling
HALF = 0.07  # metres: half of a wall
SOUTH, CORRIDOR, NORTH = (-6.0, 0.0), (0.0, 2.3), (2.3, 7.75)  # y of the rooms on either side and of the corridor
LENGTH = 40.0 + 2 * HALF  # of the corridor and its end walls
DOOR = (1.0, 2.1)  # metres: width and height

RISERS, RISE, TREAD = 9, STOREY / 18, 0.28  # of each flight, the last one up to the landing or to the floor
WELL, FLIGHT = 3.2, 1.4  # metres: width of a stairwell, and of each of its two flights
FOOT = NORTH[0] + HALF + 1.5  # y where the flights begin
HEAD = FOOT + (RISERS - 1) * TREAD  # y where the landing begins

Kind = Literal["corridor", "stairs", "office", "classroom", "lounge", "store", "bedroom", "canteen", "meeting"]


class Room(NamedTuple):
    """A rectangle between the middles of its walls, on floor 0 or 1."""

    kind: Kind
    x: tuple[float, float]
    y: tuple[float, float]
    floor: int


class Opening(NamedTuple):
    """An opening in a wall.

    Attributes:
        floor: Floor 0 or 1.
        across: 0: in a wall of constant x, 1: of constant y.
        line: The constant x or y of the wall.
        at: The other coordinate of its centre.
        foot: Height of its lower edge above the floor.
        leaf: Opening angle of its door [rad], from closed (0) to flat at the wall (about 3); None: no door.
        side: Side of the wall with the hinges of the door, or with the room of a window, as the sign of x or y.
    """

    kind: Literal["door", "portal", "window"]
    across: int
    line: float
    at: float
    floor: int
    width: float
    foot: float
    height: float
    leaf: float | None = None
    side: int = 1


class Stairs(NamedTuple):
    """Two flights with a landing between them, in a stairwell whose western wall has its middle at x = `west`."""

    west: float

    @property
    def up(self) -> float:
        """Coordinate x of the centre of the flight from the ground floor to the landing."""
        return self.west + WELL - HALF - FLIGHT / 2

    @property
    def on(self) -> float:
        """Coordinate x of the centre of the flight from the landing to the upper floor."""
        return self.west + HALF + FLIGHT / 2


WEST, EAST = Stairs(0.0), Stairs(23.0)


def _row(y: tuple[float, float], floor: int, *cuts: Kind | float) -> list[Room]:
    """Rooms side by side: x, kind, x, kind, ..., x."""
    walls: list[float] = [cut for cut in cuts if not isinstance(cut, str)]
    kinds: list[Kind] = [cut for cut in cuts if isinstance(cut, str)]
    return [Room(kind, (walls[i], walls[i + 1]), y, floor) for i, kind in enumerate(kinds)]


ROOMS: tuple[Room, ...] = (
    *_row(CORRIDOR, 0, 0.0, "corridor", LENGTH),
    *_row(SOUTH, 0, 0.0, "office", 6.0, "classroom", 14.0, "office", 18.0, "lounge", 27.0, "store", 31.0,
          "classroom", LENGTH),
    *_row(NORTH, 0, 0.0, "stairs", WELL, "meeting", 9.0, "store", 12.0, "canteen", EAST.west, "stairs",
          EAST.west + WELL, "office", 34.0, "bedroom", LENGTH),
    *_row(CORRIDOR, 1, 0.0, "corridor", LENGTH),
    *_row(SOUTH, 1, 0.0, "bedroom", 5.0, "office", 11.5, "lounge", 18.5, "bedroom", 23.0, "classroom", 31.0,
          "office", LENGTH),
    *_row(NORTH, 1, 0.0, "stairs", WELL, "bedroom", 8.0, "store", 11.0, "meeting", 17.0, "office", EAST.west, "stairs",
          EAST.west + WELL, "bedroom", 33.0, "store", LENGTH),
)  # fmt: skip

OPEN = 2.9  # rad: a door that lies at its wall
#: Doors along the corridors: floor, y of the wall, and of each door x and how far it is open. The walk leads through
#: three of the southern ones: at WEST.up downstairs, at 13.2 and 20.9 upstairs.
CORRIDOR_DOORS: list[tuple[int, float, list[tuple[float, float]]]] = [
    (0, 0.0, [(WEST.up, OPEN), (7.2, 0.0), (12.6, 1.2), (16.0, 1.9), (19.5, OPEN), (25.5, 0.0), (29.0, 0.9),
              (32.5, OPEN), (38.6, 0.0)]),
    (0, 2.3, [(5.0, 1.5), (10.5, 0.0), (14.0, OPEN), (21.5, OPEN), (30.0, 1.6), (36.0, 0.0)]),
    (1, 0.0, [(4.0, 0.0), (6.5, 1.3), (13.2, OPEN), (20.9, OPEN), (24.5, 0.0), (29.5, 1.1), (33.0, OPEN)]),
    (1, 2.3, [(6.9, 1.4), (9.5, 0.0), (12.5, OPEN), (18.3, 1.7), (30.0, 0.7), (35.0, 0.0)]),
]  # fmt: skip


def _doors() -> list[Opening]:
    """They open into the rooms."""
    corridors = [
        _hung(1, line, x, floor, leaf, 1 if line else -1) for floor, line, row in CORRIDOR_DOORS for x, leaf in row
    ]
    return [*corridors, _hung(0, 6.0, -3.0, 0, 1.4, 1), _hung(0, 18.5, -3.0, 1, OPEN, -1)]


def _hung(across: int, line: float, at: float, floor: int, leaf: float, side: int) -> Opening:
    return Opening("door", across, line, at, floor, DOOR[0], 0.0, DOOR[1], leaf, side)


def _portals() -> list[Opening]:
    """To the stairs, on both floors."""
    return [
        Opening("portal", 1, NORTH[0], stairs.west + WELL / 2, floor, 2.7, 0.0, 2.4)
        for stairs in (WEST, EAST)
        for floor in (0, 1)
    ]


def _windows() -> list[Opening]:
    """In the outer walls of all rooms, at the ends of the corridors, and half-way up the stairs."""
    found = []
    for room in ROOMS:
        if room.kind == "corridor":
            for x, side in zip(room.x, (1, -1), strict=True):
                found.append(Opening("window", 0, x, 1.15, room.floor, 1.2, *_pane(room), side=side))
            continue
        line, side = (room.y[0], 1) if room.y == SOUTH else (room.y[1], -1)
        count = max(round((room.x[1] - room.x[0]) / 2.6), 1)
        step = (room.x[1] - room.x[0]) / count
        for index in range(count):
            x = round(room.x[0] + (index + 0.5) * step, 3)
            found.append(Opening("window", 1, line, x, room.floor, 1.5, *_pane(room), side=side))
    return found


def _pane(room: Room) -> tuple[float, float]:
    """Foot and height of its windows; those of the stairs are seen from the landing."""
    if room.kind == "stairs":
        return (0.6, 1.6) if room.floor else (1.9, 0.9)
    return 0.9, 1.4


OPENINGS: tuple[Opening, ...] = (*_doors(), *_portals(), *_windows())
