"""Random choice of colours and variants."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from slam.simulation.mesh import Colour

BRICK: list[Colour] = [(150, 88, 70), (166, 104, 80), (130, 80, 68)]  # of walls and chimneys

Choice = TypeVar("Choice")


def pick(rng: np.random.Generator, choices: Sequence[Choice]) -> Choice:
    """Draw one of the choices uniformly."""
    return choices[int(rng.integers(len(choices)))]


def shade(rng: np.random.Generator, colours: Sequence[Colour]) -> Colour:
    """Draw one of the colours, with a small random change of brightness and hue."""
    shade = np.array(pick(rng, colours)) * rng.uniform(0.93, 1.07) + rng.uniform(-5, 5, 3)
    red, green, blue = np.clip(shade, 0, 255).astype(int).tolist()
    return red, green, blue
