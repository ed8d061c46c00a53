"""Verification of loop candidates: whether two similar places are the same, and their relative pose.

A candidate is registered against a submap around the matched place. It is accepted if the two submaps fit each other in
both directions, fit worse when the query is displaced, and constrain the pose along every axis. The inlier ratio alone
accepts false loops: the road and the facades of one street fit those of the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.loops.submap import IDENTITY, Level, Submap, Submaps, ones, squared_norms
from slam.mapping.keyframes import Keyframe
from slam.registration.result import RegistrationResult
from slam.settings import VerificationSettings

SUBMAP_SIGMA = np.array([0.001] * 3 + [0.03] * 3)  # rad, m: distortion of submaps by odometry drift, not observable
UNREGISTERED = np.diag(np.array([np.pi] * 3 + [100.0] * 3) ** 2)  # covariance without a registration
KEPT_MATCHES, KEPT_QUERIES = 32, 1  # submaps that are kept: half a megabyte each, 2 MB with the finest cells
START_POINTS = 500  # of the query, roughly, that choose among the initial poses
MIN_SELF_FIT = 0.05  # lower bound of the share of a submap that fits itself: sparser ones would inflate the ratios


@dataclass(frozen=True, eq=False)
class Verification:
    """Result of the verification of a candidate.

    Attributes:
        T_match_query: (4, 4) pose of the query in the frame of the match.
        covariance: (6, 6) covariance of xi in T_match_query @ exp(xi), xi = (rotation [rad], translation [m]):
            registration noise plus distortion of the submaps; meaningful for accepted candidates.
        inlier_ratio: Share of the query's points in common range that fit the match's submap, relative to the share of
            the match's own points that do, so that sparse and dense clouds are comparable. NaN, as the next two, for
            candidates that were rejected before it was measured.
        overlap: The same with query and match exchanged.
        distinctness: Minimum decrease of the inlier ratio when the query is displaced.
        point_sigma: Standard deviation of the position along its worst direction, per point [m].
        reason: Short reason for the rejection, '' for accepted candidates.
    """

    T_match_query: Array
    covariance: Array
    inlier_ratio: float = float("nan")
    overlap: float = float("nan")
    distinctness: float = float("nan")
    point_sigma: float = float("inf")
    reason: str = "few points"

    @property
    def accepted(self) -> bool:
        """Whether the candidate is a loop."""
        return not self.reason


class Verifier:
    """Registers and verifies loop candidates of one run, whose submaps it keeps for the next candidates.

    Not thread-safe because of its work memory: use one per thread.
    """

    def __init__(self, settings: VerificationSettings | None = None) -> None:
        self.settings = settings or VerificationSettings()
        self._matches = Submaps(self.settings, self.settings.match_submap_radius, KEPT_MATCHES)
        self._queries = Submaps(self.settings, self.settings.query_submap_radius, KEPT_QUERIES)
        yaw = np.deg2rad(self.settings.search_yaw_deg)
        self._turns = [se3.exp(np.array([0, 0, angle, 0, 0, 0])) for angle in (0.0, -yaw, yaw)]
        self._moves = _disc(self.settings.search_radius, self.settings.search_step)

    def verify(self, keyframes: Sequence[Keyframe], query: int, match: int, guess: Array) -> Verification:
        """Verify that two keyframes are at the same place.

        Args:
            keyframes: All keyframes so far, of the same run in every call; those in both submaps affect the result.
            query: Position of the query keyframe.
            match: Position of the matched keyframe.
            guess: Initial T_match_query (4, 4).
        """
        limits = self.settings
        there, here = self._matches.around(keyframes, match), self._queries.around(keyframes, query)
        if min(len(there), len(here)) < limits.min_points:
            return Verification(guess, UNREGISTERED)
        start = self._best_start(there, here, guess)
        for number in range(there.levels - 1):
            level = there.level(number)
            start = level.target.approach(here.sparse, ones(here.sparse), start)
            # only in the coarsest cells: a pose that is off may score low in the next ones, and a displaced one high
            if number == 0 and level.similarity(here.sparse, start) < limits.min_coarse_score:
                return Verification(start, UNREGISTERED, reason="low coarse score")
        found, lead = self._register(there, here, start)
        verification = self._judged(there, here, found, lead, guess)
        there.forget_fine_levels()
        return verification

    def _best_start(self, there: Submap, here: Submap, guess: Array) -> Array:
        """The initial pose (4, 4) near the guess with the best score in the coarsest cells."""
        starts = np.array([_moved(guess @ turn, move) for turn in self._turns for move in self._moves])
        some = np.ascontiguousarray(here.sparse[:: len(here.sparse) // START_POINTS + 1])
        return np.asarray(starts[there.level(0).scores(some, starts).argmax()])

    def _register(self, there: Submap, here: Submap, start: Array) -> tuple[RegistrationResult, float]:
        """Register in the finest cells; repeat in all cells if a displaced pose fits better.

        Also returns the decrease of the inlier ratio at the best displaced pose.
        """
        finest = there.level(-1)
        found = finest.target.align(here.sparse, ones(here.sparse), start)
        lead, rival = self._compared(finest, here, found)
        if lead < 0:
            for number in range(there.levels - 1):
                rival = there.level(number).target.approach(here.sparse, ones(here.sparse), rival)
            found = finest.target.align(here.sparse, ones(here.sparse), rival)
            lead, _ = self._compared(finest, here, found)
        return found, lead

    def _compared(self, finest: Level, here: Submap, found: RegistrationResult) -> tuple[float, Array]:
        """Decrease of the inlier ratio at the best of 16 displaced poses, and that pose.

        The first displacement is along the direction that the registration constrains least: the axis of a tunnel.
        """
        some = np.ascontiguousarray(self._in_common(here, found.pose)[::2])
        R = found.pose[:3, :3]
        weakest = np.linalg.eigh((R @ found.H[3:, 3:] @ R.T)[:2, :2])[1][:, 0]
        headings = np.arctan2(weakest[1], weakest[0]) + np.arange(16) * np.pi / 8
        moves = self.settings.distinctness_radius * np.column_stack([np.cos(headings), np.sin(headings)])
        poses = np.array([found.pose, *(_moved(found.pose, move) for move in moves)])
        fits = finest.inlier_ratios(some, poses)
        best = 1 + int(fits[1:].argmax())
        return float(fits[0] - fits[best]), poses[best]

    def _judged(
        self, there: Submap, here: Submap, found: RegistrationResult, lead: float, guess: Array
    ) -> Verification:
        """Measure how well the submaps fit each other at the registered pose, and decide."""
        T, T_back = found.pose, se3.inverse(found.pose)
        seen_here, seen_there = self._in_common(here, T), self._in_common(there, T_back)
        points = len(seen_here) * here.near_step
        if min(points, len(seen_there) * there.near_step) < self.settings.min_points:
            return Verification(T, UNREGISTERED)
        cells, cells_back = there.level(-1), here.level(-1)
        at_best = max(_fitting(cells, seen_there, IDENTITY), MIN_SELF_FIT)
        at_best_back = max(_fitting(cells_back, seen_here, IDENTITY), MIN_SELF_FIT)
        worst = float(np.linalg.eigvalsh(found.covariance[3:, 3:])[-1])
        measures = {
            "inlier_ratio": min(_fitting(cells, seen_here, T) / at_best, 1.0),
            "overlap": min(_fitting(cells_back, seen_there, T_back) / at_best_back, 1.0),
            "distinctness": lead / at_best,
            "point_sigma": float(np.sqrt(worst * points)),
        }
        covariance = found.covariance + np.diag(SUBMAP_SIGMA**2)
        return Verification(T, covariance, **measures, reason=self._reason(se3.inverse(guess) @ T, **measures))

    def _in_common(self, submap: Submap, T: Array) -> Array:
        """Points (N, 3) within common range of their own sensor and, transformed by `T` (4, 4), of the other."""
        moved = submap.near @ T[:3, :3].T.astype(np.float32) + T[:3, 3].astype(np.float32)
        return np.asarray(submap.near[squared_norms(moved) < self.settings.common_range**2])

    def _reason(
        self, correction: Array, inlier_ratio: float, overlap: float, distinctness: float, point_sigma: float
    ) -> str:
        limits = self.settings
        moved, turned = float(np.linalg.norm(correction[:3, 3])), float(np.rad2deg(se3.angle(correction)))
        if moved > limits.max_correction or turned > limits.max_correction_deg:
            return "far from guess"
        if inlier_ratio < limits.min_inlier_ratio:
            return "few inliers"
        if overlap < limits.min_overlap:
            return "low overlap"
        if distinctness < limits.min_distinctness:
            return "ambiguous"
        return "degenerate" if not 0 < point_sigma <= limits.max_point_sigma else ""


def _disc(radius: float, step: float) -> Array:
    """(M, 2) grid points in a disc around the origin."""
    steps = step * np.arange(-int(radius / step + 1e-9), int(radius / step + 1e-9) + 1)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    return np.asarray(grid[np.hypot(*grid.T) <= radius + 1e-9])


def _moved(pose: Array, move: Array) -> Array:
    """The pose (4, 4), displaced by (2,) in x and y of the target's frame."""
    result = pose.copy()
    result[:2, 3] += move
    return result


def _fitting(level: Level, xyz: Array, pose: Array) -> float:
    """Share of the points (N, 3), transformed by `pose` (4, 4), that fit the Gaussian of their cell."""
    return float(level.inlier_ratios(xyz, pose[None])[0])
