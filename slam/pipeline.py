"""SLAM over a data set: its frames, read ahead, go through `Slam` one after the other."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from slam.data.cloud import Frame
from slam.data.dataset import Dataset
from slam.front_end import FrontEnd
from slam.journal.journal import Journal
from slam.recorded_odometry import RecordedOdometry
from slam.records import FrameRecord
from slam.refusal import RefusedError, raise_if_strict
from slam.run import Observer, Run
from slam.run_record import require_same_scan
from slam.settings import Config
from slam.slam import Slam
from slam.source import source_of, sweep_duration, vertical_correction


class Pipeline:
    """Runs a configuration over data sets; runs are independent of each other.

    Args:
        config: The settings. Default: `Config()`.
        make_front_end: Creates the front end of each run, since a front end may adapt to its scans. Default: the rings
            set by the configuration.
    """

    def __init__(self, config: Config | None = None, make_front_end: Callable[[], FrontEnd] | None = None) -> None:
        self.config, self.make_front_end = config or Config(), make_front_end

    def run(
        self,
        dataset: Dataset,
        frames: slice = slice(None),
        *,
        recorded: RecordedOdometry | None = None,
        strict: bool = False,
        journal: Journal | None = None,
        observer: Observer | None = None,
        on_frame: Callable[[FrameRecord], None] | None = None,
        on_odometry: Callable[[Run], None] | None = None,
        on_stop: Callable[[Run], None] | None = None,
    ) -> Run:
        """Run `Slam` over the frames of a data set.

        Args:
            dataset: The data set.
            frames: Positions in the data set, as in a list's slice.
            recorded: Poses of another odometry, in place of ours.
            strict: Raise an error at the first problem of the data.
            journal: As in `Slam`; the run continues from its snapshot, if it has one.
            observer: Watches the run.
            on_frame: Called after each frame, and before the first one for each frame of the snapshot.
            on_odometry: Called when all frames are registered. The selection of loops and the map follow, and may take
                minutes.
            on_stop: Called with the incomplete result if an exception, such as Ctrl-C, ends the run before that; not if
                `strict` ends it.

        Raises:
            InputError: No frames are selected, the data lack what a step requires, or `strict` is set and there is a
                problem.
        """
        source = source_of(dataset, frames)
        positions = source.positions or range(0)
        sweep = sweep_duration(dataset, recorded.stamps if recorded else None)
        angle = vertical_correction(self.config.front_end, source.sensor)
        about: Any = {"sweep_duration": sweep, "vertical_correction": angle}
        odometry = recorded.steps(positions, **about) if recorded else None
        front_end = self.make_front_end() if self.make_front_end else None
        about = {"source": source, "sweep_duration": sweep, "odometry": odometry, "strict": strict, "journal": journal}
        slam = Slam(self.config, front_end, **about, observer=observer)
        problems = (*dataset.problems, *(recorded.problems if recorded else ()))
        raise_if_strict(problems, strict)
        done = len(slam.result.records)
        if not done:
            slam.result.problems.extend(problems)
        elif journal and journal.state and done <= len(positions):
            require_same_scan(dataset, positions[done - 1], journal.state["run"])
        with slam:
            try:
                if on_frame:
                    for record in slam.result.records:
                        on_frame(record)
                left = positions[done:]
                for position, (frame, load) in zip(left, _read_ahead(dataset, left), strict=True):
                    record = slam.add(recorded.stamped(frame, position) if recorded else frame, load)
                    if on_frame:
                        on_frame(record)
            except BaseException as error:
                if on_stop and not isinstance(error, RefusedError):
                    on_stop(slam.result)
                raise
            slam.result.settle_truth()
            if on_odometry:
                on_odometry(slam.result)
            return slam.finish()


def _read_ahead(dataset: Dataset, positions: range) -> Iterator[tuple[Frame, float]]:
    """Yield the frames in order, each with its read time [ms]; the next frame is read in the background."""

    def read(position: int) -> tuple[Frame, float]:
        begin = time.perf_counter()
        return dataset[position], 1e3 * (time.perf_counter() - begin)

    with ThreadPoolExecutor(1, "read-ahead") as reader:
        pending = deque(reader.submit(read, position) for position in positions[:1])
        for position in (*positions[1:], *(None for _ in positions[:1])):
            frame = pending.popleft().result()
            if position is not None:
                pending.append(reader.submit(read, position))
            yield frame
