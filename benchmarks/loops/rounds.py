"""Rounds: a simulated drive that comes back to its first frame, driven again and again at 16 channels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from slam.compilation import compile_kernels
from slam.config import load_config
from slam.data import se3
from slam.data.cloud import Array, Frame
from slam.data.dataset import Dataset, open_dataset
from slam.data.errors import InputError
from slam.front_end import RingFrontEnd
from slam.settings import Config
from slam.slam import Slam
from slam.source import sweep_duration, vertical_correction

CHANNELS = "16"
NEAR, TURNED, AWAY = 2.0, 0.2, 100.0  # m, rad and m of path: the drive is back at its first frame


@dataclass(frozen=True, eq=False)
class Rounds:
    """The scans of a round, with the chosen rings only, and their true poses (N, 4, 4) relative to the first."""

    scans: list[Frame]
    truth: Array
    sweep: float
    angle: float

    @staticmethod
    def of(drive: Path) -> Rounds:
        """Read the first round of a simulated drive, and compile what it needs.

        Raises:
            InputError: The drive never comes back to its first frame.
        """
        data, config = open_dataset(drive), load_config(input=CHANNELS)
        compile_kernels(config, lambda: None)
        truth, front_end = data.ground_truth, RingFrontEnd(config.front_end, data.sensor)
        assert truth is not None
        lap = lap_length(truth)
        scans = [_sparse(data, front_end, number) for number in range(lap)]
        angle = vertical_correction(config.front_end, data.sensor)
        return Rounds(scans, se3.inverse(truth[0]) @ truth[:lap], sweep_duration(data), angle)

    def settings(self, *overrides: str) -> Config:
        """Return the settings of a run over these scans: the default ones, and `overrides`."""
        return load_config(overrides=[f"front_end.vertical_correction_deg={np.rad2deg(self.angle)}", *overrides])

    def slam(self, settings: Config) -> Slam:
        """Begin a run."""
        return Slam(settings, sweep_duration=self.sweep)

    def frame(self, number: int) -> Frame:
        """Return a frame of all rounds, with stamps that go on."""
        return replace(self.scans[number % len(self.scans)], index=number, stamp=number * self.sweep)

    def poses(self, frames: int) -> Array:
        """Return the true poses (frames, 4, 4) of all rounds, relative to the first frame."""
        return np.asarray(self.truth[np.arange(frames) % len(self.scans)])

    @property
    def metres(self) -> float:
        """Length of a round."""
        return float(np.linalg.norm(np.diff(self.truth[:, :3, 3], axis=0), axis=1).sum())


def lap_length(truth: Array) -> int:
    """The number of frames until a drive with poses (N, 4, 4) is back at its first frame, heading the same way.

    Raises:
        InputError: It never is.
    """
    way = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1))])
    back = se3.inverse(truth[0]) @ truth
    distance = np.linalg.norm(back[:, :3, 3], axis=1)
    turned = np.abs(np.arctan2(back[:, 1, 0], back[:, 0, 0]))
    near = np.flatnonzero((way > AWAY) & (turned < TURNED) & (distance < NEAR) & (back[:, 0, 3] >= 0))
    if len(near) == 0:
        raise InputError("the drive never comes back to its first frame; give the town's loop")
    return int(near[0])


def _sparse(data: Dataset, front_end: RingFrontEnd, number: int) -> Frame:
    """A frame with the chosen rings only, so that the scans of a round fit into the memory."""
    frame = data[number]
    return Frame(number, frame.stamp, front_end(frame, []))
