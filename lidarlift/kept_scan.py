"""One scan of a run, kept for the report as the front end passed it to the odometry."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from eval.report.scan import Scan
    from slam.data.cloud import Frame, History, PointCloud
    from slam.front_end import FrontEnd


class KeptScan:
    """Wraps the front end of a run, and keeps the scan in its middle.

    Args:
        frames: Number of frames of the run.
    """

    def __init__(self, frames: int) -> None:
        self._left = frames // 2
        self._kept: tuple[Frame, PointCloud] | None = None

    def around(self, front_end: FrontEnd) -> FrontEnd:
        """Return a front end that does the same, and lets this object see its scans."""

        def watched(frame: Frame, history: History) -> PointCloud:
            cloud = front_end(frame, history)
            if self._left == 0:
                self._kept = frame, cloud
            self._left -= 1
            return cloud

        return watched

    def scan(self) -> Scan | None:
        """Return the scan with its image; None if the run did not get there."""
        from eval.report.scan import Scan

        if self._kept is None:
            return None
        frame, cloud = self._kept
        return Scan(frame.index, cloud, frame.image, frame.calibration)
