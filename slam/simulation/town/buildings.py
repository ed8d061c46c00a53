"""Town houses with recessed windows, balconies, bays and roofs, as in the streets of Karlsruhe."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array
from slam.simulation.mesh import Colour, Mesh, box, joined
from slam.simulation.palette import BRICK, pick, shade
from slam.simulation.town import facades, roofs
from slam.simulation.town.facades import STOREY, Opening, Style

FOOT = 1.5  # walls go so far below the ground, for it may fall

Front = tuple[list[Opening], list[Mesh]]  # the holes in a facade, and what stands out of it

PLASTER: list[Colour] = [(226, 214, 186), (216, 192, 146), (228, 226, 220), (200, 198, 192), (212, 186, 160)]
PLASTER += [(216, 186, 172), (200, 206, 184), (192, 200, 206), (230, 214, 166), (222, 218, 208)]
STONE: list[Colour] = [(176, 134, 114), (200, 186, 158), (228, 226, 220), (170, 166, 158)]  # red and yellow sandstone
FRAME: list[Colour] = [(236, 236, 232), (236, 236, 232), (228, 226, 218), (104, 76, 54), (72, 76, 80)]
LEAF: list[Colour] = [(92, 62, 44), (62, 86, 70), (72, 82, 100), (118, 52, 46), (168, 166, 160)]


def building(rng: np.random.Generator, width: float, depth: float, storeys: int | None = None) -> Mesh:
    """A house on z = 0 whose street facade, `width` along x and centred, faces -y at y = 0; its body goes to y = depth.

    Balconies, bays and steps come forward to y = -1.4 at most, roofs reach EAVES beyond the walls, which go FOOT below
    the ground. `storeys` (1 to 5) is drawn unless a row of houses has to keep one height.
    """
    storeys = storeys or int(rng.choice(5, p=[0.08, 0.24, 0.34, 0.24, 0.1])) + 1
    style = _style(rng)
    eaves = round(style.floor + STOREY * storeys + 0.15, 3)
    columns = int(np.clip(round(width / rng.uniform(2.4, 3.1)), 2, 21 // storeys))
    centres = (np.arange(columns) + 0.5) * width / columns - width / 2
    roof, front_rise, side_rise = roofs.roof(rng, style, width, depth, eaves)
    facade, extras = _street_side(rng, style, width, centres, storeys)
    plain = style._replace(beside="nothing")
    back = facades.wall(rng, plain, width, -FOOT, eaves, front_rise, facades.windows(style, centres, storeys))
    walls = [facades.wall(rng, style, width, -FOOT, eaves, front_rise, facade), back.placed(0, depth, 0, np.pi)]
    for side in (-1, 1):
        few = [o for o in facades.windows(style, np.array([-1.3, 1.3]), storeys) if rng.random() < 0.12]
        wall = facades.wall(rng, plain, depth, -FOOT, eaves, side_rise, few)
        walls.append(wall.placed(side * width / 2, depth / 2, 0, side * np.pi / 2))
    belts = [(0.16, 0.25, eaves - 0.25), (0.1, 0.16, style.floor + STOREY - 0.08)]  # a cornice and a string course
    lines = [box((width, out, high), "concrete", style.trim).placed(0, -out / 2, z) for out, high, z in belts]
    downpipe = box((0.1, 0.1, eaves), "metal", (128, 132, 130)).placed(width / 2 - 0.15, -0.15, 0)
    return joined([*walls, roof, *lines, downpipe, *extras])


def _style(rng: np.random.Generator) -> Style:
    plaster = ("plaster", shade(rng, PLASTER))
    brick, stone = ("brick", shade(rng, BRICK)), shade(rng, STONE)
    wall = plaster if rng.random() < 0.78 else pick(rng, [brick, ("concrete", shade(rng, [(184, 182, 176)]))])
    ground = pick(rng, [wall, wall, wall, ("concrete", stone), brick])
    return Style(
        wall=wall,
        ground=ground,
        plinth=("concrete", shade(rng, [(150, 146, 138), (120, 116, 110), (168, 132, 114)])),
        trim=stone,
        frame=pick(rng, FRAME),
        leaf=shade(rng, LEAF),
        floor=round(rng.uniform(0.3, 0.9), 2),
        recess=rng.uniform(0.13, 0.24),
        glazed=rng.uniform(0.36, 0.5),
        height=round(rng.uniform(1.3, 1.75), 2),
        beside=pick(rng, ["nothing", "nothing", "shutters", "stone"]),
    )


def _street_side(rng: np.random.Generator, style: Style, width: float, centres: Array, storeys: int) -> Front:
    """Windows and doors, and with them a step, balconies or a bay."""
    pitch = width / len(centres)
    doors, extras = _doors(rng, style, width, centres)
    first = int(rng.integers(len(centres)))
    outstanding = pick(rng, ["nothing", "balconies", "balconies", "bay"]) if storeys > 1 else "nothing"
    french = range(first, len(centres), 1 + storeys) if outstanding == "balconies" else range(0)
    windows = [o for o in facades.windows(style, centres, storeys, french) if o.free_of(doors)]
    if outstanding == "balconies":
        rails = pick(rng, [[(0.05, 0.95)], [(z, z + 0.04) for z in (0.2, 0.56, 0.92)]])  # a panel, or bars
        finish = pick(rng, [("metal", style.frame), ("metal", (90, 94, 98)), ("plaster", style.trim)])
        balcony = facades.balcony(min(0.85 * pitch, 3.4), rng.uniform(1.0, 1.4), rails, finish)
        extras += [balcony.placed(centres[i], 0, style.floor + STOREY * n) for i in french for n in range(1, storeys)]
    if outstanding == "bay":
        behind = [o for o in windows if o.left < centres[first] < o.right and o.bottom > STOREY]
        windows = [o for o in windows if o not in behind]
        extras.append(facades.bay(rng, style, centres[first], 0.8 * pitch, style.floor + STOREY * storeys, behind))
    return doors + windows, extras


def _doors(rng: np.random.Generator, style: Style, width: float, centres: Array) -> Front:
    """The entrance with its step, and beside it perhaps a garage."""
    garage = Opening.at(1.9 - width / 2, rng.uniform(2.4, 2.7), 0.02, 2.25)._replace(kind="garage")
    doors = [garage] if width > 7 and rng.random() < 0.3 else []
    entrances = [Opening.at(x, 1.15, 0.15, style.floor + 2.05)._replace(kind="door") for x in centres]
    door = pick(rng, [entrance for entrance in entrances if entrance.free_of(doors)])
    x = (door.left + door.right) / 2
    return [*doors, door], [box((1.5, 0.8, 0.15 + FOOT), "concrete").placed(x, -0.4, -FOOT)]
