"""Odometry: the sensor's pose scan by scan, begun with several hypotheses of how it moves."""

from __future__ import annotations

from dataclasses import replace

from slam.cell_sizes import Sizes
from slam.data.cloud import Array, PointCloud
from slam.settings import OdometrySettings
from slam.track import OdometryStep, Target, Track

WEIGHED = 8  # scans after the first by which the hypotheses are judged
HOPELESS = 0.5  # of the best one's evidence: a hypothesis with less is given up

__all__ = ["Odometry", "OdometryStep"]


class Odometry:
    """Registers scans one after the other, as `Track` does.

    How a drive begins is not known, and two scans often fit each other in more than one way: as if the sensor stood
    still among its own rings, moved with the lorries around it, or had gone one post of a railing further. So the first
    scans are registered by every motion that the second allows, and the one that finds most evidence in them is kept.
    Their poses are `provisional` until then; the step that ends it has them `revised`.
    """

    def __init__(
        self, settings: OdometrySettings, *, sweep_duration: float = 0.1, vertical_correction: float = 0.0
    ) -> None:
        track = Track(settings, sweep_duration=sweep_duration, vertical_correction=vertical_correction)
        self._tracks = [track]  # the best first
        self._steps: dict[Track, list[OdometryStep]] = {track: []}  # provisional ones
        # evidence tells hypotheses apart where a map holds by surfaces; from scan to scan there is nothing to weigh
        self._beginning = settings.target == "map" and settings.information == "surface"

    @property
    def settings(self) -> OdometrySettings:
        return self._tracks[0].settings

    @property
    def sizes(self) -> Sizes | None:
        """Of cells and thinning, once the first scan has told them."""
        return self._tracks[0].sizes

    @property
    def target(self) -> Target | None:
        """The map that scans are registered against, once there is one."""
        return self._tracks[0].target

    def predict(self, stamp: float) -> Array:
        """Pose (4, 4) at `stamp` if the velocity has stayed as it was at the last registered scan."""
        return self._tracks[0].predict(stamp)

    def register(self, cloud: PointCloud, stamp: float) -> OdometryStep:
        """Pose of the next scan: points as recorded, taken at `stamp` [s]."""
        if not self._beginning or self._tracks[0].scans == 0:
            return self._tracks[0].register(cloud, stamp)
        if len(self._tracks) == 1:
            branches = self._tracks[0].branches(cloud, stamp)
            if not branches:
                return self._tracks[0].register(cloud, stamp)
        else:
            branches = [(track, track.register(cloud, stamp)) for track in self._tracks]
        return self._weighed(branches)

    def settle(self) -> tuple[OdometryStep, ...]:
        """End the beginning: the steps that were provisional, as the best hypothesis has them."""
        best = self._tracks[0]
        best.weighing = False
        self._tracks, self._beginning = [best], False
        return tuple(self._steps.pop(best, ()))

    def _weighed(self, branches: list[tuple[Track, OdometryStep]]) -> OdometryStep:
        """The step of the best hypothesis, after the hopeless ones are given up."""
        before = self._steps
        self._steps = {track: [*before.get(track, []), step] for track, step in branches}
        most = max(track.evidence for track in self._steps)
        kept = [track for track in self._steps if track.evidence >= HOPELESS * most]
        self._tracks = sorted(kept, key=lambda track: -track.evidence)
        best = self._tracks[0]
        going_on = self._steps[best][-1].status != "failed"
        if going_on and len(kept) > 1 and len(self._steps[best]) < WEIGHED:
            return replace(self._steps[best][-1], provisional=True)
        *earlier, step = self.settle()
        return replace(step, revised=tuple(earlier))
