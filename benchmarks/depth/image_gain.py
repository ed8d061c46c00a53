"""Gain of Lift by the image: errors of networks that were trained with images and without."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from enrichment.geometry.held_out import HeldOut, hold_out, past_of
from enrichment.geometry.rays import Prediction, RayGrid
from enrichment.geometry.sparse_scan import Method, SparseScan
from eval.depth.metrics import Predictions
from slam.data.cloud import Array
from slam.data.dataset import Dataset
from slam.data.sensor import Sensor

JUMP, JUMP_SHARE = 1.0, 0.1  # m, and of the nearer range: two returns that far apart are on two surfaces, but for
ROAD = -1.3  # m: what is lower, seen from the sensor, may be road
FAR_FROM = 40.0  # m
ALL, JUMPS, FAR = "all", "depth jumps", f"beyond {FAR_FROM:g} m"

Gains = dict[str, dict[str, list[float | None]]]


def blind(method: Method) -> Method:
    """The same without an image."""

    def unseeing(scan: SparseScan, grid: RayGrid) -> Prediction:
        return method(replace(scan, read_image=lambda: None), grid)

    return unseeing


def image_gain(
    data: Dataset, seeds: Mapping[str, Sequence[Method]], step: int
) -> dict[str, dict[str, list[float | None]]]:
    """By kind of returns in the image, then with and without it: MAE [mm] by seed."""
    assert data.sensor is not None
    grid, positions = RayGrid(data.sensor), range(0, len(data), step)
    kinds = {kind: Predictions(len(positions)) for kind in (ALL, JUMPS, FAR)}
    for position in positions:
        held = hold_out(data[position], grid, past=past_of(data, position))
        if held.seen is None:
            continue
        answers = {
            f"{name} {seed}": held.answers(method(replace(held.scan), grid))
            for name, methods in seeds.items()
            for seed, method in enumerate(methods)
        }
        kinds[ALL].add(held.ranges, answers, held.seen)
        kinds[JUMPS].add(held.ranges, answers, held.seen & at_jump(held, grid.sensor))
        kinds[FAR].add(held.ranges, answers, held.seen & (held.ranges > FAR_FROM))
    found: Gains = {}
    for kind, of_kind in kinds.items():
        figures = of_kind.figures()
        found[kind] = {
            name: [figures[f"{name} {seed}"].mae_mm for seed in range(len(methods))] for name, methods in seeds.items()
        }
    return found


def at_jump(held: HeldOut, sensor: Sensor) -> Array:
    """Select the rays (M,) bool at depth jumps: returns above and below are far apart, and not both on the road."""
    upper, points = held.scan.rows_above(sensor)[held.ring], held.scan.points
    above, below = points[upper, held.column], points[upper + 1, held.column]
    xyz = held.scan.cloud.xyz
    ranges, low = np.linalg.norm(xyz, axis=1), xyz[:, 2] < ROAD
    change, nearer = np.abs(ranges[above] - ranges[below]), np.minimum(ranges[above], ranges[below])
    jump = change > np.maximum(JUMP, JUMP_SHARE * nearer)
    return np.asarray((upper >= 0) & (above >= 0) & (below >= 0) & jump & ~(low[above] & low[below]))
