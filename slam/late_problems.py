"""Problems that are found while images are read, which may be long after their frame was registered."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from slam.data.cloud import Frame
from slam.data.images import ReportingReader
from slam.data.problem import Problem


class LateProblems:
    """Watches the images of a run: the odometry reads some of them, the mapper others for its keyframes.

    Attributes:
        before: Problems of images that were read before the run was resumed, for `rest`.
    """

    def __init__(self) -> None:
        self.before: list[Problem] = []
        self._unread: list[ReportingReader] = []  # without a problem so far

    def watch(self, frame: Frame) -> list[ReportingReader]:
        """Watch and return the images of a frame, without those whose damage is among the frame's problems."""
        images = [reader for reader in frame.image_readers if isinstance(reader, ReportingReader)]
        unread = [image for image in images if image.problem is None]
        self._unread.extend(unread)
        return unread

    def found(self, images: Sequence[ReportingReader]) -> list[Problem]:
        """Return the problems of images that are watched, and watch these no longer."""
        problems = [image.problem for image in images if image.problem]
        if problems:
            self._unread = [image for image in self._unread if image.problem not in problems]
        return problems

    def rest(self) -> list[Problem]:
        """Return the problems of all images, at the end of a run."""
        return [*self.before, *self.found(self._unread)]

    def until_later(self) -> Callable[[], list[Problem]]:
        """Return a function that lists the problems of all images so far, also those that are still to be read."""
        known, images = list(self.before), list(self._unread)
        return lambda: [*known, *(image.problem for image in images if image.problem)]
