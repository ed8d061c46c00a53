"""Inputs of the systems: scans as recorded, 16 rings, or 16 rings enriched by a method."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks.odometry.measure import Scan
from benchmarks.odometry.systems import our_odometry
from enrichment.methods.registry import LIFT, METHODS
from lidarlift.front_ends import FEW_RINGS, front_end_for
from slam.config import load_config
from slam.data.cloud import Frame, History, PointCloud
from slam.data.dataset import Dataset
from slam.front_end import FrontEnd, RingFrontEnd
from slam.tracking import Tracker

FULL, SPARSE = "full", "16"
KEPT = 16  # rings of the sparse input
IMAGELESS = (FULL, SPARSE, "ray-segment")
DEFAULT = (FULL, SPARSE, "ray-segment", LIFT)


def names() -> list[str]:
    """All inputs: the two that are measured, and a method of enrichment each."""
    return [FULL, SPARSE, *METHODS.names()]


def add_inputs(parser: argparse.ArgumentParser, default: Sequence[str]) -> None:
    """--inputs INPUT [INPUT ...]."""
    parser.add_argument("--inputs", nargs="+", choices=names(), default=default, metavar="INPUT",
                        help=f"some of {', '.join(names())}; by default {' '.join(default)}")  # fmt: skip


def why_not(name: str, data: Dataset) -> str | None:
    """Why a drive does not have this input; None where it has."""
    if name == FULL:
        return None
    if data.sensor is None:
        return "which rings there are is not known"
    rings = data.sensor.ring_count
    if name == SPARSE:
        return f"the sensor has {rings} rings: as full" if rings <= KEPT else None
    if rings > FEW_RINGS and rings != 64:
        return f"enriched are 16 rings, or 16 of 64; the sensor has {rings}"
    if name == LIFT and rings > FEW_RINGS and (data.calibration is None or data[0].read_image() is None):
        return "no images"
    return None


def channels(name: str, data: Dataset) -> str:
    """The input that lidarlift's settings are made for: '64', '16' or 'enriched'."""
    if name == FULL:
        return "16" if data.sensor is not None and data.sensor.ring_count <= FEW_RINGS else "64"
    return SPARSE if name == SPARSE else "enriched"


def front_end(name: str, data: Dataset) -> FrontEnd:
    """Return the front end that computes an input from the frames of a drive."""
    if channels(name, data) == "enriched":
        return front_end_for(load_config(input="enriched", enricher=name).front_end, data.sensor, data.path)
    return RingFrontEnd(load_config().front_end, data.sensor) if name == FULL else EvenRings(data)


def scans(name: str, data: Dataset, positions: Sequence[int], milliseconds: list[float]) -> Iterator[Scan]:
    """The clouds of a drive's frames, made one by one, with their stamps [s].

    What fills in is shown the past as our odometry places it, as while driving; what it takes goes to `milliseconds`.
    """
    made = front_end(name, data)
    if channels(name, data) != "enriched":
        for position in positions:
            frame = data[position]
            yield made(frame, ()), frame.stamp
        return
    tracker = Tracker(made, our_odometry(load_config(input="enriched").odometry, data))
    for position in positions:
        frame = data[position]
        tracked = tracker(frame)
        milliseconds.append(tracked.milliseconds["front_end"])
        yield tracked.cloud, frame.stamp


class EvenRings(FrontEnd):
    """Sixteen of a sensor's rings, evenly, from the top one on: of 64 every 4th, as input 16 has them."""

    def __init__(self, data: Dataset) -> None:
        assert data.sensor is not None
        self.kept = np.arange(KEPT) * data.sensor.ring_count // KEPT

    def __call__(self, frame: Frame, history: History) -> PointCloud:
        del history  # nothing is filled in here
        cloud = frame.cloud
        return cloud.select(np.zeros(len(cloud), bool) if cloud.ring is None else np.isin(cloud.ring, self.kept))
