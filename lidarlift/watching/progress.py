"""Progress of a run as numbers for a page: frame rate, counts, trajectory and a thinned map so far."""

from __future__ import annotations

import time
from collections import Counter, deque
from dataclasses import dataclass
from threading import Lock
from typing import Any

import numpy as np

from slam.data.cloud import Array, Frame, PointCloud
from slam.mapping_result import LoopProgress
from slam.records import FrameRecord, Records
from slam.run import Observer, Run

PART_POINTS = 250  # of a part of the map: one scan, thinned
PART_DISTANCE = 2.0  # m between two parts at the beginning
MAX_PARTS = 1000  # then every second part is removed, and the distance between two is doubled
RATE_FRAMES = 30  # frames over which the frame rate is averaged
DECIMETRES = 10.0  # coordinates are sent in this unit, as whole numbers


@dataclass(frozen=True, eq=False)
class Part:
    """Some points (N, 3) of the scan at a position in the run, in the sensor's frame."""

    position: int
    xyz: Array


class Progress(Observer):
    """Keeps what a page shows of a run; threads may ask for it at any time, and do not delay the run.

    Args:
        title: Name of the run.
        total: Number of frames of the run.
    """

    def __init__(self, title: str, total: int) -> None:
        self._title, self._total = title, total
        self._run: Run | None = None
        self._begin = time.monotonic()
        self._times: deque[float] = deque(maxlen=RATE_FRAMES)
        self._parts: list[Part] = []
        self._distance, self._last = PART_DISTANCE, np.full(3, np.inf)
        self._version = 0  # grows when positions that were sent have changed
        self._loops: LoopProgress | None = None
        self._final: Array | None = None  # poses of the complete run
        self._lock = Lock()  # of parts, version, loops and final poses, which change together

    def started(self, run: Run) -> None:
        """Begin."""
        self._run = run

    def registered(self, frame: Frame, cloud: PointCloud, record: FrameRecord) -> None:
        """Count the frame, and keep some points of it if the sensor has moved."""
        self._times.append(time.monotonic())
        here = record.pose[:3, 3]
        if len(cloud) == 0 or np.linalg.norm(here - self._last) < self._distance:
            return
        self._last = here
        xyz = cloud.xyz[np.linspace(0, len(cloud) - 1, min(PART_POINTS, len(cloud))).astype(np.int64)]
        with self._lock:
            assert self._run is not None
            self._parts.append(Part(len(self._run.records) - 1, xyz))
            if len(self._parts) > MAX_PARTS:
                self._parts = self._parts[::2]
                self._distance *= 2
                self._version += 1

    def loops_closed(self, progress: LoopProgress) -> None:
        """Correct the positions."""
        with self._lock:
            self._loops, self._version = progress, self._version + 1

    def finished(self, run: Run) -> None:
        """Take the final poses."""
        with self._lock:
            self._final, self._version = run.poses, self._version + 1

    def state(self, version: int = -1, frames: int = 0, parts: int = 0) -> dict[str, Any]:
        """Return what has changed.

        Args:
            version: That of the last answer.
            frames: Number of positions of the trajectory that have been sent.
            parts: Number of parts of the map that have been sent.

        Returns:
            Figures, and the positions from `frames` and the parts from `parts` on, in decimetres; all of them with a
            new version, which replaces earlier ones.
        """
        with self._lock:
            now, loops, final, known = self._version, self._loops, self._final, list(self._parts)
        if version != now:
            frames = parts = 0
        records = self._run.records if self._run else Records()
        poses = self._corrected(records, loops, final)
        return {
            **self._figures(records),
            "version": now,
            "from": [frames, parts],
            "trajectory": _decimetres(poses[frames:, :3, 3]),
            "map": [_in_world(part, poses[part.position]) for part in known[parts:]],
            "loops": self._edges(loops, final, poses),
            "finished": final is not None,
        }

    def _corrected(self, records: Records, loops: LoopProgress | None, final: Array | None) -> Array:
        if final is not None:
            return final
        return loops.corrected(records.poses) if loops else records.poses

    def _figures(self, records: Records) -> dict[str, Any]:
        times = list(self._times)
        rate = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 and times[-1] > times[0] else None
        counts = Counter(records.statuses)
        last = records[-1] if records else None
        return {
            "title": self._title,
            "total": self._total,
            "frames": len(records),
            "seconds": round(time.monotonic() - self._begin, 1),
            "rate": None if rate is None else round(rate, 2),
            "counts": {status: counts[status] for status in ("registered", "retried", "degenerate", "failed")},
            "problems": len(self._run.problems) if self._run else 0,
            "last": None if last is None else {"frame": last.index, "status": last.status, "points": last.points},
        }

    def _edges(self, loops: LoopProgress | None, final: Array | None, poses: Array) -> list[list[list[int]]]:
        """Start and end of each loop."""
        pairs = self._run.loops() if final is not None and self._run else loops.loops if loops else ()
        return [_decimetres(poses[list(pair), :3, 3]) for pair in pairs]


def _in_world(part: Part, pose: Array) -> list[list[int]]:
    return _decimetres(part.xyz @ pose[:3, :3].T + pose[:3, 3])


def _decimetres(xyz: Array) -> list[list[int]]:
    return np.round(DECIMETRES * xyz).astype(np.int64).tolist()
