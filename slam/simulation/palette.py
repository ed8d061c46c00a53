"""How a part of the town gets its colours, and whatever else is one of several."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from slam.simulation.mesh import Colour

BRICK: list[Colour] = [(150, 88, 70), (166, 104, 80), (130, 80, 68)]  # of walls and chimneys

Choice = TypeVar("Choice")


def pick(rng: np.random.Generator, choices: Sequence[Choice]) -> Choice:
    """One of them, all equally likely."""
    return choices[int(rng.integers(len(choices)))]


def shade(rng: np.random.Generator, colours: Sequence[Colour]) -> Colour:
    """One of them, a little lighter or darker, warmer or colder."""
    shade = np.array(pick(rng, colours)) * rng.uniform(0.93, 1.07) + rng.uniform(-5, 5, 3)
    red, green, blue = np.clip(shade, 0, 255).astype(int).tolist()
    return red, green, blue
