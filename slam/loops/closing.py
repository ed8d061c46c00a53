"""Search for the loops of a keyframe: candidates by descriptor, verified by registration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.graph.ledger import LoopCandidate
from slam.loops.known_places import KnownPlaces
from slam.loops.scan_context import Candidate, ScanContext, descriptor, levelled, levelled_submap, shifted_descriptors
from slam.loops.verification import Verification, Verifier
from slam.mapping.keyframes import Keyframe
from slam.settings import KeyframeSettings, LoopSettings


class LoopSearch:
    """Stores the places of keyframes and searches for those passed before. Not thread-safe: use one per thread.

    Keyframes at known places are not stored: the keyframes of earlier visits are found there.

    Args:
        settings: Settings of the search.
        keyframes: Settings of the keyframes.

    Attributes:
        descriptor: The descriptor (rings, sectors) of the last keyframe that was searched; None at a known place.
    """

    def __init__(self, settings: LoopSettings, keyframes: KeyframeSettings | None = None) -> None:
        self.settings = settings
        self.descriptor: Array | None = None
        self._known = KnownPlaces(keyframes or KeyframeSettings())
        self._numbers: list[int] = []  # of the keyframes whose places are stored
        self._searched = 0
        shifts = settings.scan_context.lateral_shifts
        self._own_shift = shifts.index(0.0) if 0.0 in shifts else None  # of the virtual sensors, the sensor itself
        self._places, self._verifier = ScanContext(settings.scan_context), Verifier(settings.verification)

    def __len__(self) -> int:
        return self._searched

    def restore(
        self,
        descriptors: Sequence[Array | None],
        poses: Array,
        travelled: Sequence[float],
        loops: Mapping[int, tuple[int, Array]],
    ) -> None:
        """Add the places of keyframes that were searched before.

        Args:
            descriptors: As `descriptor`, of each keyframe.
            poses: (K, 4, 4) T_world_keyframe by the odometry, of these and perhaps more.
            travelled: Travelled distances [m].
            loops: Verified loops of keyframes: the match, and T_match_query (4, 4).

        Raises:
            ValueError: The places contradict the loops.
        """
        for number, (context, distance) in enumerate(zip(descriptors, travelled, strict=True)):
            known = self._known.add(number, poses[number], distance, loops.get(number))
            if known != (context is None):
                raise ValueError(f"place {number} is {'' if known else 'not '}known by its loops")
            self._keep(context, distance)

    def next(self, keyframes: Sequence[Keyframe]) -> list[tuple[LoopCandidate, Verification]]:
        """Search the loops of the next keyframe, the one after the last that was searched.

        Args:
            keyframes: All keyframes so far; those in the submap of the next keyframe should be complete.

        Returns:
            The candidates with their verification, most similar first, up to the first that is accepted.
        """
        query = self._searched
        cloud, travelled, pose = self._surroundings(keyframes, query), keyframes[query].travelled, keyframes[query].pose
        contexts, own = shifted_descriptors(cloud, self.settings.scan_context), self._own_shift
        candidates = self._places.search(contexts, travelled)[: self.settings.max_candidates]
        found = []
        for candidate in candidates:
            if candidate.distance > self.settings.max_descriptor_distance:
                break
            match = self._numbers[candidate.index]
            guess = _guess(keyframes[match].pose, pose, candidate)
            verification = self._verifier.verify(keyframes, query, match, guess)
            loop = LoopCandidate(
                match, query, verification.T_match_query, candidate.distance, candidate.yaw,
                verification.inlier_ratio, verification.overlap,
            )  # fmt: skip
            found.append((loop, verification))
            if verification.accepted:
                break
        closed = (found[-1][0].i, found[-1][0].pose) if found and found[-1][1].accepted else None
        if self._known.add(query, pose, travelled, closed):
            self.descriptor = None
        else:
            self.descriptor = contexts[own] if own is not None else descriptor(cloud, self.settings.scan_context)
        self._keep(self.descriptor, travelled)
        return found

    def _keep(self, context: Array | None, travelled: float) -> None:
        """Store the place of the next keyframe, unless it is known."""
        if context is not None:
            self._places.insert(context, travelled)
            self._numbers.append(self._searched)
        self._searched += 1

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
