"""Segments of a run: where the odometry lost its way, it began again, and only loops tell where that was."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.data.cloud import Array
from slam.graph.pose_graph import Edge

#: Added to the travelled distance [m] at a new segment, so that no submap and no "same visit" reaches across.
SEGMENT_DISTANCE = 1000.0
GAP_COVARIANCE = np.diag(np.array([np.pi] * 3 + [300.0] * 3) ** 2)  # rad^2, m^2: the edge between segments says nothing


def segment_starts(odometry: Sequence[Edge]) -> list[int]:
    """Return the keyframes at which segments begin, without the first segment, in order."""
    return [edge.j for edge in odometry if edge.covariance[5, 5] >= GAP_COVARIANCE[5, 5]]


def unjoined(starts: Sequence[int], loops: Sequence[Edge]) -> list[int]:
    """Return the segments, from 1, that no accepted loops join to the first one (0), directly or by others."""
    reached, before = {0}, 0
    pairs = [tuple(int(np.searchsorted(starts, place, "right")) for place in (loop.i, loop.j)) for loop in loops]
    while len(reached) > before:
        before = len(reached)
        reached.update(segment for pair in pairs if reached & set(pair) for segment in pair)
    return [segment for segment in range(1, len(starts) + 1) if segment not in reached]


def segments_note(starts: Sequence[int], frames: Array, joined_not: Sequence[int]) -> str:
    """Say where segments begin and which are joined; '' for a single one.

    Args:
        starts: As from `segment_starts`.
        frames: (K,) numbers of the keyframes' frames in the data set.
        joined_not: As from `unjoined`.
    """
    if not starts:
        return ""
    places = ", ".join(str(frames[start]) for start in starts)
    note = f"the odometry lost its way and began new segments at frames {places}"
    if not joined_not:
        return f"{note}; loop closures join all segments"
    apart = ", ".join(str(frames[starts[segment - 1]]) for segment in joined_not)
    return (
        f"{note}; no loop closure joins those from frames {apart}: where they lie relative to the others is unknown, "
        "and trajectory and map show them as if the sensor had moved on"
    )
