"""Submap of a keyframe: its cloud and those of the neighbouring keyframes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.mapping.keyframes import Keyframe


def submap(keyframes: Sequence[Keyframe], centre: int, radius: float, max_points: int) -> Array:
    """Join the clouds of keyframes around a centre, by their odometry poses: drift is negligible over this distance.

    Args:
        keyframes: All keyframes.
        centre: Position of the central keyframe.
        radius: Travelled distance [m] before and after the centre.
        max_points: Maximum number of points per keyframe; larger clouds are reduced to every second, third ... point.

    Returns:
        Points (N, 3) float32 in the frame of the central keyframe.
    """
    here = keyframes[centre]
    T_here_world = se3.inverse(here.pose)
    clouds = []
    for keyframe in [here, *_neighbours(keyframes, centre, here.travelled, radius)]:
        T = (T_here_world @ keyframe.pose).astype(np.float32)
        xyz = keyframe.cloud.xyz[:: len(keyframe.cloud) // max_points + 1]
        clouds.append(xyz @ T[:3, :3].T + T[:3, 3])
    return np.concatenate(clouds)


def _neighbours(keyframes: Sequence[Keyframe], centre: int, travelled: float, radius: float) -> list[Keyframe]:
    """Keyframes before and after the centre; each is fetched once, since its cloud may be on disk."""
    found = []
    for positions in (range(centre - 1, -1, -1), range(centre + 1, len(keyframes))):
        for position in positions:
            keyframe = keyframes[position]
            if abs(keyframe.travelled - travelled) > radius:
                break
            found.append(keyframe)
    return found
