"""One scan of a run, kept for the report as the front end passed it to the odometry."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from slam.front_end import AdaptiveFrontEnd

if TYPE_CHECKING:
    from eval.report.scan import Scan
    from slam.data.cloud import Frame, History, PointCloud
    from slam.front_end import FrontEnd


class KeptScan:
    """Wraps the front end of a run, and keeps the scan in its middle with its image.

    Args:
        frames: Number of frames of the run.
    """

    def __init__(self, frames: int) -> None:
        self._left = frames // 2
        self._kept: dict[str, Any] | None = None  # the arguments of a Scan

    def around(self, front_end: FrontEnd) -> FrontEnd:
        """Return a front end that does the same, and lets this object see its scans."""
        self._front_end = front_end
        return self

    def __call__(self, frame: Frame, history: History) -> PointCloud:
        """Return the cloud of the front end."""
        cloud = self._front_end(frame, history)
        if self._left == 0:
            self._kept = {
                "number": frame.index, "cloud": cloud, "image": frame.image, "calibration": frame.calibration
            }  # fmt: skip
        self._left -= 1
        return cloud

    def state(self) -> dict[str, Any]:
        """Return what the front end learned and the scan, see `AdaptiveFrontEnd`."""
        learned = self._front_end.state() if isinstance(self._front_end, AdaptiveFrontEnd) else None
        return {"front_end": learned, "left": self._left, "kept": self._kept}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue from such a state."""
        if isinstance(self._front_end, AdaptiveFrontEnd):
            self._front_end.restore(state["front_end"])
        self._left, self._kept = state["left"], state["kept"]

    def scan(self) -> Scan | None:
        """Return the scan with its image; None if the run did not get there."""
        from eval.report.scan import Scan

        return None if self._kept is None else Scan(**self._kept)
