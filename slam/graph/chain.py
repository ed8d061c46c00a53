"""The poses of a run that the graph solves for, and the odometry from each to the next."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import replace

from slam.graph.pose_graph import Edge, chained


class Chain:
    """A chain of odometry edges in which poses may be skipped: the edges to and from them become one.

    Attributes:
        nodes: The poses that are not skipped, increasing.
        edges: Edge k joins pose `nodes[k]` to `nodes[k + 1]`, as k to k + 1.
    """

    def __init__(self) -> None:
        self.nodes = [0]
        self.edges: list[Edge] = []
        self._last = 0
        self._skipped: Edge | None = None  # the odometry since the last of `nodes`

    def __len__(self) -> int:
        """Number of poses so far, with those that were skipped."""
        return self._last + 1

    def add(self, edge: Edge, skip: bool) -> None:
        """Add the next pose by its odometry edge."""
        whole = chained([edge] if self._skipped is None else [self._skipped, edge])
        self._last = edge.j
        if skip:
            self._skipped = whole
            return
        self._skipped = None
        self.nodes.append(edge.j)
        self.edges.append(replace(whole, i=len(self.nodes) - 2, j=len(self.nodes) - 1))

    def renamed(self, loop: Edge) -> Edge:
        """Return a loop between two of `nodes` with their places among them."""
        return replace(loop, i=bisect_left(self.nodes, loop.i), j=bisect_left(self.nodes, loop.j))
