"""Training examples of Lift: some rings of a scan as input, the returns of other rings as target."""

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
from enrichment.geometry.sparse_scan import SparseScan, select_rings
from enrichment.lift.channels import COLUMN_MULTIPLE, Ray
from enrichment.lift.features import LiftInput, lift_input
from enrichment.training.image_examples import COARSER, FINER, colour_jitter, shuffled
from slam.data import se3
from slam.data.cloud import HISTORY, Array, Frame, History, PointCloud
from slam.data.dataset import Dataset
from slam.data.sensor import Sensor

HELD_OUT = 1 / 3  # share of held-out rings of a LiDAR with few rings: none adjacent, so gaps at most double
NO_IMAGE = 0.2  # share of the examples without an image
NO_PAST = 0.3  # share of the examples without earlier scans
TRANSLATION_NOISE, ROTATION_NOISE = 0.02, 0.0005  # m, rad: standard deviations of predicted poses, per axis
CROP, MARGIN = 600, 40  # columns of an example, and columns at both edges without targets
MAX_SCALE = 1.3  # maximum random scale factor of a scene without an image


class LiftExample(NamedTuple):
    """The input of `Lift.forward`, and the target `truth` (1, Q, W) [m] along rho, 0 = no return."""

    rings: Tensor
    upper: Tensor
    rays: Tensor
    candidates: Tensor
    truth: Tensor


class TrainingScans(Examples[LiftExample]):
    """Training examples with random rings, history, image or none, mirroring, colour jitter, scale and crop.

    An example has CROP columns; half of those with an image are in the camera's field of view.

    Args:
        sequences: The sequences.
        own_rings: Treat a sensor of 64 lines as one with every fourth of them, and use only these as targets.
        seed: Random seed.
        first: Number of the first example.
        count: Number of examples.
    """

    def __init__(self, sequences: Sequence[Dataset], own_rings: bool, seed: int, first: int, count: int) -> None:
        self._sequences, self._own_rings = sequences, own_rings
        self._places = [(sequence, k) for sequence in sequences for k in range(len(sequence))]
        self._seed, self._first, self._count = seed, first, count

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: int) -> LiftExample:
        place, rng = shuffled(self._seed, self._first + index, len(self._places))
        sequence, k = self._places[place]
        frame, sensor = sequence[k], sequence.sensor
        assert sensor is not None
        past = random_past(sequence, k, rng)
        image = None if frame.image is None or rng.random() < NO_IMAGE else colour_jitter(frame.image, rng)
        if image is None:
            factor = MAX_SCALE ** rng.uniform(-1, 1)
            frame = replace(frame, cloud=_resized(frame.cloud, sensor, factor))
            past = [(_resized(then, sensor, factor), _scaled(T_now_then, factor)) for then, T_now_then in past]
        kept, asked = random_rings(sensor, self._own_rings, rng)
        whole = example(frame, sensor, kept, asked, image, past, mirrored=rng.random() < 0.5)
        ahead = image is not None and rng.random() < 0.5
        centre = _camera_column(whole) if ahead else int(rng.integers(whole.rays.shape[-1]))
        return crop_columns(whole, centre)


class ValidationScans(Examples[LiftExample]):
    """Validation examples: all scans with image and history, every `ring_step`-th ring as input, as in a run.

    Args:
        sequences: The sequences.
    """

    def __init__(self, sequences: Sequence[Dataset]) -> None:
        self._places = [(sequence, k) for sequence in sequences for k in range(len(sequence))]

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, index: int) -> LiftExample:
        sequence, k = self._places[index]
        frame, sensor = sequence[k], sequence.sensor
        assert sensor is not None
        rings = np.arange(sensor.ring_count)
        kept = rings % ring_step(sensor) == 0
        return example(frame, sensor, rings[kept], rings[~kept], frame.image, past_of(sequence, k))


def random_past(sequence: Dataset, position: int, rng: np.random.Generator) -> History:
    """Return a random number of earlier scans, with relative poses that have the errors of predicted ones."""
    count = 0 if rng.random() < NO_PAST else int(rng.integers(1, HISTORY + 1))
    return [(then, _misplaced(T_now_then, rng)) for then, T_now_then in past_of(sequence, position, count)]


def _misplaced(T_now_then: Array, rng: np.random.Generator) -> Array:
    """The pose with a random, normally distributed error."""
    error = se3.exp(np.concatenate([rng.normal(0, ROTATION_NOISE, 3), rng.normal(0, TRANSLATION_NOISE, 3)]))
    return np.asarray(error @ T_now_then)


def random_rings(sensor: Sensor, own_rings: bool, rng: np.random.Generator) -> tuple[Array, Array]:
    """Draw the indices of input rings and of target rings."""
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
    """Build the example of a frame with ring indices.

    Args:
        frame: The frame.
        sensor: The LiDAR.
        kept: Indices of the input rings, top first.
        asked: Indices of the target rings, top first.
        image: The image (H, W, 3), or None.
        past: Earlier scans with T_now_then.
        mirrored: Mirror left and right.
    """
    cloud = frame.cloud
    assert cloud.ring is not None
    columns = min(MAX_COLUMNS, columns_for(cloud)) // COLUMN_MULTIPLE * COLUMN_MULTIPLE
    grid = RayGrid(sensor, columns)
    before = [(select_rings(then, kept), T_now_then) for then, T_now_then in past]
    given = select_rings(cloud, kept)
    scan = SparseScan(given, sensor, kept, lambda: image, frame.calibration, columns, lambda: before)
    return _tensors(lift_input(scan, grid), _truth(select_rings(cloud, asked), grid), mirrored)


def crop_columns(whole: LiftExample, centre: int) -> LiftExample:
    """Crop CROP columns around a centre; MARGIN columns at both edges have no targets: their context is cut."""
    columns = whole.rays.shape[-1]
    if columns <= CROP:
        return whole
    some = torch.arange(centre - CROP // 2, centre + CROP // 2) % columns
    rings, upper, rays, candidates, truth = whole
    truth = truth[..., some].clone()
    truth[..., :MARGIN], truth[..., -MARGIN:] = 0, 0
    return LiftExample(rings[..., some], upper, rays[..., some], candidates[..., some], truth)


def _camera_column(whole: LiftExample) -> int:
    """The middle column of the camera's field of view, which may include the first and the last column."""
    seen = (whole.rays[0, Ray.SEEN] > 0).any(dim=0)
    angle = 2 * np.pi * torch.arange(len(seen)) / len(seen)
    mean = torch.atan2((angle.sin() * seen).sum(), (angle.cos() * seen).sum())
    return int(mean / (2 * np.pi) * len(seen)) % len(seen)


def _truth(cloud: PointCloud, grid: RayGrid) -> Array:
    """Rho of the nearest return on each ray, (R, W) float32, 0 without any."""
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
    """The scene scaled by a factor, on the same laser lines: points are scaled from the origin of their laser."""
    assert cloud.ring is not None
    laser = sensor.offset[cloud.ring] * (1 - factor)
    return cloud.with_xyz((factor * cloud.xyz + np.column_stack([0 * laser, 0 * laser, laser])).astype(np.float32))


def _scaled(T_now_then: Array, factor: float) -> Array:
    scaled = T_now_then.copy()
    scaled[:3, 3] *= factor
    return scaled
