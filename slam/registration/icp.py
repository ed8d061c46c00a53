"""Iterative closest points, point-to-plane (Chen & Medioni 1992): the counter-example to NDT, from scan to scan."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from slam.data.cloud import Array
from slam.registration.gauss_newton import NOTHING, Linearisation, minimise, result
from slam.registration.kernels import INLIER
from slam.registration.result import RegistrationResult

GATE = 2.0  # m; pairs further apart are left out
NOISE = 0.3  # m, spread of the distance between true pairs: half of the spacing of the points. Scales score and weights
NORMAL_NEIGHBOURS = 10


class IcpTarget:
    """The points of the last scan in a k-d tree, with their normals."""

    def __init__(self, max_iterations: int) -> None:
        self.max_iterations = max_iterations
        self.reach = GATE
        self.clear()

    def __len__(self) -> int:
        return len(self._points)

    def clear(self) -> None:
        self._points = np.zeros((0, 3))
        self._tree = cKDTree(self._points)

    def insert(self, xyz: Array, weight: Array, pose: Array) -> None:
        """Points (N, 3), moved by `pose` (4, 4), instead of those before; weights are not used."""
        del weight
        self._points = xyz @ pose[:3, :3].T + pose[:3, 3]
        self._tree = cKDTree(self._points)
        self._normals = _normals(self._points, self._tree)

    def evict(self, centre: Array, radius: float) -> None:
        """Nothing to forget: one scan is all there is."""

    def scorer(self, xyz: Array, weight: Array, centre: Array) -> Callable[[Array], float]:
        """The paper's eq. 5 of the points' distances to the planes, by pose (4, 4)."""
        del centre
        return lambda pose: self._linearise(xyz, weight, pose).score

    def align(self, xyz: Array, weight: Array, guess: Array, locked: Array = NOTHING) -> RegistrationResult:
        """Pose of the points (N, 3), weights (N,), in the target from `guess` (4, 4), pairs renewed in every step.

        No step is taken along `locked` (K, 6) in the target's axes.
        """
        linearise = partial(self._linearise, xyz, weight)
        pose, converged = minimise(linearise, guess, linearise(guess), self.max_iterations, locked)
        scores = np.zeros((len(xyz), 6))
        model = self._linearise(xyz, weight, pose, scores)
        return result(model, pose, converged, xyz, scores)

    def unobserved(self, xyz: Array, weight: Array, pose: Array, before: Array) -> Array:
        """Not known from scan to scan: none (0, 3)."""
        del xyz, weight, pose, before
        return np.zeros((0, 3))

    def _linearise(self, xyz: Array, weight: Array, pose: Array, scores: Array | None = None) -> Linearisation:
        turned = xyz @ pose[:3, :3].T
        distance, nearest = self._tree.query(turned + pose[:3, 3], distance_upper_bound=GATE)
        paired = np.isfinite(distance)
        total = max(float(weight.sum()), 1e-9)
        if not paired.any():
            return Linearisation(np.zeros((6, 6)), np.zeros(6), 1.0, 0.0, 0.0, 0.0)
        q, w = turned[paired], weight[paired].astype(float)
        J, r = self._residuals(q, nearest[paired], pose)
        m = np.einsum("ni,ni->n", r, r) / NOISE**2
        robust = w / (1.0 + m)
        scaled = robust / NOISE**2
        parts = np.einsum("n,nik,ni->nk", scaled, J, r, optimize=True)
        if scores is not None:
            scores[paired] = parts
        return Linearisation(
            H=np.einsum("n,nik,nil->kl", scaled, J, J, optimize=True),
            gradient=parts.sum(axis=0),
            variance=float((robust * m).sum() / (r.shape[1] * robust.sum())),
            inlier_ratio=float(w[m < INLIER].sum() / max(w.sum(), 1e-9)),
            overlap=float(w.sum() / total),
            score=float((w * np.exp(-m / 2)).sum() / total),
        )

    def _residuals(self, q: Array, nearest: Array, pose: Array) -> tuple[Array, Array]:
        """J (M, 1, 6) and r (M, 1) of turned points q (M, 3), along the normals of their nearest points."""
        difference = q + pose[:3, 3] - self._points[nearest]
        normal = self._normals[nearest]
        J = np.concatenate([np.cross(q, normal), normal], axis=1)[:, None, :]
        return J, np.einsum("ni,ni->n", difference, normal)[:, None]


def _normals(points: Array, tree: cKDTree) -> Array:
    """Unit normal (N, 3) of each point: the direction in which its neighbours vary least."""
    if len(points) == 0:
        return points
    _, neighbours = tree.query(points, k=min(NORMAL_NEIGHBOURS, len(points)))
    patch = points[neighbours.reshape(len(points), -1)]
    patch = patch - patch.mean(axis=1, keepdims=True)
    return np.linalg.eigh(np.einsum("nki,nkj->nij", patch, patch))[1][:, :, 0]
