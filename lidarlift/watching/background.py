"""Observers of a run in a thread of their own, so that showing a frame does not delay the next one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from queue import Queue
from threading import Thread
from types import TracebackType
from typing import Self

from slam.data.cloud import Frame, PointCloud
from slam.mapping_result import LoopProgress
from slam.records import FrameRecord
from slam.run import Observer, Run

MAX_WAITING = 8  # frames; the run waits when an observer is this many behind, so that nothing is left out


class Observers(Observer):
    """Several observers as one.

    Args:
        observers: The observers, which are called in this order.
    """

    def __init__(self, observers: Sequence[Observer]) -> None:
        self._observers = observers

    def started(self, run: Run) -> None:
        """Tell each."""
        for each in self._observers:
            each.started(run)

    def registered(self, frame: Frame, cloud: PointCloud, record: FrameRecord) -> None:
        """Tell each."""
        for each in self._observers:
            each.registered(frame, cloud, record)

    def loops_closed(self, progress: LoopProgress) -> None:
        """Tell each."""
        for each in self._observers:
            each.loops_closed(progress)

    def finished(self, run: Run) -> None:
        """Tell each."""
        for each in self._observers:
            each.finished(run)


class Background(Observer):
    """Calls an observer in a thread, in order. A failing observer is noted and left out; the run goes on.

    Use it in a `with` statement: its end waits until everything is shown; after an exception it does not wait.

    Args:
        observer: The observer.
        note: Receives a message if the observer fails.
    """

    def __init__(self, observer: Observer, note: Callable[[str], None]) -> None:
        self._observer, self._note = observer, note
        self._waiting: Queue[Callable[[], None] | None] = Queue(MAX_WAITING)
        self._failed = False
        self._thread = Thread(target=self._work, name="observer", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            self._failed = True  # what waits is left out
        self._waiting.put(None)
        self._thread.join()

    def started(self, run: Run) -> None:
        """Pass it on."""
        self._waiting.put(lambda: self._observer.started(run))

    def registered(self, frame: Frame, cloud: PointCloud, record: FrameRecord) -> None:
        """Pass it on."""
        self._waiting.put(lambda: self._observer.registered(frame, cloud, record))

    def loops_closed(self, progress: LoopProgress) -> None:
        """Pass it on."""
        self._waiting.put(lambda: self._observer.loops_closed(progress))

    def finished(self, run: Run) -> None:
        """Pass it on."""
        self._waiting.put(lambda: self._observer.finished(run))

    def _work(self) -> None:
        while (call := self._waiting.get()) is not None:
            if self._failed:
                continue
            try:
                call()
            except Exception as error:  # whatever a viewer meets must not stop the run
                self._failed = True
                self._note(f"the view stopped: {type(error).__name__}: {error}; the run goes on")
