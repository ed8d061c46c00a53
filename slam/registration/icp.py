"""Point-to-plane ICP, scan to scan (Chen & Medioni 1992), for comparison with NDT."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from slam.data.cloud import Array
from slam.registration.gauss_newton import NOT_LOCKED, Linearisation, distortion_response, minimise, result
from slam.registration.kernels import INLIER_THRESHOLD
from slam.registration.result import RegistrationResult

MAX_PAIR_DISTANCE = 2.0  # m; more distant pairs are not used
RESIDUAL_SIGMA = 0.3  # m, of true pairs: half of the point spacing; scales score and weights
NORMAL_NEIGHBOURS = 10


class IcpTarget:
    """The points of the last scan in a k-d tree, with their normals.

    Args:
        max_iterations: Maximum number of Gauss-Newton steps.

    Attributes:
        convergence_radius: Distance [m] within which two initial poses converge to the same pose.
    """

    def __init__(self, max_iterations: int) -> None:
        self.max_iterations = max_iterations
        self.convergence_radius = MAX_PAIR_DISTANCE
        self.clear()

    def __len__(self) -> int:
        return len(self._points)

    def clear(self) -> None:
        """Remove all points."""
        self._points = np.zeros((0, 3))
        self._tree = cKDTree(self._points)

    def insert(self, xyz: Array, weight: Array, pose: Array) -> None:
        """Replace the points by xyz (N, 3), transformed by `pose` (4, 4); weights are not used."""
        del weight
        self._points = xyz @ pose[:3, :3].T + pose[:3, 3]
        self._tree = cKDTree(self._points)
        self._normals = _normals(self._points, self._tree)

    def evict(self, centre: Array, radius: float) -> None:
        """Do nothing: the target holds one scan only."""

    def scorer(self, xyz: Array, weight: Array, centre: Array) -> Callable[[Array], float]:
        """Return the score of a pose (4, 4): the paper's eq. 5 with point-to-plane distances."""
        del centre
        return lambda pose: self._linearise(xyz, weight, pose).score

    def align(self, xyz: Array, weight: Array, guess: Array, locked: Array = NOT_LOCKED) -> RegistrationResult:
        """Register points in the target; correspondences are searched again in every step.

        Args:
            xyz: Points (N, 3).
            weight: Their weights (N,).
            guess: Initial pose (4, 4).
            locked: Directions (K, 6), in the target's axes, along which no step is taken.
        """
        linearise = partial(self._linearise, xyz, weight)
        pose, converged = minimise(linearise, guess, self.max_iterations, locked)
        scores = np.zeros((len(xyz), 6))
        model = self._linearise(xyz, weight, pose, scores)
        return result(model, pose, converged, xyz, scores, locked)

    def distortion_response(self, xyz: Array, weight: Array, time: Array, found: RegistrationResult) -> Array:
        """Return how the pose follows a velocity error (6, 6), see `gauss_newton.distortion_response`."""
        model = self._linearise(xyz, weight * time, found.pose)
        return distortion_response(found.H, model.H, found.pose)

    def unobserved(self, xyz: Array, weight: Array, pose: Array, before: Array) -> Array:
        """Return no directions (0, 3): observability is not estimated from scan to scan."""
        del xyz, weight, pose, before
        return np.zeros((0, 3))

    def _linearise(self, xyz: Array, weight: Array, pose: Array, scores: Array | None = None) -> Linearisation:
        rotated = xyz @ pose[:3, :3].T
        distance, nearest = self._tree.query(rotated + pose[:3, 3], distance_upper_bound=MAX_PAIR_DISTANCE)
        paired = np.isfinite(distance)
        total = max(float(weight.sum()), 1e-9)
        if not paired.any():
            return Linearisation(np.zeros((6, 6)), np.zeros(6), 1.0, 0.0, 0.0, 0.0, 0.0)
        q, w = rotated[paired], weight[paired].astype(float)
        J, r = self._residuals(q, nearest[paired], pose)
        m = np.einsum("ni,ni->n", r, r) / RESIDUAL_SIGMA**2
        robust = w / (1.0 + m)
        scaled = robust / RESIDUAL_SIGMA**2
        parts = np.einsum("n,nik,ni->nk", scaled, J, r, optimize=True)
        if scores is not None:
            scores[paired] = parts
        inlier_ratio = float(w[m < INLIER_THRESHOLD].sum() / max(w.sum(), 1e-9))
        return Linearisation(
            H=np.einsum("n,nik,nil->kl", scaled, J, J, optimize=True),
            gradient=parts.sum(axis=0),
            variance=float((robust * m).sum() / max(r.shape[1] * robust.sum(), 1e-9)),
            inlier_ratio=inlier_ratio,
            upright_inlier_ratio=inlier_ratio,  # points from scan to scan are not told apart by their surfaces
            overlap=float(w.sum() / total),
            score=float((w * np.exp(-m / 2)).sum() / total),
        )

    def _residuals(self, q: Array, nearest: Array, pose: Array) -> tuple[Array, Array]:
        """Jacobians J (M, 1, 6) and point-to-plane distances r (M, 1) of rotated points q (M, 3)."""
        difference = q + pose[:3, 3] - self._points[nearest]
        normal = self._normals[nearest]
        J = np.concatenate([np.cross(q, normal), normal], axis=1)[:, None, :]
        return J, np.einsum("ni,ni->n", difference, normal)[:, None]


def _normals(points: Array, tree: cKDTree) -> Array:
    """Unit normals (N, 3): the eigenvector of the smallest eigenvalue of each neighbourhood's covariance."""
    if len(points) == 0:
        return points
    _, neighbours = tree.query(points, k=min(NORMAL_NEIGHBOURS, len(points)))
    patch = points[neighbours.reshape(len(points), -1)]
    patch = patch - patch.mean(axis=1, keepdims=True)
    return np.linalg.eigh(np.einsum("nki,nkj->nij", patch, patch))[1][:, :, 0]
