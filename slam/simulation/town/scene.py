"""A town around a drive, with its traffic."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from slam.simulation.driven_scene import DrivenScene
from slam.simulation.town.town import Town
from slam.simulation.town.traffic import TownTraffic


class TownScene(DrivenScene):
    """See `Scene`."""

    @cached_property
    def standing(self) -> Town:
        """The town itself."""
        return Town(self.drive, self.terrain, self.seed)

    @cached_property
    def traffic(self) -> TownTraffic:
        """Cars and people."""
        return TownTraffic.of(self.drive, self.standing, np.random.default_rng([self.seed, 2]))
