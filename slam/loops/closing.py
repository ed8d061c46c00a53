"""From a keyframe to the loop that it closes: places alike, and which of them is the same."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.graph.ledger import LoopCandidate
from slam.loops.scan_context import Candidate, ScanContext, levelled, levelled_submap
from slam.loops.verification import Verification, Verifier
from slam.mapping.keyframes import Keyframe
from slam.settings import LoopSettings


class LoopSearch:
    """Remembers the keyframes' places and looks for those that have been passed before. One per thread."""

    def __init__(self, settings: LoopSettings) -> None:
        self.settings = settings
        self._places, self._verifier = ScanContext(settings.scan_context), Verifier(settings.verification)

    def __len__(self) -> int:
        return len(self._places)

    def next(self, keyframes: Sequence[Keyframe]) -> list[tuple[LoopCandidate, Verification]]:
        """The candidates for the keyframe after the last that was looked for, most alike first, up to the first that is
        verified. All keyframes within the verification's reach should be there."""
        query = len(self._places)
        cloud, way = self._surroundings(keyframes, query), keyframes[query].way
        candidates = self._places.query(cloud, way)[: self.settings.candidates]
        self._places.add(cloud, way)
        found = []
        for candidate in candidates:
            if candidate.distance > self.settings.max_distance:
                break
            match = candidate.index
            guess = _guess(keyframes[match].pose, keyframes[query].pose, candidate)
            verification = self._verifier.verify(keyframes, query, match, guess)
            loop = LoopCandidate(
                match, query, verification.T_match_query, candidate.distance, candidate.yaw,
                verification.inlier_ratio, verification.overlap,
            )  # fmt: skip
            found.append((loop, verification))
            if verification.accepted:
                break
        return found

    def _surroundings(self, keyframes: Sequence[Keyframe], last: int) -> Array:
        """The clouds of a keyframe and of those shortly before it, in its levelled frame."""
        length = self.settings.scan_context.submap_length
        near = [keyframes[last]]
        for position in range(last - 1, -1, -1):
            keyframe = keyframes[position]
            if keyframe.way < near[0].way - length:
                break
            near.append(keyframe)
        near.reverse()
        poses, way = np.array([keyframe.pose for keyframe in near]), np.array([keyframe.way for keyframe in near])
        return levelled_submap([keyframe.cloud.xyz for keyframe in near], poses, way, length)


def _guess(match: Array, query: Array, candidate: Candidate) -> Array:
    """T_match_query (4, 4) of a candidate, from the odometry's poses of the two: descriptors are levelled."""
    return se3.inverse(match) @ levelled(match) @ candidate.relative_pose @ se3.inverse(levelled(query)) @ query
