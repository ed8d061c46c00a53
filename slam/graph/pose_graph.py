"""Poses tied by relative measurements: edges with covariances, chains of them, and the graph that loops leave over."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from slam.data import se3
from slam.data.cloud import Array


@dataclass(frozen=True, eq=False)
class Edge:
    """A measured relative pose: `pose` (4, 4) is T_i_j, and the truth is pose @ exp(xi), xi ~ N(0, `covariance`).

    xi = (rotation [rad], translation [m]) in the axes of j; `covariance` (6, 6). Raises ValueError where a number is
    not finite, `pose` is no rigid motion or `covariance` is not symmetric and positive definite.
    """

    i: int
    j: int
    pose: Array
    covariance: Array

    def __post_init__(self) -> None:
        name = f"edge {self.i} -> {self.j}"
        if self.i == self.j:
            raise ValueError(f"{name}: joins a pose to itself")
        _check_pose(self.pose, name)
        _check_covariance(self.covariance, name)

    @property
    def information(self) -> Array:
        """Inverse of the covariance, (6, 6), exactly symmetric."""
        inverse = np.linalg.inv(self.covariance)
        return np.asarray((inverse + inverse.T) / 2)


@dataclass(frozen=True, eq=False)
class PoseGraph:
    """`poses` (N, 4, 4) T_world_i, an estimate or a first guess, and the edges between them."""

    poses: Array
    edges: tuple[Edge, ...]


def _check_pose(pose: Array, name: str) -> None:
    if pose.shape != (4, 4) or not np.isfinite(pose).all():
        raise ValueError(f"{name}: the pose has to be 4 x 4 and finite")
    R = pose[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-6 or np.linalg.det(R) < 0:
        raise ValueError(f"{name}: the pose is no rigid motion, its rotation is not orthonormal")


def _check_covariance(covariance: Array, name: str) -> None:
    if covariance.shape != (6, 6) or not np.isfinite(covariance).all():
        raise ValueError(f"{name}: the covariance has to be 6 x 6 and finite")
    if np.abs(covariance - covariance.T).max() > 1e-6 * np.abs(covariance).max():
        raise ValueError(f"{name}: the covariance is not symmetric")
    smallest = float(np.linalg.eigvalsh(covariance)[0])
    if not smallest > 0:
        raise ValueError(f"{name}: the covariance is not positive definite, its smallest eigenvalue is {smallest:.3g}")


def reversed_edge(edge: Edge) -> Edge:
    """The same measurement seen from j: T_j_i, its covariance in the axes of i."""
    Ad = adjoint(edge.pose)
    return Edge(edge.j, edge.i, se3.inverse(edge.pose), symmetric(Ad @ edge.covariance @ Ad.T))


def chained(edges: Iterable[Edge]) -> Edge:
    """One edge for a path of edges, each beginning where the one before ends; the errors add to first order.

    T_i_k = T_i_j T_j_k, and what is uncertain in j is carried into k's axes by the adjoint of T_k_j (Barfoot, State
    Estimation for Robotics, eq. 7.300, for perturbations on the right).
    """
    first, *rest = edges
    pose, covariance, j = first.pose, first.covariance, first.j
    for edge in rest:
        if edge.i != j:
            raise ValueError(f"edge {edge.i} -> {edge.j} does not begin at {j}, where the path has come to")
        Ad = adjoint(se3.inverse(edge.pose))
        pose, covariance, j = pose @ edge.pose, symmetric(Ad @ covariance @ Ad.T + edge.covariance), edge.j
    return first if not rest else Edge(first.i, j, se3.normalized(pose), covariance)


def adjoint(T: Array) -> Array:
    """(6, 6) with T @ exp(xi) = exp(adjoint(T) @ xi) @ T, rotation first."""
    result = np.zeros((6, 6))
    result[:3, :3] = result[3:, 3:] = T[:3, :3]
    result[3:, :3] = se3.skew(T[:3, 3]) @ T[:3, :3]
    return result


def symmetric(matrix: Array) -> Array:
    """The symmetric part: products of covariances lose their last digit of it."""
    return np.asarray((matrix + matrix.T) / 2)


def odometry_poses(odometry: Sequence[Edge], start: Array) -> Array:
    """Poses (len + 1, 4, 4) along a chain of edges, the first at `start` (4, 4)."""
    poses = [start]
    for edge in odometry:
        poses.append(se3.normalized(poses[-1] @ edge.pose))
    return np.array(poses)


def reduced(odometry: Sequence[Edge], loops: Iterable[Edge]) -> tuple[list[int], list[Edge], list[Edge]]:
    """The poses that loops touch, the first and the last, rising; the odometry from one to the next, and the loops.

    `odometry[k]` joins pose k to k + 1; the edges that come back count only the poses that are left. Without loops,
    their graph has the same solution as the whole, and the same marginal covariances to first order.
    """
    loops = list(loops)
    kept = sorted({0, len(odometry)}.union(*((loop.i, loop.j) for loop in loops)))
    place = {pose: k for k, pose in enumerate(kept)}
    chain = [chained(odometry[a:b]) for a, b in pairwise(kept)]
    renamed = [[replace(edge, i=place[edge.i], j=place[edge.j]) for edge in edges] for edges in (chain, loops)]
    return kept, renamed[0], renamed[1]


def disagreement(loop: Edge, poses: Array, covariance: Array | None = None) -> float:
    """Squared Mahalanobis distance between a loop and poses (N, 4, 4).

    `covariance` (6, 6) of the relative pose in the axes of j, where the poses are uncertain themselves.
    """
    error = se3.log(se3.inverse(loop.pose) @ se3.inverse(poses[loop.i]) @ poses[loop.j])
    total = loop.covariance if covariance is None else loop.covariance + covariance
    return float(error @ np.linalg.solve(total, error))
