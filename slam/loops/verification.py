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
from slam.loops.submap import submap
from slam.mapping.keyframes import Keyframe
from slam.registration.ndt import NdtTarget
from slam.registration.result import RegistrationResult
from slam.registration.voxels import VoxelFilter, VoxelGaussians
from slam.settings import VerificationSettings

SUBMAP_SIGMA = np.array([0.001] * 3 + [0.03] * 3)  # rad, m: distortion of submaps by odometry drift, not observable
UNREGISTERED = np.diag(np.array([np.pi] * 3 + [100.0] * 3) ** 2)  # covariance without a registration
MIN_SELF_FIT = 0.05  # lower bound of the share of a submap that fits itself: sparser ones would inflate the ratios


@dataclass(frozen=True, eq=False)
class Verification:
    """Result of the verification of a candidate.

    Attributes:
        T_match_query: (4, 4) pose of the query in the frame of the match.
        covariance: (6, 6) covariance of xi in T_match_query @ exp(xi), xi = (rotation [rad], translation [m]):
            registration noise plus distortion of the submaps; meaningful for accepted candidates.
        inlier_ratio: Share of the query's points in common range that fit the match's submap, relative to the share of
            the match's own points that do, so that sparse and dense clouds are comparable.
        overlap: The same with query and match exchanged.
        distinctness: Minimum decrease of the inlier ratio when the query is displaced.
        point_sigma: Standard deviation of the position along its worst direction, per point [m].
        reason: Short reason for the rejection, '' for accepted candidates.
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
        """Whether the candidate is a loop."""
        return not self.reason


class Verifier:
    """Registers and verifies loop candidates. Not thread-safe because of its work memory: use one per thread."""

    def __init__(self, settings: VerificationSettings | None = None) -> None:
        self.settings = settings or VerificationSettings()
        self._thin = VoxelFilter(self.settings.voxel_size)
        self._thin_more = VoxelFilter(self.settings.registration_voxel_size)
        yaw = np.deg2rad(self.settings.search_yaw_deg)
        self._turns = [se3.exp(np.array([0, 0, angle, 0, 0, 0])) for angle in (0.0, -yaw, yaw)]
        self._moves = _disc(self.settings.search_radius, self.settings.search_step)

    def verify(self, keyframes: Sequence[Keyframe], query: int, match: int, guess: Array) -> Verification:
        """Verify that two keyframes are at the same place.

        Args:
            keyframes: All keyframes; those in both submaps affect the result.
            query: Position of the query keyframe.
            match: Position of the matched keyframe.
            guess: Initial T_match_query (4, 4).
        """
        limits = self.settings
        there = self._submap(keyframes, match, limits.match_submap_radius)
        here = self._submap(keyframes, query, limits.query_submap_radius)
        if min(len(there), len(here)) < limits.min_points:
            return Verification(guess, UNREGISTERED)
        place = _target(limits.cell_sizes, there)
        there_cells, here_cells = place.levels[-1], _target(limits.cell_sizes[-1:], here).levels[0]
        found, lead = self._register(place, here, guess)

        T, T_back, still = found.pose, se3.inverse(found.pose), np.eye(4)
        seen_here, seen_there = self._in_common(here, T), self._in_common(there, T_back)
        if min(len(seen_here), len(seen_there)) < limits.min_points:
            return Verification(T, UNREGISTERED)
        at_best = max(_fitting(there_cells, seen_there, still), MIN_SELF_FIT)
        at_best_back = max(_fitting(here_cells, seen_here, still), MIN_SELF_FIT)
        worst = float(np.linalg.eigvalsh(found.covariance[3:, 3:])[-1])
        measures = {
            "inlier_ratio": min(_fitting(there_cells, seen_here, T) / at_best, 1.0),
            "overlap": min(_fitting(here_cells, seen_there, T_back) / at_best_back, 1.0),
            "distinctness": lead / at_best,
            "point_sigma": float(np.sqrt(worst * len(seen_here))),
        }
        covariance = found.covariance + np.diag(SUBMAP_SIGMA**2)
        return Verification(T, covariance, **measures, reason=self._reason(se3.inverse(guess) @ T, **measures))

    def _submap(self, keyframes: Sequence[Keyframe], centre: int, radius: float) -> Array:
        """Downsampled submap (N, 3) float32 in the frame of the keyframe at `centre`."""
        xyz = submap(keyframes, centre, radius, self.settings.max_points)
        return self._thin(xyz, _ones(xyz))[0]

    def _register(self, place: NdtTarget, here: Array, guess: Array) -> tuple[RegistrationResult, float]:
        """Register from the initial pose near the guess with the best score; repeat if a displaced pose fits better.

        Also returns the decrease of the inlier ratio at the best displaced pose.
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
        """Decrease of the inlier ratio at the best of 16 displaced poses, and that pose.

        The first displacement is along the direction that the registration constrains least: the axis of a tunnel.
        """
        some = np.ascontiguousarray(self._in_common(here, found.pose)[::2])
        R = found.pose[:3, :3]
        weakest = np.linalg.eigh((R @ found.H[3:, 3:] @ R.T)[:2, :2])[1][:, 0]
        headings = np.arctan2(weakest[1], weakest[0]) + np.arange(16) * np.pi / 8
        moves = self.settings.distinctness_radius * np.column_stack([np.cos(headings), np.sin(headings)])
        aside = [_moved(found.pose, move) for move in moves]
        fits = [_fitting(cells, some, pose) for pose in aside]
        best = int(np.argmax(fits))
        return _fitting(cells, some, found.pose) - fits[best], aside[best]

    def _in_common(self, xyz: Array, T: Array) -> Array:
        """Points (N, 3) within common range of their own sensor and, transformed by `T` (4, 4), of the other."""
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
    """The pose (4, 4), displaced by (2,) in x and y of the target's frame."""
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
    """Share of the points (N, 3), transformed by `pose` (4, 4), that fit the Gaussian of their cell."""
    _, _, totals = cells.normal_equations(xyz, _ones(xyz), pose, 1, 1.0)
    return float(totals[2] / max(totals[5], 1.0))
