"""Disturbances of a drive for robustness tests of the odometry: clock jumps, missing frames, stops, other sizes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from slam.data.cloud import Array, Frame
from slam.data.dataset import Dataset

STANDING = 0.01  # m: who has not come so far since the last frame that was kept stands
STOPS, REPEATS = (0.25, 0.5, 0.75), 30  # where stops are added, as shares of the frames, and how often a frame comes


@dataclass(frozen=True, eq=False)
class Schedule:
    """Selected frames of a drive and their stamps: positions (N,) in the data set, stamps (N,) [s]."""

    positions: Array
    stamps: Array

    @staticmethod
    def recorded(data: Dataset, positions: Sequence[int]) -> Schedule:
        """These frames at their times."""
        return Schedule(np.array(positions), np.asarray(data.stamps)[list(positions)])

    def frames(self, data: Dataset) -> Iterator[Frame]:
        """The frames, read one by one."""
        for position, stamp in zip(self.positions, self.stamps, strict=True):
            yield replace(data[int(position)], stamp=float(stamp))

    def clock_set(self, seconds: float) -> Schedule:
        """From the middle frame on, the clock is ahead by a number of seconds."""
        return replace(self, stamps=self.stamps + seconds * (np.arange(len(self.stamps)) >= len(self.stamps) // 2))

    def chosen(self, index: Array, closed_up: bool = False) -> Schedule:
        """The frames that an index (M,) picks, at their times, or, `closed_up`, one right after the other."""
        return Schedule(self.positions[index], self.stamps[: len(index)] if closed_up else self.stamps[index])

    def stopping(self) -> tuple[Schedule, Array]:
        """With frames at STOPS repeated REPEATS times, one sweep after the other; and the index (M,) of what comes."""
        count = len(self.positions)
        often = np.ones(count, int)
        often[[int(share * count) for share in STOPS]] = REPEATS
        index = np.repeat(np.arange(count), often)
        sweep = float(np.median(np.diff(self.stamps)))
        extra = np.concatenate([[0], np.cumsum(np.diff(index) == 0)])
        return Schedule(self.positions[index], self.stamps[index] + sweep * extra), index


def moving(truth: Array) -> Array:
    """Index (M,) of the frames, of true poses (N, 4, 4), that have come STANDING from the one before that is kept."""
    kept = [0]
    for frame in range(1, len(truth)):
        if np.linalg.norm(truth[frame, :3, 3] - truth[kept[-1], :3, 3]) >= STANDING:
            kept.append(frame)
    return np.array(kept)


def scaled(sizes: Mapping[str, Any], factor: float) -> list[str]:
    """Settings of the odometry by their names, [m] each or several, times a factor: overrides for `load_config`."""
    return [f"odometry.{name}={np.round(np.multiply(size, factor), 6).tolist()}" for name, size in sizes.items()]
