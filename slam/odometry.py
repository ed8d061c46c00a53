"""LiDAR odometry: the sensor's pose scan by scan, with several hypotheses of the first motion."""

from __future__ import annotations

from dataclasses import replace

from slam.cell_sizes import Sizes
from slam.data.cloud import Array, PointCloud
from slam.odometry_step import OdometryStep
from slam.registration.target import Target
from slam.settings import OdometrySettings
from slam.track import Track

COMPARED_SCANS = 8  # after the first, after which the best hypothesis is chosen
MIN_RELATIVE_EVIDENCE = 0.5  # to the best hypothesis; below it a hypothesis is rejected

__all__ = ["Odometry", "OdometryStep"]


class Odometry:
    """Registers successive scans, as `Track` does, and resolves the ambiguity of the first motion.

    The initial velocity is unknown, and two scans often fit in several ways: without motion, since the ring patterns
    coincide; with the motion of the lorries around the sensor; or shifted by one post of a railing. So the first scans
    are registered with every motion that fits the second scan, and the hypothesis with the most evidence is kept. Until
    then the poses are `provisional`; the step that ends this beginning has the `revised` ones.

    Args:
        settings: Settings of the odometry.
        sweep_duration: Duration of a sweep [s].
        vertical_correction: Angle [rad] added to each elevation.
    """

    def __init__(
        self, settings: OdometrySettings, *, sweep_duration: float = 0.1, vertical_correction: float = 0.0
    ) -> None:
        track = Track(settings, sweep_duration=sweep_duration, vertical_correction=vertical_correction)
        self._tracks = [track]  # best first
        self._steps: dict[Track, list[OdometryStep]] = {track: []}  # provisional ones
        # the evidence needs surface information and a map: it is no criterion from scan to scan
        self._initialising = settings.target == "map" and settings.information_matrix == "surface"

    @property
    def settings(self) -> OdometrySettings:
        """Settings of the odometry."""
        return self._tracks[0].settings

    @property
    def sizes(self) -> Sizes | None:
        """Cell and voxel sizes; None before the first scan."""
        return self._tracks[0].sizes

    @property
    def target(self) -> Target | None:
        """Target of the registration; None before the first scan."""
        return self._tracks[0].target

    def predict(self, stamp: float) -> Array:
        """Return the pose (4, 4) at `stamp` for a constant velocity since the last registered scan."""
        return self._tracks[0].predict(stamp)

    def register(self, cloud: PointCloud, stamp: float) -> OdometryStep:
        """Register the next scan.

        Args:
            cloud: Points as recorded.
            stamp: Time of the scan [s].
        """
        if not self._initialising or self._tracks[0].scans == 0:
            return self._tracks[0].register(cloud, stamp)
        if len(self._tracks) == 1:
            hypotheses = self._tracks[0].hypotheses(cloud, stamp)
            if not hypotheses:
                return self._tracks[0].register(cloud, stamp)
        else:
            hypotheses = [(track, track.register(cloud, stamp)) for track in self._tracks]
        return self._best_step(hypotheses)

    def settle(self) -> tuple[OdometryStep, ...]:
        """Choose the best hypothesis; return its steps in place of the provisional ones."""
        best = self._tracks[0]
        best.competing = False
        self._tracks, self._initialising = [best], False
        return tuple(self._steps.pop(best, ()))

    def _best_step(self, hypotheses: list[tuple[Track, OdometryStep]]) -> OdometryStep:
        """Reject hypotheses with little evidence; return the step of the best one."""
        before = self._steps
        self._steps = {track: [*before.get(track, []), step] for track, step in hypotheses}
        max_evidence = max(track.evidence for track in self._steps)
        kept = [track for track in self._steps if track.evidence >= MIN_RELATIVE_EVIDENCE * max_evidence]
        self._tracks = sorted(kept, key=lambda track: -track.evidence)
        best = self._tracks[0]
        ongoing = self._steps[best][-1].status != "failed"
        if ongoing and len(kept) > 1 and len(self._steps[best]) < COMPARED_SCANS:
            return replace(self._steps[best][-1], provisional=True)
        *earlier, step = self.settle()
        return replace(step, revised=tuple(earlier))
