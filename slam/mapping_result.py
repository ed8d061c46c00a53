"""Result of mapping: keyframes, loops, the graph and the map, and the poses of all frames that follow from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.graph.back_end import BackEnd
from slam.graph.ledger import LoopRecord
from slam.graph.pose_graph import PoseGraph
from slam.mapping.keyframes import Keyframes, SomeKeyframes
from slam.segments import segment_starts, segments_note, unjoined


@dataclass(frozen=True, eq=False)
class MappingResult:
    """Result of mapping.

    Attributes:
        poses: (K, 4, 4) T_world_keyframe, optimised.
        keyframes: The keyframes, with odometry poses; those of the map, at least, have their clouds.
        ledger: Records of all loop candidates.
        graph: Optimised poses, odometry edges and accepted loop edges.
        map: Map from the optimised poses, without moving objects.
        known: Keyframes at known places, which are not in the map; their poses are those of their loops.
    """

    poses: Array
    keyframes: Keyframes
    ledger: Sequence[LoopRecord]
    graph: PoseGraph
    map: PointCloud
    known: Array

    @property
    def loops(self) -> int:
        """Number of accepted loops."""
        return sum(record.status == "accepted" for record in self.ledger)

    def corrected(self, poses: Array) -> Array:
        """Correct odometry poses (N, 4, 4) of frames 0, 1 .. by the corrections of the keyframes before and after."""
        if not self.loops:
            return poses
        indices = self.keyframes.indices
        return corrected_poses(poses, indices, self.keyframes.poses, self.poses, indices[self._starts].tolist())

    def segments_note(self, frames: Array) -> str:
        """Say where the odometry began new segments, and which of them loops join; '' for a single one.

        Args:
            frames: (N,) numbers of the run's frames in the data set.
        """
        loops = self.graph.edges[len(self.poses) - 1 :] if len(self.poses) else ()
        return segments_note(self._starts, frames[self.keyframes.indices], unjoined(self._starts, loops))

    @property
    def _starts(self) -> list[int]:
        return segment_starts(self.graph.edges[: max(len(self.poses) - 1, 0)])


@dataclass(frozen=True, eq=False)
class LoopProgress:
    """The loops that are closed so far, before they are selected jointly at the end.

    Attributes:
        indices: (K,) positions in the run of the keyframes so far.
        odometry: (K, 4, 4) their odometry poses T_world_keyframe.
        optimised: (K, 4, 4) the poses with the loops.
        loops: Positions in the run of the two frames of each loop, the earlier one first.
    """

    indices: Array
    odometry: Array
    optimised: Array
    loops: tuple[tuple[int, int], ...]

    def corrected(self, poses: Array) -> Array:
        """Correct odometry poses (N, 4, 4) of frames 0, 1 .., as `corrected_poses`."""
        return corrected_poses(poses, self.indices, self.odometry, self.optimised)


def corrected_poses(
    poses: Array, indices: Array, keyframes: Array, optimised: Array, starts: Sequence[int] = ()
) -> Array:
    """Correct the poses of frames by the optimised poses of their keyframes.

    The odometry gives the pose of a frame relative to the keyframe before and to the one after; the corrected pose
    interpolates between the two, by the number of frames to each. A keyframe gets its optimised pose. The interpolation
    is done in the keyframes' axes, so it does not depend on the world's origin.

    Args:
        poses: (N, 4, 4) odometry poses of frames 0, 1 ..
        indices: (K,) frames of the keyframes, increasing.
        keyframes: (K, 4, 4) odometry poses of the keyframes.
        optimised: (K, 4, 4) optimised poses of the keyframes.
        starts: Frames at which new segments begin, each with a keyframe: nothing is interpolated across.

    Returns:
        (N, 4, 4). Frames before the first or after the last keyframe of a segment move rigidly with it.
    """
    if len(starts):
        parts = []
        for begin, end in pairwise((0, *starts, len(poses))):
            inside = (indices >= begin) & (indices < end)
            own = (indices[inside] - begin, keyframes[inside], optimised[inside])
            parts.append(corrected_poses(poses[begin:end], *own))
        return np.concatenate(parts)
    before, after, share = se3.neighbours(indices, np.arange(len(poses)))
    start, end = (optimised[near] @ (se3.inverse(keyframes[near]) @ poses) for near in (before, after))
    return se3.blend(start, end, share)


def mapped(keyframes: Keyframes, poses: Array, back_end: BackEnd) -> tuple[SomeKeyframes, Array]:
    """Return the keyframes that the map is built from, with their poses: all but those at known places.

    Args:
        keyframes: All keyframes.
        poses: (K, 4, 4) T_world_keyframe.
        back_end: Knows the places.
    """
    positions = [number for number in range(len(poses)) if number not in back_end.known]
    return SomeKeyframes(keyframes, positions), poses[positions]
