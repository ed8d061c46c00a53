"""Pose graph: edges with covariances, chains of edges, and reduction to the poses of loops."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import overload

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.data.growing import Growing


@dataclass(frozen=True, eq=False)
class Edge:
    """A measured relative pose; the true one is pose @ exp(xi), xi ~ N(0, covariance).

    Attributes:
        i: Index of the first pose.
        j: Index of the second pose.
        pose: (4, 4) T_i_j.
        covariance: (6, 6) of xi = (rotation [rad], translation [m]) in the axes of j.

    Raises:
        ValueError: A number is not finite, `pose` is not a rigid motion, or `covariance` is not symmetric and positive
            definite.
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
    """Poses (N, 4, 4) T_world_i, an estimate or an initial guess, and the edges between them."""

    poses: Array
    edges: Sequence[Edge]


class Edges(Sequence[Edge]):
    """Edges in the order of appending, 0.4 kB each: those of a run grow as long as it does.

    Args:
        edges: The first ones.
    """

    def __init__(self, edges: Iterable[Edge] = ()) -> None:
        self._rows = Growing(2 + 16 + 36)
        for edge in edges:
            self.append(edge)

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, position: int) -> Edge: ...
    @overload
    def __getitem__(self, position: slice) -> list[Edge]: ...
    def __getitem__(self, position: int | slice) -> Edge | list[Edge]:
        if isinstance(position, slice):
            return [self[each] for each in range(*position.indices(len(self)))]
        row = self._rows[position]
        return _checked(int(row[0]), int(row[1]), row[2:18].reshape(4, 4), row[18:].reshape(6, 6))

    def append(self, edge: Edge) -> None:
        """Append an edge."""
        self._rows.append(np.concatenate([(edge.i, edge.j), edge.pose.ravel(), edge.covariance.ravel()]))


def _checked(i: int, j: int, pose: Array, covariance: Array) -> Edge:
    """An edge that was checked before it was stored: a check takes longer than all else."""
    edge = object.__new__(Edge)
    edge.__dict__.update(i=i, j=j, pose=pose, covariance=covariance)
    return edge


def _check_pose(pose: Array, name: str) -> None:
    if pose.shape != (4, 4) or not np.isfinite(pose).all():
        raise ValueError(f"{name}: the pose must be 4 x 4 and finite")
    R = pose[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-6 or np.linalg.det(R) < 0:
        raise ValueError(f"{name}: the pose is not a rigid motion, its rotation is not orthonormal")


def _check_covariance(covariance: Array, name: str) -> None:
    if covariance.shape != (6, 6) or not np.isfinite(covariance).all():
        raise ValueError(f"{name}: the covariance must be 6 x 6 and finite")
    if np.abs(covariance - covariance.T).max() > 1e-6 * np.abs(covariance).max():
        raise ValueError(f"{name}: the covariance is not symmetric")
    smallest = float(np.linalg.eigvalsh(covariance)[0])
    if not smallest > 0:
        raise ValueError(f"{name}: the covariance is not positive definite, its smallest eigenvalue is {smallest:.3g}")


def reversed_edge(edge: Edge) -> Edge:
    """Return the inverse measurement T_j_i, with the covariance in the axes of i."""
    Ad = adjoint(edge.pose)
    return Edge(edge.j, edge.i, se3.inverse(edge.pose), symmetric(Ad @ edge.covariance @ Ad.T))


def chained(edges: Iterable[Edge]) -> Edge:
    """Compose a path of edges, each of which begins where the one before ends, into one edge.

    T_i_k = T_i_j T_j_k; the covariance in the axes of j is transformed to the axes of k by the adjoint of T_k_j, to
    first order (Barfoot, State Estimation for Robotics, eq. 7.300, for perturbations on the right).

    Raises:
        ValueError: The edges are not a path.
    """
    first, *rest = edges
    pose, covariance, j = first.pose, first.covariance, first.j
    for edge in rest:
        if edge.i != j:
            raise ValueError(f"edge {edge.i} -> {edge.j} does not begin at {j}, where the edge before ends")
        Ad = adjoint(se3.inverse(edge.pose))
        pose, covariance, j = pose @ edge.pose, symmetric(Ad @ covariance @ Ad.T + edge.covariance), edge.j
    return first if not rest else Edge(first.i, j, se3.normalized(pose), covariance)


def adjoint(T: Array) -> Array:
    """Return the adjoint (6, 6) of T (4, 4), T @ exp(xi) = exp(adjoint(T) @ xi) @ T, rotation first."""
    result = np.zeros((6, 6))
    result[:3, :3] = result[3:, 3:] = T[:3, :3]
    result[3:, :3] = se3.skew(T[:3, 3]) @ T[:3, :3]
    return result


def symmetric(matrix: Array) -> Array:
    """Return the symmetric part of a matrix, since rounding makes products of covariances asymmetric."""
    return np.asarray((matrix + matrix.T) / 2)


def odometry_poses(odometry: Sequence[Edge], start: Array) -> Array:
    """Return the poses (len + 1, 4, 4) along a chain of edges, the first at `start` (4, 4)."""
    poses = [start]
    for edge in odometry:
        poses.append(se3.normalized(poses[-1] @ edge.pose))
    return np.array(poses)


def reduced(odometry: Sequence[Edge], loops: Iterable[Edge]) -> tuple[list[int], list[Edge], list[Edge]]:
    """Reduce a graph to the poses of its loops, the first and the last pose.

    The reduced graph has the same solution as the full one, and the same marginal covariances to first order.

    Args:
        odometry: Edge k joins pose k to k + 1.
        loops: Loop edges.

    Returns:
        The kept poses, increasing; the odometry between them and the loops, both with indices of the kept poses.
    """
    loops = list(loops)
    kept = sorted({0, len(odometry)}.union(*((loop.i, loop.j) for loop in loops)))
    place = {pose: k for k, pose in enumerate(kept)}
    chain = [chained(odometry[a:b]) for a, b in pairwise(kept)]
    renamed = [[replace(edge, i=place[edge.i], j=place[edge.j]) for edge in edges] for edges in (chain, loops)]
    return kept, renamed[0], renamed[1]


def disagreement(loop: Edge, poses: Array, covariance: Array | None = None) -> float:
    """Compute the squared Mahalanobis distance between a loop and poses.

    Args:
        loop: The loop edge.
        poses: (N, 4, 4).
        covariance: (6, 6) covariance of the relative pose of `poses` in the axes of j, None if they are exact.
    """
    error = se3.log(se3.inverse(loop.pose) @ se3.inverse(poses[loop.i]) @ poses[loop.j])
    total = loop.covariance if covariance is None else loop.covariance + covariance
    return float(error @ np.linalg.solve(total, error))
