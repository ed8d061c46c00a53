"""Statistics of scans that distinguish a simulated drive from a recorded one."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.data.dataset import Dataset
from slam.data.distortion import correct_vertical, deskew
from slam.data.errors import InputError
from slam.data.sensor import Sensor

RANGES = (0.0, 5.0, 10.0, 20.0, 40.0, 80.0, np.inf)  # m
RINGS = 8  # rings that are taken together
CELL, CELL_POINTS, FLATNESS = 1.0, 20, 0.3  # m; a cell is a plane if its least spread is below that part of the next
GROUND = 0.25  # m above or below the plane of the ground
JUMP, NEIGHBOURS = 1.0, np.deg2rad(0.5)  # m; two points of a ring farther apart than that are no neighbours
BETWEEN = 0.3  # m between a point at an edge and each of its neighbours, for it to hang in the air

Figures = dict[str, Any]


def scan_figures(dataset: Dataset, scans: int) -> Figures:
    """Means over `scans` scans, evenly spread over the drive; scans without rings are left out."""
    if dataset.sensor is None:
        raise InputError(f"{dataset.path}: the sensor model is unknown; add a sensor.yaml to the folder")
    positions = np.unique(np.linspace(0, len(dataset) - 1, scans).astype(int))
    clouds = ((int(position), dataset[int(position)].cloud) for position in positions)
    found = [_of_scan(dataset, dataset.sensor, *entry) for entry in clouds if entry[1].ring is not None]
    if not found:
        raise InputError(f"{dataset.path}: no scan with rings; is it a {dataset.sensor.name}?")
    result: Figures = {"scans": len(found)}
    for name in found[0]:
        result[name] = np.nanmean([figures[name] for figures in found], axis=0).tolist()
    counts = [figures["points"] for figures in found]
    result["points_5_95"] = np.percentile(counts, [5, 95]).tolist()
    result["ring_points"] = np.median([figures["ring_points"] for figures in found], axis=0).tolist()
    return result


def _of_scan(dataset: Dataset, sensor: Sensor, position: int, recorded: PointCloud) -> Figures:
    cloud = correct_vertical(deskew(recorded, _velocity(dataset, position)), sensor.vertical_correction)
    reach = np.linalg.norm(cloud.xyz, axis=1)
    shares = np.histogram(reach, RANGES)[0] / len(reach)
    return {
        "points": float(len(cloud)),
        "range_shares": shares,
        "ring_points": _by_ring(recorded.ring, sensor),
        **_planes(cloud.xyz),
        "ground_share": _ground_share(cloud.xyz),
        "spacing_m": _spacing(cloud.xyz, reach),
        "reflectance": np.percentile(recorded.intensity, [5, 25, 50, 75, 95]),
        "dark_share": np.mean(recorded.intensity == 0),
        **_edges(recorded, sensor),
    }


def _velocity(dataset: Dataset, position: int) -> Array:
    """(6,) [rad/s, m/s] at a scan, from the ground truth of its neighbours; none where that is unknown."""
    truth = dataset.ground_truth
    first, last = max(position - 1, 0), min(position + 1, len(dataset) - 1)
    if truth is None or first == last or not np.isfinite(truth[[first, last]]).all():
        return np.zeros(6)
    way = se3.log(se3.inverse(truth[first]) @ truth[last])
    return np.asarray(way / (dataset.stamps[last] - dataset.stamps[first]))


def _by_ring(ring: Array | None, sensor: Sensor) -> Array:
    assert ring is not None
    return np.bincount(ring, minlength=sensor.ring_count).astype(float)


def _planes(xyz: Array) -> Figures:
    """RMS distance [m] of points from the plane of their cell, median and 90 %: flat cells and upright ones."""
    cell = np.floor(xyz / CELL).astype(np.int64)
    order = np.lexsort(cell.T)
    starts = np.flatnonzero(np.r_[True, (np.diff(cell[order], axis=0) != 0).any(axis=1)])
    count = np.diff(np.r_[starts, len(xyz)])
    points = xyz[order].astype(float) - np.repeat(CELL * cell[order][starts], count, axis=0)
    mean = np.add.reduceat(points, starts) / count[:, None]
    square = np.add.reduceat(points[:, :, None] * points[:, None, :], starts) / count[:, None, None]
    spread, axes = np.linalg.eigh((square - mean[:, :, None] * mean[:, None, :])[count >= CELL_POINTS])
    rms = np.sqrt(np.maximum(spread, 0))
    plane = (rms[:, 1] > CELL / 10) & (rms[:, 0] < FLATNESS * rms[:, 1])
    slope = np.abs(axes[:, 2, 0])
    return {
        name: np.percentile(chosen, [50, 90]) if len(chosen := rms[plane & mask, 0]) else np.full(2, np.nan)
        for name, mask in (("flat_m", slope > 0.9), ("upright_m", slope < 0.3))
    }


def _ground_share(xyz: Array) -> float:
    """Figures of the points near the plane that best fits the ground around the car."""
    rho = np.hypot(xyz[:, 0], xyz[:, 1])
    around = xyz[(rho > 3) & (rho < 30)].astype(float)
    low = np.percentile(around[:, 2], 20)
    plane = np.array([0.0, 0.0, low])
    for _ in range(4):
        near = np.abs(around[:, 2] - _height(around, plane)) < GROUND
        if near.sum() < 3:
            return float("nan")
        plane = np.linalg.lstsq(np.c_[around[near, :2], np.ones(near.sum())], around[near, 2], rcond=None)[0]
    return float(np.mean(np.abs(xyz[:, 2] - _height(xyz, plane)) < GROUND))


def _height(xyz: Array, plane: Array) -> Array:
    return np.asarray(xyz[:, :2] @ plane[:2] + plane[2])


def _spacing(xyz: Array, reach: Array) -> Array:
    """Median distance to the nearest other point [m], by range; every tenth point is asked."""
    asked = slice(None, None, 10)
    distance = cKDTree(xyz).query(xyz[asked], 2)[0][:, 1]
    bins = np.digitize(reach[asked], RANGES) - 1
    return np.array([np.median(distance[bins == i]) if (bins == i).any() else np.nan for i in range(len(RANGES) - 1)])


def _edges(cloud: PointCloud, sensor: Sensor) -> Figures:
    """Range jumps along the rings, per ring and as a share of all points; share of points between two surfaces."""
    assert cloud.ring is not None
    rho = np.hypot(cloud.xyz[:, 0], cloud.xyz[:, 1])
    turn = np.diff(np.arctan2(cloud.xyz[:, 1], cloud.xyz[:, 0]))
    beside = (np.diff(cloud.ring) == 0) & (np.abs((turn + np.pi) % (2 * np.pi) - np.pi) < NEIGHBOURS)
    step = np.where(beside, np.diff(rho), 0)
    jump = np.abs(step) > JUMP
    hanging = (step[:-1] * step[1:] > 0) & (np.minimum(np.abs(step[:-1]), np.abs(step[1:])) > BETWEEN)
    return {
        "ring_jumps": _by_ring(cloud.ring[1:][jump], sensor),
        "jump_share": jump.mean(),
        "hanging_share": hanging.mean(),
    }
