"""The surroundings of a keyframe: its cloud and those of its neighbours on the way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.mapping.keyframes import Keyframe


def submap(keyframes: Sequence[Keyframe], centre: int, reach: float, max_points: int) -> Array:
    """Points (N, 3) float32 of the keyframe at position `centre` and of those up to `reach` [m] of way from it.

    They stand in the centre's frame, each keyframe placed by its own odometry pose: over so short a way it does not
    drift. Of a cloud with more than `max_points`, every second, third ... point is taken.
    """
    here = keyframes[centre]
    T_here_world = se3.inverse(here.pose)
    clouds = []
    for keyframe in [here, *_neighbours(keyframes, centre, here.way, reach)]:
        T = (T_here_world @ keyframe.pose).astype(np.float32)
        xyz = keyframe.cloud.xyz[:: len(keyframe.cloud) // max_points + 1]
        clouds.append(xyz @ T[:3, :3].T + T[:3, 3])
    return np.concatenate(clouds)


def _neighbours(keyframes: Sequence[Keyframe], centre: int, way: float, reach: float) -> list[Keyframe]:
    """Those before and those after; each is fetched once, for its cloud may lie on disk."""
    found = []
    for positions in (range(centre - 1, -1, -1), range(centre + 1, len(keyframes))):
        for position in positions:
            keyframe = keyframes[position]
            if abs(keyframe.way - way) > reach:
                break
            found.append(keyframe)
    return found
