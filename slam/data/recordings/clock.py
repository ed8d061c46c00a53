"""Stamps of a topic's messages, compared with the times of recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.data.cloud import Array
from slam.data.problem import Problem
from slam.data.recordings.recording import Recording
from slam.data.stamps import usual_step

APART = 0.5  # s between stamps and recording, more than any driver or network takes


@dataclass(frozen=True, eq=False)
class Stamped:
    """Some messages of a topic.

    Attributes:
        numbers: (N,) int64, numbers of the messages in the topic.
        stamps: (N,) float64 [s], NaN for a message without a readable stamp.
        lag: Median time from stamp to recording [s].
        by_header: Whether the stamps are those of the messages' headers; if not, they are times of recording.
        frame: The frame that most of the messages name.
    """

    numbers: Array
    stamps: Array
    lag: float
    by_header: bool
    frame: str

    def on(self, other: Stamped) -> Array:
        """Return the stamps (N,) [s] on the clock of `other`.

        If the lags of the two differ by more than `APART`, their clocks differ, and the times of recording relate them.
        """
        apart = self.lag - other.lag
        return self.stamps + apart if abs(apart) > APART else self.stamps


def stamped(recording: Recording, topic: str, numbers: Array) -> Stamped:
    """Return the stamps of the messages `numbers` (N,) of a topic.

    They are those of the headers; the times of recording if the headers have none, all the same, or all 0.
    """
    recorded = seconds(recording.times(topic)[numbers])
    headers = [recording.header(topic, int(number)) for number in numbers]
    stamps = np.array([np.nan if header is None else header.stamp / 10**9 for header in headers])
    frames = [header.frame for header in headers if header is not None]
    frame = max(set(frames), key=frames.count) if frames else ""
    known = np.isfinite(stamps)
    if not known.any() or (len(numbers) > 1 and usual_step(stamps) is None) or (stamps[known] == 0).all():
        return Stamped(numbers, recorded, 0.0, False, frame)
    lag = float(np.median(recorded[known] - stamps[known]))
    return Stamped(numbers, stamps, lag, True, frame)


def clock_problems(found: Stamped, where: str) -> tuple[Problem, ...]:
    """Return a Problem if stamps are missing or differ from the times of recording by more than `APART`."""
    if not found.by_header:
        text = f"{where}: the headers have no stamps; the times of recording are taken"
        return (Problem("no time stamps", text),)
    if abs(found.lag) > APART:
        text = f"{where}: recorded {abs(found.lag):.3f} s {'after' if found.lag > 0 else 'before'} their stamps"
        return (Problem("stamps of another clock", f"{text}; the stamps are used"),)
    return ()


def seconds(nanoseconds: Array) -> Array:
    """Convert nanoseconds (N,) int64 to seconds (N,) float64, each correctly rounded."""
    return np.array([int(value) / 10**9 for value in nanoseconds], np.float64)
