"""Pose graphs to try the back end on, and false loops for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from benchmarks.loops.gtsam_solvers import clean_optimum
from eval.trajectory import ate, distances
from slam.data import se3
from slam.data.cloud import Array
from slam.data.pose_files import read_poses
from slam.graph.g2o import read_g2o
from slam.graph.loop_selection import select_loops
from slam.graph.pose_graph import Edge, odometry_poses
from slam.graph.solver import squared_distances

WRONG = 3.0  # m: a loop farther off is false
ODOMETRY_SIGMA = (0.05, 0.03)  # deg, m a frame: what KISS-ICP's trajectory is taken to be good for


@dataclass(frozen=True, eq=False)
class Case:
    """Odometry k -> k + 1, loops with the truth about them, (L,) bool, and poses to compare with (N, 4, 4).

    `optimum` is GTSAM's error of the clean graph, where its solution is the reference; None where that is a truth.
    """

    name: str
    odometry: Sequence[Edge]
    loops: Sequence[Edge]
    true: Array
    reference: Array
    optimum: float | None = None

    @cached_property
    def start(self) -> Array:
        return odometry_poses(self.odometry, np.eye(4))

    def error(self, poses: Array) -> float:
        """Return the RMS distance to the optimum if that is the reference, else the aligned ATE to ground truth [m]."""
        if self.optimum is None:
            return ate(poses, self.reference).rmse
        return float(np.sqrt(np.mean(np.sum((poses - self.reference)[:, :3, 3] ** 2, axis=1))))

    def clean_error(self) -> tuple[float, float]:
        """Error of the clean graph by our back end, and by GTSAM's Levenberg-Marquardt from its chordal start."""
        poses = select_loops(self.odometry, self.loops, self.start).poses
        assert self.optimum is not None
        return float(squared_distances([*self.odometry, *self.loops], poses).sum()) / 2, self.optimum

    def with_false(self, share: float, seed: int, group: int = 1) -> Case:
        """Add false loops, `share` times as many as true ones.

        A false loop joins random places by the relative pose of a true loop, with an error above WRONG; it is followed
        by `group` - 1 more that agree with it through the odometry.
        """
        rng, false = np.random.default_rng(seed), list[Edge]()
        last, poses = len(self.reference) - group, self.start
        while len(false) < round(share * len(self.loops)):
            i, j = (int(k) for k in np.sort(rng.integers(last, size=2)))
            copied = self.loops[int(rng.integers(len(self.loops)))]
            truth = se3.inverse(self.reference[i]) @ self.reference[j]
            if j - i < 20 or np.linalg.norm(truth[:3, 3] - copied.pose[:3, 3]) <= WRONG:
                continue
            for k in range(group):
                before, after = se3.inverse(poses[i + k]) @ poses[i], se3.inverse(poses[j]) @ poses[j + k]
                false.append(Edge(i + k, j + k, se3.normalized(before @ copied.pose @ after), copied.covariance))
        true = np.arange(len(self.loops) + len(false)) < len(self.loops)
        return replace(self, loops=[*self.loops, *false], true=true)


def posegraph(path: Path) -> Case:
    """A g2o file; its reference is GTSAM's own optimum of it, from a chordal start."""
    edges = read_g2o(path).edges
    odometry = [edge for edge in edges if edge.j == edge.i + 1]
    loops = [edge for edge in edges if edge.j != edge.i + 1]
    reference, optimum = clean_optimum(edges)
    return Case(path.stem, odometry, loops, np.ones(len(loops), bool), reference, optimum)


def kitti_00(folder: Path, sigma: tuple[float, float], seed: int) -> Case:
    """KISS-ICP's trajectory of KITTI 00 as odometry; loops from the ground truth with noise `sigma` [deg, m]."""
    truth, estimate = (
        np.array([se3.normalized(pose) for pose in read_poses(folder / f"kitti_00_{name}.txt")[1]])
        for name in ("ground_truth", "kiss_icp")
    )
    steps = se3.inverse(estimate[:-1]) @ estimate[1:]
    covariance = _covariance(ODOMETRY_SIGMA)
    odometry = [Edge(k, k + 1, se3.normalized(step), covariance) for k, step in enumerate(steps)]
    rng, covariance = np.random.default_rng(seed), _covariance(sigma)
    loops = [_measured(i, j, truth, covariance, rng) for i, j in _revisits(truth)]
    name = f"KITTI 00, {sigma[1]:g} m / {sigma[0]:g} deg"
    return Case(name, odometry, loops, np.ones(len(loops), bool), truth)


def grown(poses: int, seed: int) -> Case:
    """Laps of 500 keyframes, 1 m apart, with a loop to the lap before at every 25th."""
    step = se3.exp(np.array([0, 0, 2 * np.pi / 500, 1.0, 0, 0]))
    truth = odometry_poses([Edge(k, k + 1, step, np.eye(6)) for k in range(poses - 1)], np.eye(4))
    rng, covariance = np.random.default_rng(seed), _covariance((0.05, 0.02))
    odometry = [_measured(k, k + 1, truth, covariance, rng) for k in range(poses - 1)]
    loops = [_measured(k - 500, k, truth, covariance, rng) for k in range(500, poses, 25)]
    return Case(f"laps, {poses:,} keyframes", odometry, loops, np.ones(len(loops), bool), truth)


def _revisits(truth: Array) -> list[tuple[int, int]]:
    """For every 5th frame the nearest place visited more than 100 m of path before, if it is within 4 m."""
    way, xyz, found = distances(truth), truth[:, :3, 3], []
    for j in range(0, len(truth), 5):
        apart = np.where(way[j] - way[:j] > 100, np.linalg.norm(xyz[:j] - xyz[j], axis=1), np.inf)
        if len(apart) and apart.min() < 4:
            found.append((int(apart.argmin()), j))
    return found


def _measured(i: int, j: int, truth: Array, covariance: Array, rng: np.random.Generator) -> Edge:
    noise = se3.exp(rng.normal(size=6) * np.sqrt(np.diag(covariance)))
    return Edge(i, j, se3.normalized(se3.inverse(truth[i]) @ truth[j] @ noise), covariance)


def _covariance(sigma: tuple[float, float]) -> Array:
    """(6, 6) of sigmas in degrees and metres."""
    return np.diag(np.repeat([np.radians(sigma[0]) ** 2, sigma[1] ** 2], 3))
