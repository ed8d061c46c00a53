"""What scans are registered to: a map of Gaussians, or the last scan."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from slam.data.cloud import Array
from slam.registration.result import RegistrationResult

Points = tuple[Array, Array]  # xyz (N, 3) and weights (N,), float32


class Target(Protocol):
    """Target of the registration of scans: NdtTarget or IcpTarget.

    Attributes:
        convergence_radius: Distance [m] within which two initial poses converge to the same pose.
    """

    convergence_radius: float

    def __len__(self) -> int: ...

    def clear(self) -> None:
        """Remove all points."""

    def insert(self, xyz: Array, weight: Array, pose: Array) -> None:
        """Add points (N, 3) with weights (N,), transformed by `pose` (4, 4)."""

    def evict(self, centre: Array, radius: float) -> None:
        """Remove the points further than `radius` [m] from `centre` (3,)."""

    def scorer(self, xyz: Array, weight: Array, centre: Array) -> Callable[[Array], float]:
        """Return a function that scores poses (4, 4) of a scan around `centre` (4, 4); higher is better."""
        ...

    def align(self, xyz: Array, weight: Array, guess: Array, locked: Array = ...) -> RegistrationResult:
        """Register points from `guess` (4, 4), without steps along `locked` (K, 6) in the target's axes."""
        ...

    def distortion_response(self, xyz: Array, weight: Array, time: Array, found: RegistrationResult) -> Array:
        """Return how the pose of points with times (N,) [s] follows a velocity error (6, 6), see `gauss_newton`."""
        ...

    def unobserved(self, xyz: Array, weight: Array, pose: Array, before: Array) -> Array:
        """Return the unobservable directions (K, 3) of a scan; `before` (K, 3) are those of the last scan."""
        ...
