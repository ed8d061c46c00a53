"""The odometry's answers of a run, frame by frame, in little memory."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import overload

import numpy as np

from slam.data.cloud import Array
from slam.data.growing import Growing

#: Stages of a frame; "waiting" is the time that the odometry waits for the mapper, which has stages of its own.
STAGES = ("load", "front_end", "odometry", "waiting")
STATUSES = ("registered", "retried", "degenerate", "failed")
ALL_OBSERVED = np.zeros((0, 6))  # no unobservable directions
INDEX, STAMP, STATUS, INLIERS, POINTS = range(5)  # columns of a row of `Records`; the covariance is behind the pose
LAPS, POSE = slice(5, 5 + len(STAGES)), slice(5 + len(STAGES), 21 + len(STAGES))


@dataclass(frozen=True, eq=False)
class FrameRecord:
    """The odometry's answer for one frame.

    Attributes:
        index: The frame's number in its data set; in a live run its position, from 0.
        stamp: Seconds.
        pose: (4, 4) T_world_lidar; the world is the first scan's frame.
        covariance: (6, 6) of the motion since the scan before, as in `OdometryStep`.
        status: 'registered', 'retried', 'degenerate' or 'failed', as in `OdometryStep`.
        inlier_ratio: Share of the matched points that fit the map, 0..1; NaN if nothing was registered.
        points: Number of points that the front end passed to the odometry.
        milliseconds: Run time by the stages `STAGES`.
        unobserved: (K, 6) unit vectors (rotation, translation) in the sensor frame in which a degenerate scan did not
            constrain the pose: along them the pose is the prediction. (0, 6) for any other scan.
    """

    index: int
    stamp: float
    pose: Array
    covariance: Array
    status: str
    inlier_ratio: float
    points: int
    milliseconds: dict[str, float]
    unobserved: Array = field(default_factory=lambda: ALL_OBSERVED)


class Records(Sequence[FrameRecord]):
    """The records of a run: 0.5 kB per frame, since they grow as long as the run.

    Args:
        records: The first ones.
    """

    def __init__(self, records: Iterable[FrameRecord] = ()) -> None:
        self._rows = Growing(POSE.stop + 36)
        self._unobserved: dict[int, Array] = {}  # of degenerate frames, by position
        for record in records:
            self.append(record)

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, position: int) -> FrameRecord: ...
    @overload
    def __getitem__(self, position: slice) -> list[FrameRecord]: ...
    def __getitem__(self, position: int | slice) -> FrameRecord | list[FrameRecord]:
        if isinstance(position, slice):
            return [self[each] for each in range(*position.indices(len(self)))]
        row, position = self._rows[position], range(len(self))[position]
        index, status, points = row[[INDEX, STATUS, POINTS]].astype(int).tolist()
        return FrameRecord(
            index, float(row[STAMP]), row[POSE].reshape(4, 4), row[POSE.stop :].reshape(6, 6), STATUSES[status],
            float(row[INLIERS]), points, dict(zip(STAGES, row[LAPS].tolist(), strict=True)),
            self._unobserved.get(position, ALL_OBSERVED),
        )  # fmt: skip

    def append(self, record: FrameRecord) -> None:
        """Append the record of the next frame."""
        self._rows.append(_row(record))
        self._note(len(self) - 1, record)

    def __setitem__(self, position: int, record: FrameRecord) -> None:
        self._rows[position] = _row(record)
        self._note(range(len(self))[position], record)

    @property
    def indices(self) -> Array:
        """Numbers (N,) of the frames in their data set."""
        return self._rows.array(INDEX).astype(int)

    @property
    def stamps(self) -> Array:
        """Stamps (N,) [s]."""
        return self._rows.array(STAMP)

    @property
    def poses(self) -> Array:
        """Poses (N, 4, 4) T_world_lidar."""
        return self._rows.array(POSE).reshape(-1, 4, 4)

    @property
    def covariances(self) -> Array:
        """Covariances (N, 6, 6) of the motions."""
        return self._rows.array(slice(POSE.stop, None)).reshape(-1, 6, 6)

    @property
    def statuses(self) -> list[str]:
        """Statuses of the N frames."""
        return [STATUSES[int(code)] for code in self._rows.array(STATUS)]

    @property
    def unobserved(self) -> list[Array]:
        """Unobservable directions of the N frames, each (K, 6)."""
        return [self._unobserved.get(position, ALL_OBSERVED) for position in range(len(self))]

    def milliseconds(self, stage: str) -> Array:
        """Return the run times (N,) of a stage."""
        return self._rows.array(LAPS.start + STAGES.index(stage))

    def _note(self, position: int, record: FrameRecord) -> None:
        self._unobserved.pop(position, None)
        if len(record.unobserved):
            self._unobserved[position] = record.unobserved


def _row(record: FrameRecord) -> Array:
    """All numbers of a record but the unobservable directions, which few frames have."""
    laps = [record.milliseconds[stage] for stage in STAGES]
    numbers = [record.index, record.stamp, STATUSES.index(record.status), record.inlier_ratio, record.points, *laps]
    return np.concatenate([numbers, record.pose.ravel(), record.covariance.ravel()])
