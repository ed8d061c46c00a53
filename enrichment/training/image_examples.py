"""Random training examples from packed samples: input rings, crop, mirroring and colour jitter.

Example k depends on the seed and on k only, so it is the same in every process and after every interruption.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from enrichment.training.pack import Pack
from enrichment.training.pooling import cells_of, nearest_depth
from enrichment.training.samples import Sample
from slam.data.camera import visible
from slam.data.cloud import Array
from slam.data.depth_map import DEPTH_SCALE
from slam.data.errors import InputError

#: Share of examples with twice and with half as many rings, so that a network does not learn 16 rings only.
FINER, COARSER = 1 / 8, 1 / 8
NEAR = 5  # cells: side of the square around a return in which targets are used
JITTER = 0.3  # maximum relative change of brightness, contrast and saturation


class Example(NamedTuple):
    """A training example; batches have one more axis in front.

    Attributes:
        image: (3, H, W) RGB in 0..1.
        depth: (1, H, W) sparse depth [m], 0 = none.
        target: (1, H, W) target depth [m], 0 = none.
    """

    image: Tensor
    depth: Tensor
    target: Tensor


class Window(NamedTuple):
    """Rectangle of cells of a sample."""

    top: int
    left: int
    height: int
    width: int

    def cut(self, values: Array) -> Array:
        """Return the part of an image (H, W, ...) inside the window."""
        return values[self.top : self.top + self.height, self.left : self.left + self.width]


class TrainingImages(Dataset[Example]):
    """Training examples; each epoch has all frames of the packs in a new random order.

    Args:
        packs: The packs.
        crop: Height and width of an example [cells].
        seed: Random seed.
        first: Number of the first example.
        count: Number of examples.
    """

    def __init__(self, packs: Sequence[Pack], crop: tuple[int, int], seed: int, first: int, count: int) -> None:
        self._frames = [(pack, k) for pack in packs for k in range(len(pack))]
        self._crop, self._seed, self._first, self._count = crop, seed, first, count

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: int) -> Example:
        place, rng = shuffled(self._seed, self._first + index, len(self._frames))
        pack, k = self._frames[place]
        return random_example(pack[k], self._crop, rng)


def shuffled(seed: int, number: int, count: int) -> tuple[int, np.random.Generator]:
    """Return the frame, of `count` frames, of example `number`, and the random generator of the example.

    Each epoch has all frames in a new random order.
    """
    turn, place = divmod(number, count)
    order = np.random.default_rng((seed, 0, turn)).permutation(count)
    return int(order[place]), np.random.default_rng((seed, 1, number))


class ValidationImages(Dataset[Example]):
    """Validation examples: whole frames, with every `ring_step`-th ring from the first one as input.

    Args:
        packs: The packs.
    """

    def __init__(self, packs: Sequence[Pack]) -> None:
        self._frames = [(pack, k) for pack in packs for k in range(len(pack))]

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, index: int) -> Example:
        pack, k = self._frames[index]
        sample = pack[k]
        height, width = sample.target.shape
        window = Window(0, 0, height, width)
        return _example(sample.image, sparse(sample, window, sample.ring_step, 0), sample.target)


def random_example(sample: Sample, crop: tuple[int, int], rng: np.random.Generator) -> Example:
    """Draw a random example of a sample: rings, crop, mirroring and colour jitter, in this order."""
    step = max(int(sample.ring_step * rng.choice((0.5, 1, 2), p=(FINER, 1 - FINER - COARSER, COARSER))), 2)
    phase = int(rng.integers(step))
    top, left = (int(rng.integers(room + 1)) for room in np.subtract(sample.target.shape, crop))
    window = Window(top, left, *crop)
    image, depth = window.cut(sample.image), sparse(sample, window, step, phase)
    target = window.cut(np.where(near_returns(sample), sample.target, np.float32(0)))
    if rng.random() < 0.5:
        image, depth, target = image[:, ::-1], depth[:, ::-1], target[:, ::-1]
    return _example(colour_jitter(image, rng), depth, target)


def near_returns(sample: Sample) -> Array:
    """Select the cells (H, W) bool near returns of any ring.

    Exact targets exist above all rings too, up to the roofs. Half of the squared error would be there, where the input
    has no information and predictions are not used.
    """
    returns = sample.returns
    cells = cells_of(np.column_stack([returns["column"], returns["row"]]).astype(float), sample.scale)
    measured = nearest_depth(cells, returns["depth"] / DEPTH_SCALE, sample.target.shape[:2]) > 0
    return np.asarray(cv2.dilate(measured.astype(np.uint8), np.ones((NEAR, NEAR), np.uint8)) > 0)


def sparse(sample: Sample, window: Window, step: int, phase: int) -> Array:
    """Compute the sparse depth (H, W) float32 [m, 0 = none] of a LiDAR with the rings phase, phase + step, ... only.

    Occlusion is determined from these returns only, as in a run.
    """
    returns = sample.returns[sample.returns["ring"] % step == phase]
    pixels = np.column_stack([returns["column"], returns["row"]]).astype(float)
    cells = cells_of(pixels, sample.scale) - (window.left, window.top)
    inside = ((cells >= 0) & (cells < (window.width, window.height))).all(axis=1)
    corner = np.floor(np.array([window.left, window.top]) / sample.scale)
    shape = tuple(int(size / sample.scale) + 2 for size in (window.height, window.width))
    depth = returns["depth"][inside] / DEPTH_SCALE
    shown = visible(pixels[inside] - corner, depth, shape)
    return nearest_depth(cells[inside][shown], depth[shown], (window.height, window.width))


def colour_jitter(image: Array, rng: np.random.Generator) -> Array:
    """Return an image (H, W, 3) uint8 with random brightness, contrast and saturation."""
    brightness, contrast, saturation = rng.uniform(1 - JITTER, 1 + JITTER, 3).astype(np.float32)
    colours = image.astype(np.float32) * brightness
    colours = (colours - colours.mean()) * contrast + colours.mean()
    grey = colours.mean(axis=2, keepdims=True)
    return np.clip((colours - grey) * saturation + grey, 0, 255).astype(np.uint8)


def require_crop(packs: Sequence[Pack], crop: tuple[int, int]) -> None:
    """Check that crops of (height, width) fit into the images.

    Raises:
        InputError: The images of a pack are smaller.
    """
    for pack in packs:
        first = 0
        for sequence in pack.sequences:
            height, width = pack[first].target.shape
            if crop[0] > height or crop[1] > width:
                fault = f"{sequence.name} has images of {height}x{width} at scale {pack.scale:g}"
                raise InputError(f"{pack.path}: {fault}; choose a --crop that is not larger")
            first += len(sequence.frames)


def _example(image: Array, depth: Array, target: Array) -> Example:
    colours = torch.from_numpy(np.ascontiguousarray(image)).permute(2, 0, 1).float() / 255
    depths = (torch.from_numpy(np.ascontiguousarray(values, np.float32))[None] for values in (depth, target))
    return Example(colours, *depths)
