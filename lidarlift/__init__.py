"""LiDAR-camera SLAM for low-cost LiDARs: enrichment, odometry, loop closure, a global map and a fair comparison.

Example:
    >>> import lidarlift
    >>> run = lidarlift.run("my_sequence", sensor="vlp16", input="enriched", enricher="ray-segment", out="runs/mine")
    >>> run.poses, run.map  # (N, 4, 4) T_world_lidar after loop closure, and the global map
"""

from __future__ import annotations

from importlib import import_module, metadata
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lidarlift.calibrating import calibrate as calibrate
    from lidarlift.comparing import compare as compare
    from lidarlift.comparing_trajectories import compare_trajectories as compare_trajectories
    from lidarlift.enriching import enrich as enrich
    from lidarlift.evaluating import evaluate as evaluate
    from lidarlift.inspecting import info as info
    from lidarlift.live import Slam as Slam
    from lidarlift.running import run as run
    from slam.config import load_config as load_config
    from slam.data.cloud import Calibration as Calibration
    from slam.data.cloud import PointCloud as PointCloud
    from slam.data.dataset import open_dataset as open_dataset
    from slam.data.errors import InputError as InputError
    from slam.session import save_run as save_run

    __version__: str

#: The module of each public name; it is imported on first use, so that `import lidarlift` is fast.
_PLACES = {
    "Calibration": "slam.data.cloud",
    "InputError": "slam.data.errors",
    "PointCloud": "slam.data.cloud",
    "Slam": "lidarlift.live",
    "calibrate": "lidarlift.calibrating",
    "compare": "lidarlift.comparing",
    "compare_trajectories": "lidarlift.comparing_trajectories",
    "enrich": "lidarlift.enriching",
    "evaluate": "lidarlift.evaluating",
    "info": "lidarlift.inspecting",
    "load_config": "slam.config",
    "open_dataset": "slam.data.dataset",
    "run": "lidarlift.running",
    "save_run": "slam.session",
}
__all__ = ["__version__", *_PLACES]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return metadata.version("lidarlift")
    if name not in _PLACES:
        raise AttributeError(f"module 'lidarlift' has no attribute '{name}'")
    return getattr(import_module(_PLACES[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
