"""The result of a registration."""

from __future__ import annotations

from dataclasses import dataclass

from slam.data.cloud import Array


@dataclass(frozen=True, eq=False)
class RegistrationResult:
    """A registered pose and its uncertainty.

    Covariances and H are of the perturbation pose @ exp(xi), xi = (rotation [rad], translation [m]) in the source's
    axes, as in GTSAM's Pose3.

    Attributes:
        pose: T_target_source (4, 4).
        H: Gauss-Newton Hessian (6, 6) at the pose, with robust weights.
        covariance: inv(H) times the variance of the weighted residuals (6, 6). It shows unobservable directions; as a
            variance it assumes correct Gaussians and independent points.
        sandwich: Cluster-robust covariance (6, 6): inv(H) B inv(H), with B the scatter of the points' contributions
            to the gradient, summed over adjacent points first (Huber 1967; for clusters Liang & Zeger 1986), plus
            the square of the step that the iteration would take next.
        overlap: Weight of the points with a correspondence (a cell with a Gaussian, a point within the maximum
            distance), as a share of the total weight.
        inlier_ratio: Share of these points with a squared Mahalanobis distance below 7.8, the 95 % quantile of
            chi^2(3).
        upright_inlier_ratio: The same share of the points on surfaces that constrain the horizontal position more than
            the height. At a wrong yaw the ground, most points of a street, still fits.
        converged: Whether the last step was below the thresholds within the maximum number of iterations.
    """

    pose: Array
    H: Array
    covariance: Array
    sandwich: Array
    overlap: float
    inlier_ratio: float
    upright_inlier_ratio: float
    converged: bool
