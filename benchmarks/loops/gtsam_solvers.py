"""Solvers of GTSAM for comparison: Levenberg-Marquardt with Huber's kernel, and the optimum of a clean graph.

The only file of the benchmarks that imports gtsam.
"""

from __future__ import annotations

from collections.abc import Sequence

import gtsam

from slam.data.cloud import Array
from slam.graph.pose_graph import Edge
from slam.graph.solver import factors, poses_of, prior_of_first, values_of

HUBER = 1.345


def with_huber(odometry: Sequence[Edge], loops: Sequence[Edge], start: Array) -> Array:
    """Poses (N, 4, 4) by Levenberg-Marquardt from `start`, with Huber's kernel on the loops."""
    graph = factors(odometry)
    graph.add(prior_of_first())
    graph.push_back(factors(loops, gtsam.noiseModel.mEstimator.Huber.Create(HUBER)))
    return poses_of(gtsam.LevenbergMarquardtOptimizer(graph, values_of(start)).optimize())


def clean_optimum(edges: Sequence[Edge]) -> tuple[Array, float]:
    """Poses (N, 4, 4) and error of a graph without false loops, from GTSAM's chordal start."""
    graph = factors(edges)
    graph.add(prior_of_first())
    optimizer = gtsam.LevenbergMarquardtOptimizer(graph, gtsam.InitializePose3.initialize(graph))
    return poses_of(optimizer.optimize()), optimizer.error()
