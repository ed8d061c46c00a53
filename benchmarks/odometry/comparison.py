"""One drive, all systems, 64 and 16 channels: from the folder to the figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.odometry.figures import figures
from benchmarks.odometry.measure import measure, warm_up
from benchmarks.odometry.names import CHANNELS, REFERENCE, SYSTEMS
from eval.trajectory import path_length
from slam.data.cloud import Array
from slam.data.dataset import open_dataset

Memory = dict[str, dict[str, float]]  # by system


def compare(path: Path, frames: slice, repeats: int, dense: Array | None, memory: Memory) -> tuple[str, Any, Any]:
    """The drive's name, its figures [system][channels], and facts about it for the report.

    dense  (N, 4, 4) of the dense yardstick, or None
    """
    dataset = open_dataset(path)
    positions = np.arange(len(dataset))[frames]
    scans = [dataset[int(position)] for position in positions]
    truth = None if dataset.ground_truth is None else dataset.ground_truth[positions]

    warm_up(dataset, scans)
    entries: dict[str, Any] = {name: {} for name in SYSTEMS}
    for channels in CHANNELS:
        runs = measure(dataset, scans, channels, repeats)
        for name in SYSTEMS:
            entries[name][channels] = figures(runs[name], runs[REFERENCE], truth, dense)
    for name in SYSTEMS:
        entries[name]["64"].update(memory[name])

    known = None if truth is None else truth[np.isfinite(truth[:, 0, 0])]
    facts = {
        "frames": len(scans),
        "truth_path_length_m": None if known is None or len(known) == 0 else path_length(known),
        "dense": dense is not None,
    }
    return dataset.name, entries, facts
