"""Licence of recordings, as far as it can be inferred from their folder."""

from __future__ import annotations

from slam.data.dataset import Dataset
from slam.data.kitti import KittiSequence

SIMULATED = "simulated by lidarlift"
KITTI = "KITTI, CC BY-NC-SA 3.0"
OWN = "not known to lidarlift: that of the recordings"


def licence_of(data: Dataset) -> str:
    """Return SIMULATED, KITTI or OWN."""
    if (data.path.parent.parent / "simulation.json").is_file():
        return SIMULATED
    return KITTI if isinstance(data, KittiSequence) and "kitti" in data.name.lower() else OWN
