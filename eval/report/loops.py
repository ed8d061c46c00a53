"""Accepted loops of a run, and how well the trajectories agree with them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eval.alignment import associate
from eval.loops import FALSE_BEYOND, Loop, errors
from eval.runs import RunDetails, Track
from slam.data.cloud import Array


@dataclass(frozen=True, eq=False)
class Closure:
    """An accepted loop.

    Attributes:
        loop: The loop.
        before: Distance between its relative pose and that of the odometry [m].
        after: The same of the trajectory after loop closure [m].
        off: The same of the ground truth [m], NaN where it is unknown.
    """

    loop: Loop
    before: float
    after: float
    off: float

    @property
    def false(self) -> bool:
        """Whether the ground truth contradicts the loop."""
        return self.off > FALSE_BEYOND


def closures(run: RunDetails, track: Track, truth: Track | None) -> list[Closure]:
    """Return the accepted loops of a run.

    Args:
        run: The run.
        track: Its trajectory after loop closure.
        truth: The ground truth, None without.
    """
    numbers = run.frames.numbers.tolist()
    known = set(numbers)
    accepted = [loop for loop in run.loops if loop.accepted and {loop.i, loop.j} <= known]
    before = errors(accepted, run.odometry.poses, numbers)
    after = errors(accepted, track.poses, numbers)
    off = errors(accepted, _truth_of_frames(run, truth), numbers)
    return [Closure(*each) for each in zip(accepted, before.tolist(), after.tolist(), off.tolist(), strict=True)]


def _truth_of_frames(run: RunDetails, truth: Track | None) -> Array:
    """True poses of the run's frames, NaN where unknown."""
    poses = np.full((len(run.frames.numbers), 4, 4), np.nan)
    if truth and truth.stamps is not None and run.odometry.stamps is not None:
        ours, theirs = associate(run.odometry.stamps, truth.stamps)
        poses[ours] = truth.poses[theirs]
    return poses
