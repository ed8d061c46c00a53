"""The stamps of a topic's messages, and how they go with the time of recording."""

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
        numbers: (N,) int64, theirs in the topic.
        stamps: (N,) float64 [s], NaN where a message has none that can be read.
        lag: Seconds from stamp to recording, usually.
        by_header: Whether the stamps are those of the messages' headers, or times of recording.
        frame: The frame that most of them name.
    """

    numbers: Array
    stamps: Array
    lag: float
    by_header: bool
    frame: str

    def on(self, other: Stamped) -> Array:
        """The stamps (N,) on the clock of `other`: where the two lag by very different times, their clocks are not the
        same, and only the times of recording say how they go together."""
        apart = self.lag - other.lag
        return self.stamps + apart if abs(apart) > APART else self.stamps


def stamped(recording: Recording, topic: str, numbers: Array) -> Stamped:
    """The stamps of some messages (N,) of a topic: of their headers, or where these tell nothing, of recording."""
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
    """What is to be said of stamps that are not the times of recording."""
    if not found.by_header:
        text = f"{where}: the headers have no stamps; the times of recording are taken"
        return (Problem("no time stamps", text),)
    if abs(found.lag) > APART:
        text = f"{where}: recorded {abs(found.lag):.3f} s {'after' if found.lag > 0 else 'before'} their stamps"
        return (Problem("stamps of another clock", f"{text}; the stamps are used"),)
    return ()


def seconds(nanoseconds: Array) -> Array:
    """(N,) float64 of (N,) int64, each the nearest there is."""
    return np.array([int(value) / 10**9 for value in nanoseconds], np.float64)
