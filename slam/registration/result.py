"""What every registration method gives back."""

from __future__ import annotations

from dataclasses import dataclass

from slam.data.cloud import Array


@dataclass(frozen=True, eq=False)
class RegistrationResult:
    """A pose and how far it can be trusted.

    pose          (4, 4) T_target_source
    H             (6, 6) Gauss-Newton Hessian at the pose, robust weights applied, for a perturbation pose @ exp(xi),
                  xi = (rotation [rad], translation [m]) in the source's axes, as GTSAM's Pose3 has it
    covariance    (6, 6) of the same xi: inv(H) times the variance of the weighted residuals. It tells directions that
                  the points do not hold; as a variance it believes in the Gaussians and in independent points
    sandwich      (6, 6) of the same xi, of what the points really say: inv(H) B inv(H), B the scatter of their parts of
                  the gradient, those of neighbours added up first (Huber 1967; for clusters Liang & Zeger 1986)
    overlap       share of the points' weight that met the target: a cell with a Gaussian, a point within the gate
    inlier_ratio  share of those that fit it: Mahalanobis distance squared below 7.8, the 95 % quantile of chi^2(3)
    converged     the last step was below the thresholds before the iterations ran out
    """

    pose: Array
    H: Array
    covariance: Array
    sandwich: Array
    overlap: float
    inlier_ratio: float
    converged: bool
