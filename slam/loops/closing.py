"""Search for the loops of a keyframe: candidates by descriptor, verified by registration."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.graph.ledger import LoopCandidate
from slam.graph.pose_graph import Edge
from slam.loops.known_places import KnownPlaces
from slam.loops.odometry_bound import OdometryBound
from slam.loops.scan_context import (
    Candidate,
    ScanContext,
    descriptor,
    highest_points,
    levelled,
    levelled_submap,
    shifted_descriptors,
)
from slam.loops.verification import Verification, Verifier
from slam.mapping.keyframes import Keyframes, SomeKeyframes
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
        self._searched = self._released = 0
        shifts = settings.scan_context.lateral_shifts
        self._own_shift = shifts.index(0.0) if 0.0 in shifts else None  # of the virtual sensors, the sensor itself
        self._places, self._verifier = ScanContext(settings.scan_context), Verifier(settings.verification)
        self._bound = OdometryBound()
        self._highest: dict[int, Array] = {}  # points of the last submap, by keyframe: the next one has most of them

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

    def next(
        self, keyframes: SomeKeyframes | Keyframes, odometry: Sequence[Edge]
    ) -> list[tuple[LoopCandidate, Verification]]:
        """Search the loops of the next keyframe, the one after the last that was searched.

        Args:
            keyframes: All keyframes so far; those in the submap of the next keyframe should be complete.
            odometry: The motions from each of them to the next.

        Returns:
            The candidates that the odometry does not exclude with their verification, most similar first, up to the
            first that is accepted.
        """
        query, place = self._searched, keyframes.place(self._searched)
        cloud, own = self._surroundings(keyframes, query), self._own_shift
        contexts = shifted_descriptors(cloud, self.settings.scan_context)
        candidates = self._places.search(contexts, place.travelled)
        self._bound.extend(odometry)
        found: list[tuple[LoopCandidate, Verification]] = []
        for candidate in candidates:
            if candidate.distance > self.settings.max_descriptor_distance or len(found) == self.settings.max_candidates:
                break
            match = self._numbers[candidate.index]
            if not self._bound.allows(match, query, self.settings.verification.max_correction):
                continue
            guess = _guess(keyframes.place(match).pose, place.pose, candidate)
            verification = self._verifier.verify(keyframes, query, match, guess)
            loop = LoopCandidate(
                match, query, verification.T_match_query, candidate.distance, candidate.yaw,
                verification.inlier_ratio, verification.overlap,
            )  # fmt: skip
            found.append((loop, verification))
            if verification.accepted:
                break
        closed = (found[-1][0].i, found[-1][0].pose) if found and found[-1][1].accepted else None
        if self._known.add(query, place.pose, place.travelled, closed):
            self.descriptor = None
        else:
            self.descriptor = contexts[own] if own is not None else descriptor(cloud, self.settings.scan_context)
        self._keep(self.descriptor, place.travelled)
        return found

    def released(self, keyframes: SomeKeyframes | Keyframes) -> Iterator[int]:
        """Yield the keyframes, each once, whose clouds no later search reads.

        These are the keyframes at known places that are in no submap of a keyframe that can be found, nor of one that
        is still to be searched, nor the next one to such a submap, which is read too.
        """
        settings, stored = self.settings, self._numbers
        radii = settings.verification.match_submap_radius, settings.verification.query_submap_radius
        reach = max(*radii, settings.scan_context.submap_length)
        last = keyframes.place(self._searched - 1).travelled if self._searched else 0.0
        while self._released + 1 < self._searched:
            number = self._released
            before, after = (keyframes.place(max(number + step, 0)).travelled for step in (-1, 1))
            if after + reach >= last:
                break
            k = bisect_left(stored, number)
            gaps = [before - keyframes.place(one).travelled for one in stored[max(k - 1, 0) : k]]
            gaps += [keyframes.place(one).travelled - after for one in stored[k : k + 1]]
            if all(gap > reach for gap in gaps):
                yield number
            self._released += 1

    def _keep(self, context: Array | None, travelled: float) -> None:
        """Store the place of the next keyframe, unless it is known."""
        if context is not None:
            self._places.insert(context, travelled)
            self._numbers.append(self._searched)
        self._searched += 1

    def _surroundings(self, keyframes: SomeKeyframes | Keyframes, last: int) -> Array:
        """The highest points of a keyframe and of those shortly before it, joined, in its levelled frame."""
        settings, first = self.settings.scan_context, last
        begin = keyframes.place(last).travelled - settings.submap_length
        while first > 0 and keyframes.place(first - 1).travelled >= begin:
            first -= 1
        before, self._highest = self._highest, {}
        for position in range(first, last + 1):
            known = before.get(position)
            self._highest[position] = (
                highest_points(keyframes[position].cloud.xyz, settings) if known is None else known
            )
        places = [keyframes.place(position) for position in self._highest]
        poses, travelled = np.array([place.pose for place in places]), np.array([place.travelled for place in places])
        return levelled_submap(list(self._highest.values()), poses, travelled, settings.submap_length)


def _guess(match: Array, query: Array, candidate: Candidate) -> Array:
    """Initial T_match_query (4, 4) of a candidate from both odometry poses, since descriptors are levelled."""
    return se3.inverse(match) @ levelled(match) @ candidate.relative_pose @ se3.inverse(levelled(query)) @ query
