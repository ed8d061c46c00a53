"""Mounting of a recording's frames: the transforms of /tf_static, and those of /tf that never change."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from slam.data import se3
from slam.data.cloud import Array


def pose_of(position: Any, orientation: Any) -> Array:
    """Convert a Point or Vector3 and a Quaternion of ROS to a pose (4, 4); NaN for a quaternion of length 0."""
    quaternion = np.array([orientation.x, orientation.y, orientation.z, orientation.w])
    if not np.isfinite(quaternion).all() or np.linalg.norm(quaternion) < 1e-6:
        return np.full((4, 4), np.nan)
    T = np.eye(4)
    T[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
    T[:3, 3] = position.x, position.y, position.z
    return T


class Mounting:
    """The frames that are fixed to each other."""

    def __init__(self) -> None:
        self._edges: dict[tuple[str, str], Array] = {}  # (parent, child): T_parent_child
        self._moving: set[tuple[str, str]] = set()

    def add(self, transforms: Iterable[Any], fixed: bool) -> None:
        """Add the transforms of a TFMessage.

        Args:
            transforms: TransformStamped messages.
            fixed: Whether they are static; of others, those that never change are used.
        """
        for each in transforms:
            edge = each.header.frame_id.lstrip("/"), each.child_frame_id.lstrip("/")
            T = pose_of(each.transform.translation, each.transform.rotation)
            if not np.isfinite(T).all():
                continue
            if not fixed and edge in self._edges and not np.allclose(self._edges[edge], T, atol=1e-6):
                self._moving.add(edge)
            self._edges[edge] = T

    @property
    def frames(self) -> set[str]:
        """The names of all frames."""
        return {frame for edge in self._edges for frame in edge}

    def between(self, a: str, b: str) -> Array | None:
        """Return T_a_b (4, 4), None if the two frames are not fixed to each other."""
        neighbours: dict[str, list[tuple[str, Array]]] = {}
        for (parent, child), T in self._edges.items():
            if (parent, child) not in self._moving:
                neighbours.setdefault(parent, []).append((child, T))
                neighbours.setdefault(child, []).append((parent, se3.inverse(T)))
        found, waiting = {a: np.eye(4)}, deque([a])
        while waiting:
            here = waiting.popleft()
            if here == b:
                return found[here]
            for frame, T in neighbours.get(here, []):
                if frame not in found:
                    found[frame] = found[here] @ T
                    waiting.append(frame)
        return None
