"""Whether two places that look alike are one, and where the query lies in the other's frame if they are.

A descriptor's candidate is registered against a submap around the place. It is accepted only if the two submaps fit
each other in both directions, fit worse with the query moved aside, and hold the pose along every axis. Fitness alone
passes wrong loops: the road and the house fronts of one street fit those of the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.loops.submap import submap
from slam.mapping.keyframes import Keyframe
from slam.registration.ndt import NdtTarget
from slam.registration.result import RegistrationResult
from slam.registration.voxels import VoxelFilter, VoxelGaussians
from slam.settings import VerificationSettings

SUBMAP_SIGMA = np.array([0.001] * 3 + [0.03] * 3)  # rad, m: what odometry bends a submap; no registration sees it
REFUSED = np.diag(np.array([np.pi] * 3 + [100.0] * 3) ** 2)  # covariance where nothing was registered
UNALIKE = 0.05  # a submap of which less fits itself is too thin for a ratio to it


@dataclass(frozen=True, eq=False)
class Verification:
    """What the registration of a candidate found.

    T_match_query  (4, 4): the query's pose in the match's frame
    covariance     (6, 6) of T_match_query @ exp(xi), xi = (rotation [rad], translation [m]): the registration's noise
                   and the bending of the submaps; of use where the candidate was accepted
    inlier_ratio   share of the query's points in common range that fit the match's submap, relative to the share of the
                   match's own that do, so that sparse clouds are judged as dense ones are
    overlap        the same the other way round
    distinctness   by how much the inlier ratio falls at least when the query is moved aside
    point_sigma    [m] standard deviation of the position along its worst direction, if one point alone had to tell
    reason         why it was refused, in words for a table; '' where it was accepted
    """

    T_match_query: Array
    covariance: Array
    inlier_ratio: float = 0.0
    overlap: float = 0.0
    distinctness: float = 0.0
    point_sigma: float = float("inf")
    reason: str = "few points"

    @property
    def accepted(self) -> bool:
        return not self.reason


class Verifier:
    """Registers candidates of the loop search and judges them. One per thread: it keeps scratch memory."""

    def __init__(self, settings: VerificationSettings | None = None) -> None:
        self.settings = settings or VerificationSettings()
        self._thin = VoxelFilter(self.settings.voxel_size)
        self._thin_more = VoxelFilter(self.settings.registered_voxel_size)
        yaw = np.deg2rad(self.settings.search_yaw_deg)
        self._turns = [se3.exp(np.array([0, 0, angle, 0, 0, 0])) for angle in (0.0, -yaw, yaw)]
        self._moves = _disc(self.settings.search_radius, self.settings.search_step)

    def verify(self, keyframes: Sequence[Keyframe], query: int, match: int, guess: Array) -> Verification:
        """Are the keyframes at positions `query` and `match` of one place? `guess` (4, 4) is T_match_query.

        All keyframes in reach on the way take part: to repeat a decision, hand over the same ones.
        """
        limits = self.settings
        there = self._submap(keyframes, match, limits.match_reach)
        here = self._submap(keyframes, query, limits.query_reach)
        if min(len(there), len(here)) < limits.min_points:
            return Verification(guess, REFUSED)
        place = _target(limits.cell_sizes, there)
        there_cells, here_cells = place.levels[-1], _target(limits.cell_sizes[-1:], here).levels[0]
        found, lead = self._register(place, here, guess)

        T, T_back, still = found.pose, se3.inverse(found.pose), np.eye(4)
        seen_here, seen_there = self._in_common(here, T), self._in_common(there, T_back)
        if min(len(seen_here), len(seen_there)) < limits.min_points:
            return Verification(T, REFUSED)
        at_best = max(_fitting(there_cells, seen_there, still), UNALIKE)
        at_best_back = max(_fitting(here_cells, seen_here, still), UNALIKE)
        worst = float(np.linalg.eigvalsh(found.covariance[3:, 3:])[-1])
        measures = {
            "inlier_ratio": min(_fitting(there_cells, seen_here, T) / at_best, 1.0),
            "overlap": min(_fitting(here_cells, seen_there, T_back) / at_best_back, 1.0),
            "distinctness": lead / at_best,
            "point_sigma": float(np.sqrt(worst * len(seen_here))),
        }
        covariance = found.covariance + np.diag(SUBMAP_SIGMA**2)
        return Verification(T, covariance, **measures, reason=self._reason(se3.inverse(guess) @ T, **measures))

    def _submap(self, keyframes: Sequence[Keyframe], centre: int, reach: float) -> Array:
        """(N, 3) float32 in the frame of the keyframe at `centre`, thinned."""
        xyz = submap(keyframes, centre, reach, self.settings.max_points)
        return self._thin(xyz, _ones(xyz))[0]

    def _register(self, place: NdtTarget, here: Array, guess: Array) -> tuple[RegistrationResult, float]:
        """From the best start around the guess, as the coarse cells see it; again if a place beside is better.

        Also by how much more of the points fits there than beside it.
        """
        xyz = self._thin_more(here, _ones(here))[0]
        some = np.ascontiguousarray(xyz[::3])
        starts = [_moved(guess @ turn, move) for turn in self._turns for move in self._moves]
        best = max(starts, key=lambda pose: place.score(some, _ones(some), pose))
        found = place.align(xyz, _ones(xyz), best)
        lead, rival = self._compared(place.levels[-1], here, found)
        if lead < 0:
            found = place.align(xyz, _ones(xyz), rival)
            lead, _ = self._compared(place.levels[-1], here, found)
        return found, lead

    def _compared(self, cells: VoxelGaussians, here: Array, found: RegistrationResult) -> tuple[float, Array]:
        """By how much more of the points in common fits than with them moved aside, and the best of the poses aside.

        The first of the directions is the one that the registration holds least: a tunnel's axis.
        """
        some = np.ascontiguousarray(self._in_common(here, found.pose)[::2])
        R = found.pose[:3, :3]
        weakest = np.linalg.eigh((R @ found.H[3:, 3:] @ R.T)[:2, :2])[1][:, 0]
        headings = np.arctan2(weakest[1], weakest[0]) + np.arange(16) * np.pi / 8
        moves = self.settings.distinct_radius * np.column_stack([np.cos(headings), np.sin(headings)])
        aside = [_moved(found.pose, move) for move in moves]
        fits = [_fitting(cells, some, pose) for pose in aside]
        best = int(np.argmax(fits))
        return _fitting(cells, some, found.pose) - fits[best], aside[best]

    def _in_common(self, xyz: Array, T: Array) -> Array:
        """Of points (N, 3) those in range of their own sensor and, moved by `T` (4, 4), of the other."""
        moved = xyz @ T[:3, :3].T.astype(np.float32) + T[:3, 3].astype(np.float32)
        near = np.maximum((xyz**2).sum(axis=1), (moved**2).sum(axis=1)) < self.settings.common_range**2
        return np.asarray(xyz[near])

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
    """The pose (4, 4), moved by (2,) in x and y of the target's frame."""
    result = pose.copy()
    result[:2, 3] += move
    return result


def _ones(xyz: Array) -> Array:
    return np.ones(len(xyz), np.float32)


def _target(cell_sizes: Sequence[float], xyz: Array) -> NdtTarget:
    target = NdtTarget(cell_sizes)
    target.insert(xyz, _ones(xyz), np.eye(4))
    return target


def _fitting(cells: VoxelGaussians, xyz: Array, pose: Array) -> float:
    """Share of the points (N, 3), moved by `pose` (4, 4), that meet a Gaussian and fit it."""
    _, _, totals = cells.normal_equations(xyz, _ones(xyz), pose, 1, 1.0)
    return float(totals[2] / max(totals[5], 1.0))
