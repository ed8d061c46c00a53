"""Content of a report, and what all its parts derive from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from eval.alignment import alignment_transform, associate
from eval.compare import DENSE
from eval.report.chart import colours
from eval.runs import Row, RunDetails, Track, read_run, read_truth, track_row
from eval.trajectory import distances
from slam.data.cloud import Array

STOOD = 4.0  # m: a path that is shorter is that of a sensor that stood


@dataclass(frozen=True, eq=False)
class Pairs:
    """Poses of a row and those of the reference at the same instants.

    Attributes:
        estimate: (K, 4, 4) as estimated.
        reference: (K, 4, 4).
        at: (K,) position of each in the row's trajectory.
        travelled: (K,) distance travelled along the reference [m].
    """

    estimate: Array
    reference: Array
    at: Array
    travelled: Array

    @property
    def along(self) -> Array:
        """(K,) abscissa of charts: the distance travelled [m], or the number of the pose if the sensor stood."""
        return np.arange(len(self.travelled)) if self.travelled[-1] < STOOD else self.travelled

    @property
    def along_title(self) -> str:
        """Title of this abscissa."""
        return "pose" if self.travelled[-1] < STOOD else "distance travelled [m]"

    @cached_property
    def aligned(self) -> Array:
        """(4, 4) SE(3) Umeyama alignment of the estimate to the reference."""
        return alignment_transform(self.estimate, self.reference, "aligned")[0]

    @cached_property
    def errors(self) -> Array:
        """(K,) distance of each position to the reference after this alignment [m]."""
        off = (self.aligned @ self.estimate)[:, :3, 3] - self.reference[:, :3, 3]
        return np.asarray(np.linalg.norm(off, axis=1))


@dataclass(frozen=True, eq=False)
class Report:
    """Content of a report.

    Attributes:
        title: The sequence, and what is compared.
        rows: Runs and trajectories, at least one.
        truth: The ground truth, or a trajectory in its place, None without.
        truth_name: Its name.
        command: The command line that makes the report again, None if unknown.
    """

    title: str
    rows: Sequence[Row]
    truth: Track | None = None
    truth_name: str = "ground truth"
    command: str | None = None

    @cached_property
    def colours(self) -> dict[str, str]:
        """Colour of each row by its label."""
        return colours([row.label for row in self.rows])

    @property
    def runs(self) -> list[tuple[Row, RunDetails]]:
        """The rows that are runs, with their details."""
        return [(row, row.run) for row in self.rows if row.run]

    @cached_property
    def reference(self) -> tuple[str, Track]:
        """Name and trajectory that the rows are drawn against: the ground truth, else all rings, else row one."""
        if self.truth:
            return self.truth_name, self.truth
        row = next((row for row in self.rows if row.label in DENSE), self.rows[0])
        return row.label, row.track

    def with_reference(self, row: Row) -> Report:
        """Return the report with a row in the place of the ground truth."""
        return replace(self, truth=row.track, truth_name=row.label)

    def pairs(self, track: Track) -> Pairs | None:
        """Associate a trajectory with the reference; None if they have fewer than two instants in common."""
        return _paired(track, self.reference[1])


def report_of(
    title: str, folders: Mapping[str, Path], tracks: Mapping[str, Track] | None = None, command: str | None = None
) -> Report:
    """Read run folders of one sequence.

    Args:
        title: The sequence, and what is compared.
        folders: The run folder of each row, by its label.
        tracks: Trajectories of other systems by label: LiDAR poses, as many as the ground truth's or with stamps.
        command: The command line that makes the report again.

    Returns:
        The content; its ground truth is that of the first folder that has one.

    Raises:
        InputError: A folder does not hold a complete run, or a trajectory does not fit the ground truth.
    """
    truth = next((found for folder in folders.values() if (found := read_truth(folder))), None)
    rows = [read_run(label, folder) for label, folder in folders.items()]
    rows += [track_row(label, track, truth) for label, track in (tracks or {}).items()]
    return Report(title, rows, truth, command=command)


def _paired(track: Track, reference: Track) -> Pairs | None:
    if track.stamps is not None and reference.stamps is not None:
        at, theirs = associate(track.stamps, reference.stamps)
    elif len(track.poses) == len(reference.poses):
        at = theirs = np.arange(len(track.poses))
    else:
        return None
    if len(at) < 2:
        return None
    poses = reference.poses[theirs]
    return Pairs(track.poses[at], poses, at, distances(poses))
