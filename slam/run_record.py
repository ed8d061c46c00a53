"""A run in its journal: frames and problems as they become final, snapshots, and how a run continues from one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from slam.data.cloud import Frame
from slam.data.dataset import Dataset
from slam.data.errors import InputError
from slam.data.growing import Growing
from slam.frame_record import problems_in, records_in, row_of
from slam.identity import fingerprint
from slam.journal.journal import Journal
from slam.journal.state import freeze
from slam.journal.tables import FRAME, PROBLEM
from slam.late_problems import LateProblems
from slam.mapper import Mapper
from slam.run import Run
from slam.tracking import Tracker


@dataclass(frozen=True, eq=False)
class Progress:
    """All of a run that later results depend on.

    Attributes:
        run: Its result so far.
        tracker: Front end and odometry.
        mapper: Keyframes and loops; it restores itself.
        images: Images whose damage may still be found.
        centres: Median position (2,) of each scan as recorded.
    """

    run: Run
    tracker: Tracker
    mapper: Mapper
    images: LateProblems = field(default_factory=LateProblems)
    centres: Growing = field(default_factory=lambda: Growing(2))


@dataclass(frozen=True, eq=False)
class RunRecord:
    """Writes a run into its journal, and continues it from the journal's snapshot if that has one."""

    journal: Journal
    progress: Progress

    def __post_init__(self) -> None:
        if self.journal.state:
            self._restore(self.journal.state)

    def add(self, last: Frame) -> None:
        """Write what is new after the frame `last`, whose pose is final, and a snapshot when it is time."""
        self.write_frames()
        self.write_problems()
        if self.journal.snapshot_due():
            self.snapshot(last)

    def write_frames(self) -> None:
        """Write the new frames, whose poses are final."""
        for record in self.progress.run.records[self.journal.counts()[FRAME.name] :]:
            self.journal.append(FRAME, *row_of(record))

    def write_problems(self) -> None:
        """Write the new problems."""
        for problem in self.progress.run.problems[self.journal.counts()[PROBLEM.name] :]:
            self.journal.append(PROBLEM, problem.kind, problem.message)

    def snapshot(self, last: Frame) -> None:
        """Write a snapshot after the frame `last`, once that is mapped."""
        counts, now = self.journal.counts(), self.progress
        own = {"centres": now.centres.array(), "timed": now.run.timed, "last": fingerprint(last.cloud)}
        now.mapper.snapshot(
            {"run": freeze(own), "tracker": freeze(now.tracker.state())},
            {table.name: counts[table.name] for table in (FRAME, PROBLEM)},
            now.images.until_later(),
        )

    def _restore(self, state: Mapping[str, Any]) -> None:
        now, own, file = self.progress, state["run"], self.journal.file
        now.tracker.restore(state["tracker"])
        now.run.records, now.run.problems = records_in(file), problems_in(file)
        now.run.timed, now.run.sizes = own["timed"], now.tracker.sizes
        for centre in own["centres"]:
            now.centres.append(centre)
        now.images.before.extend(state["late"])


def require_same_scan(dataset: Dataset, position: int, own: Mapping[str, Any]) -> None:
    """Check that a scan is the last one before a snapshot.

    Args:
        dataset: The data set.
        position: Position of the scan.
        own: The snapshot's part 'run'.

    Raises:
        InputError: The scan has changed.
    """
    if fingerprint(dataset[position].cloud) != own["last"]:
        raise InputError(f"{dataset.path}: scan {position} has changed since the run began; run again without --resume")
