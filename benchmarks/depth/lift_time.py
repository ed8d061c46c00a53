"""Run time of Lift per scan: computing the network's input, and running the network."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numpy as np

from enrichment.geometry.held_out import hold_out, past_of
from enrichment.geometry.rays import RayGrid
from enrichment.geometry.sparse_scan import Method, SparseScan
from enrichment.lift.features import lift_input
from slam.data.cloud import HISTORY, Array
from slam.data.dataset import Dataset

SCANS, REPEATS = 20, 3  # spread over a drive, and how often each
WITH, WITHOUT = "with image", "without image"
INPUT, NETWORK, BOTH = "input", "network", "both"


def timed(data: Dataset, lift: Method) -> dict[str, dict[str, list[float]]]:
    """Measure milliseconds per scan by view, for input, network and both: the median over SCANS.

    Each scan counts with the median of REPEATS and with their minimum, which other processes disturb less.
    """
    assert data.sensor is not None
    grid, positions = RayGrid(data.sensor), np.linspace(HISTORY, len(data) - 1, SCANS).astype(int)
    parts: tuple[Callable[[SparseScan, RayGrid], object], ...] = (lift_input, lift)
    seconds = {view: np.zeros((len(parts), SCANS, REPEATS)) for view in (WITHOUT, WITH)}
    for index, position in enumerate(positions):
        scan = hold_out(data[position], grid, past=past_of(data, position)).scan
        views = {WITHOUT: replace(scan, read_image=lambda: None), WITH: scan}
        if index == 0:
            lift(scan, grid)  # compiles
        for repeat in range(REPEATS):
            for view, seen in views.items():
                for part, function in enumerate(parts):
                    given, start = replace(seen), perf_counter()
                    function(given, grid)
                    seconds[view][part, index, repeat] = perf_counter() - start
    return {view: _milliseconds(of_view) for view, of_view in seconds.items()}


def _milliseconds(seconds: Array) -> dict[str, list[float]]:
    """Times of input, network and both, from seconds (2, SCANS, REPEATS) of the input and of both."""
    found = np.stack([np.median(seconds, axis=2), seconds.min(axis=2)], axis=-1)
    parts = {INPUT: found[0], NETWORK: found[1] - found[0], BOTH: found[1]}
    return {name: (1e3 * np.median(of_part, axis=0)).tolist() for name, of_part in parts.items()}
