"""Search for the loops of a keyframe: candidates by descriptor, verified by registration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.graph.ledger import LoopCandidate
from slam.loops.scan_context import Candidate, ScanContext, descriptor, levelled, levelled_submap, shifted_descriptors
from slam.loops.verification import Verification, Verifier
from slam.mapping.keyframes import Keyframe
from slam.settings import LoopSettings


class LoopSearch:
    """Stores the places of keyframes and searches for those passed before. Not thread-safe: use one per thread.

    Attributes:
        descriptor: The descriptor (rings, sectors) of the last keyframe that was searched.
    """

    def __init__(self, settings: LoopSettings) -> None:
        self.settings = settings
        self.descriptor = np.zeros((0, 0), np.float32)
        shifts = settings.scan_context.lateral_shifts
        self._own_shift = shifts.index(0.0) if 0.0 in shifts else None  # of the virtual sensors, the sensor itself
        self._places, self._verifier = ScanContext(settings.scan_context), Verifier(settings.verification)

    def __len__(self) -> int:
        return len(self._places)

    def restore(self, descriptors: Array, travelled: Array) -> None:
        """Add the places of keyframes that were searched before: (K, rings, sectors), travelled distances (K,) [m]."""
        self._places.restore(descriptors, travelled)

    def next(self, keyframes: Sequence[Keyframe]) -> list[tuple[LoopCandidate, Verification]]:
        """Search the loops of the next keyframe, the one after the last that was searched.

        Args:
            keyframes: All keyframes so far; those in the submap of the next keyframe should be complete.

        Returns:
            The candidates with their verification, most similar first, up to the first that is accepted.
        """
        query = len(self._places)
        cloud, travelled = self._surroundings(keyframes, query), keyframes[query].travelled
        contexts, own = shifted_descriptors(cloud, self.settings.scan_context), self._own_shift
        candidates = self._places.search(contexts, travelled)[: self.settings.max_candidates]
        self.descriptor = contexts[own] if own is not None else descriptor(cloud, self.settings.scan_context)
        self._places.insert(self.descriptor, travelled)
        found = []
        for candidate in candidates:
            if candidate.distance > self.settings.max_descriptor_distance:
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
        """The joined clouds of a keyframe and of those shortly before it, in its levelled frame."""
        length = self.settings.scan_context.submap_length
        near = [keyframes[last]]
        for position in range(last - 1, -1, -1):
            keyframe = keyframes[position]
            if keyframe.travelled < near[0].travelled - length:
                break
            near.append(keyframe)
        near.reverse()
        poses = np.array([keyframe.pose for keyframe in near])
        travelled = np.array([keyframe.travelled for keyframe in near])
        return levelled_submap([keyframe.cloud.xyz for keyframe in near], poses, travelled, length)


def _guess(match: Array, query: Array, candidate: Candidate) -> Array:
    """Initial T_match_query (4, 4) of a candidate from both odometry poses, since descriptors are levelled."""
    return se3.inverse(match) @ levelled(match) @ candidate.relative_pose @ se3.inverse(levelled(query)) @ query
