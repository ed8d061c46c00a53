"""Scans with more points than any LiDAR has in a sweep: damaged or joined ones, which would stop a run for minutes."""

from __future__ import annotations

from dataclasses import replace

from slam.data.cloud import Frame
from slam.data.problem import Problem

MAX_POINTS = 1_000_000  # the densest LiDARs have half as many, with two returns of 128 lasers


def size_problem(frame: Frame) -> tuple[Problem, ...]:
    """Return a Problem for a scan of more than `MAX_POINTS`."""
    count = len(frame.cloud)
    if count <= MAX_POINTS:
        return ()
    text = f"scan {frame.index}: {count} points, more than any LiDAR has in a sweep; every {_step(count)}th is used"
    return (Problem("too many points", text),)


def thinned(frame: Frame) -> Frame:
    """Return the frame with at most `MAX_POINTS`, evenly chosen."""
    count = len(frame.cloud)
    if count <= MAX_POINTS:
        return frame
    return replace(frame, cloud=frame.cloud.select(slice(None, None, _step(count))))


def _step(count: int) -> int:
    return -(-count // MAX_POINTS)
