"""What Lift learns from: rings of a scan that it is given, and the returns of others that it shall predict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset as Examples

from enrichment.geometry.held_out import past_of, ring_step
from enrichment.geometry.rays import MAX_COLUMNS, RayGrid, columns_for
from enrichment.geometry.sparse_scan import SparseScan, of_rings
from enrichment.lift.channels import COLUMN_MULTIPLE, Ray
from enrichment.lift.features import LiftInput, lift_input
from enrichment.training.image_examples import COARSER, FINER, colour_jitter, shuffled
from slam.data import se3
from slam.data.cloud import HISTORY, Array, Frame, History, PointCloud
from slam.data.dataset import Dataset
from slam.data.sensor import Sensor

HELD_OUT = 1 / 3  # of the rings, where a LiDAR has few: no two neighbours, so that gaps are twice as wide at most
BLIND = 0.2  # of the examples have no image
ALONE = 0.3  # of the examples have no past
MOVED, TURNED = 0.02, 0.0005  # m, rad: standard deviations of a prediction's error, each axis
CROP, BLURRED = 600, 40  # columns of an example, and of these on either side without answers
LARGEST = 1.3  # times as large, or as small, is a scene without an image


class LiftExample(NamedTuple):
    """What `Lift.forward` takes, and the answers: truth (1, Q, W) metres along rho, 0 = no return there."""

    rings: Tensor
    upper: Tensor
    rays: Tensor
    candidates: Tensor
    truth: Tensor


class TrainingScans(Examples[LiftExample]):
    """`count` examples from number `first` on: rings, past, image or none, mirror, light, size and part are drawn.

    An example is a part of CROP columns, every other one what the camera sees. With `own_rings` a sensor of 64 lines is
    taken for one of every fourth of them, and only these are the answers.
    """

    def __init__(self, drives: Sequence[Dataset], own_rings: bool, seed: int, first: int, count: int) -> None:
        self._drives, self._own_rings = drives, own_rings
        self._places = [(drive, k) for drive in drives for k in range(len(drive))]
        self._seed, self._first, self._count = seed, first, count

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: int) -> LiftExample:
        place, rng = shuffled(self._seed, self._first + index, len(self._places))
        drive, k = self._places[place]
        frame, sensor = drive[k], drive.sensor
        assert sensor is not None
        past = random_past(drive, k, rng)
        image = None if frame.image is None or rng.random() < BLIND else colour_jitter(frame.image, rng)
        if image is None:
            factor = LARGEST ** rng.uniform(-1, 1)
            frame = replace(frame, cloud=_resized(frame.cloud, sensor, factor))
            past = [(_resized(then, sensor, factor), _scaled(T_now_then, factor)) for then, T_now_then in past]
        kept, asked = random_rings(sensor, self._own_rings, rng)
        whole = example(frame, sensor, kept, asked, image, past, mirrored=rng.random() < 0.5)
        ahead = image is not None and rng.random() < 0.5
        return part_of(whole, int(rng.integers(whole.rays.shape[-1])) if not ahead else _ahead(whole))


class ValidationScans(Examples[LiftExample]):
    """All scans, every so-many-th ring from the first one on, with the image: as while driving."""

    def __init__(self, drives: Sequence[Dataset]) -> None:
        self._places = [(drive, k) for drive in drives for k in range(len(drive))]

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, index: int) -> LiftExample:
        drive, k = self._places[index]
        frame, sensor = drive[k], drive.sensor
        assert sensor is not None
        rings = np.arange(sensor.ring_count)
        kept = rings % ring_step(sensor) == 0
        return example(frame, sensor, rings[kept], rings[~kept], frame.image, past_of(drive, k))


def random_past(drive: Dataset, position: int, rng: np.random.Generator) -> History:
    """Scans before one of a drive, fewer or none now and then, placed as well as a prediction places them."""
    count = 0 if rng.random() < ALONE else int(rng.integers(1, HISTORY + 1))
    return [(then, _misplaced(T_now_then, rng)) for then, T_now_then in past_of(drive, position, count)]


def _misplaced(T_now_then: Array, rng: np.random.Generator) -> Array:
    """With an error of normal distribution."""
    error = se3.exp(np.concatenate([rng.normal(0, TURNED, 3), rng.normal(0, MOVED, 3)]))
    return np.asarray(error @ T_now_then)


def random_rings(sensor: Sensor, own_rings: bool, rng: np.random.Generator) -> tuple[Array, Array]:
    """Ids of the rings that are given, and of those that are asked for."""
    rings, step = np.arange(sensor.ring_count), ring_step(sensor)
    if step == 4 and not own_rings:
        step = int(rng.choice((2, 4, 8), p=(FINER, 1 - FINER - COARSER, COARSER)))
        kept = rings % step == rng.integers(step)
        return rings[kept], rings[~kept]
    if step == 4:
        rings = rings[rng.integers(4) :: 4]
    held = np.zeros(len(rings), bool)
    for place in rng.permutation(np.arange(1, len(rings) - 1))[: round(HELD_OUT * len(rings))]:
        held[place] = not (held[place - 1] or held[place + 1])
    return rings[~held], rings[held]


def example(
    frame: Frame,
    sensor: Sensor,
    kept: Array,
    asked: Array,
    image: Array | None,
    past: History = (),
    mirrored: bool = False,
) -> LiftExample:
    """Of a frame with rings; `kept` and `asked` are ring ids, top first."""
    cloud = frame.cloud
    assert cloud.ring is not None
    columns = min(MAX_COLUMNS, columns_for(cloud)) // COLUMN_MULTIPLE * COLUMN_MULTIPLE
    grid = RayGrid(sensor, columns)
    before = [(of_rings(then, kept), T_now_then) for then, T_now_then in past]
    scan = SparseScan(of_rings(cloud, kept), sensor, kept, lambda: image, frame.calibration, columns, lambda: before)
    return _tensors(lift_input(scan, grid), _truth(of_rings(cloud, asked), grid), mirrored)


def part_of(whole: LiftExample, centre: int) -> LiftExample:
    """CROP columns around one. Next to its edges nothing is asked: there the network sees less than while driving."""
    columns = whole.rays.shape[-1]
    if columns <= CROP:
        return whole
    some = torch.arange(centre - CROP // 2, centre + CROP // 2) % columns
    rings, upper, rays, candidates, truth = whole
    truth = truth[..., some].clone()
    truth[..., :BLURRED], truth[..., -BLURRED:] = 0, 0
    return LiftExample(rings[..., some], upper, rays[..., some], candidates[..., some], truth)


def _ahead(whole: LiftExample) -> int:
    """The column in the middle of those that the camera sees; the camera may look across the seam."""
    seen = (whole.rays[0, Ray.SEEN] > 0).any(dim=0)
    angle = 2 * np.pi * torch.arange(len(seen)) / len(seen)
    mean = torch.atan2((angle.sin() * seen).sum(), (angle.cos() * seen).sum())
    return int(mean / (2 * np.pi) * len(seen)) % len(seen)


def _truth(cloud: PointCloud, grid: RayGrid) -> Array:
    """(R, W) float32: rho of the nearest return on each ray, 0 without any."""
    assert cloud.ring is not None
    rho = np.hypot(cloud.xyz[:, 0], cloud.xyz[:, 1])
    truth = np.full(grid.shape, np.inf, np.float32)
    np.minimum.at(truth, (cloud.ring.astype(np.int64), grid.column_of(cloud.xyz)), rho)
    return np.where(np.isfinite(truth), truth, np.float32(0))


def _tensors(given: LiftInput, truth: Array, mirrored: bool) -> LiftExample:
    arrays = (
        values[..., ::-1] if mirrored else values
        for values in (given.rings, given.rays, given.candidates, truth[given.rows])
    )
    rings, rays, candidates, answers = (torch.from_numpy(np.ascontiguousarray(values))[None] for values in arrays)
    return LiftExample(rings, torch.from_numpy(given.upper), rays, candidates, answers)


def _resized(cloud: PointCloud, sensor: Sensor, factor: float) -> PointCloud:
    """A scene so many times as large, seen along the same laser lines: scaled from where each laser is."""
    assert cloud.ring is not None
    laser = sensor.offset[cloud.ring] * (1 - factor)
    return cloud.with_xyz((factor * cloud.xyz + np.column_stack([0 * laser, 0 * laser, laser])).astype(np.float32))


def _scaled(T_now_then: Array, factor: float) -> Array:
    scaled = T_now_then.copy()
    scaled[:3, 3] *= factor
    return scaled
