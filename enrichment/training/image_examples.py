"""Examples drawn from packed samples: which rings are the input, which part of the image, in which light.

Everything that is random about example k follows from the seed and k alone: whoever draws it, and after whatever
interruption, it is the same.
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

#: Now and then twice as many rings or half as many, that a network does not know 16 alone.
FINER, COARSER = 1 / 8, 1 / 8
NEAR = 5  # cells: width and height of the square around a return in which targets are used
LIGHT = 0.3  # brightness, contrast and saturation change by up to such a share


class Example(NamedTuple):
    """What a network is given, image (3, H, W) RGB in 0..1 and depth (1, H, W) in metres, 0 = none; and should answer,
    target (1, H, W). In batches of B there is one more axis before these."""

    image: Tensor
    depth: Tensor
    target: Tensor


class Window(NamedTuple):
    """Cells of a sample."""

    top: int
    left: int
    height: int
    width: int

    def cut(self, values: Array) -> Array:
        return values[self.top : self.top + self.height, self.left : self.left + self.width]


class TrainingImages(Dataset[Example]):
    """`count` examples to train on, of `crop` cells (height, width), from number `first` on.

    All frames of the packs come once, in a new order each time, before one comes again.
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
    """Which of `count` frames example `number` is made of, and what draws the rest of it.

    All frames come once, in a new order each time, before one comes again.
    """
    turn, place = divmod(number, count)
    order = np.random.default_rng((seed, 0, turn)).permutation(count)
    return int(order[place]), np.random.default_rng((seed, 1, number))


class ValidationImages(Dataset[Example]):
    """The frames of packs to validate on: whole, the LiDAR's usual sparse rings from the first one on."""

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
    """A random example of that sample: rings first, then the window, a mirror and the light."""
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
    """(H, W) bool: the cells near returns of any ring. Exact depth is known above them too, up to the roofs: half of
    its squared error would come from there, where no input tells anything and nobody asks."""
    returns = sample.returns
    cells = cells_of(np.column_stack([returns["column"], returns["row"]]).astype(float), sample.scale)
    measured = nearest_depth(cells, returns["depth"] / DEPTH_SCALE, sample.target.shape[:2]) > 0
    return np.asarray(cv2.dilate(measured.astype(np.uint8), np.ones((NEAR, NEAR), np.uint8)) > 0)


def sparse(sample: Sample, window: Window, step: int, phase: int) -> Array:
    """(H, W) float32 [m, 0 = none] of a window: what a LiDAR with rings phase, phase + step, ... alone has there.

    Hidden is what its own returns show to be hidden, as where the network is used.
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
    """An image (H, W, 3) uint8 with other brightness, contrast and saturation."""
    brightness, contrast, saturation = rng.uniform(1 - LIGHT, 1 + LIGHT, 3).astype(np.float32)
    colours = image.astype(np.float32) * brightness
    colours = (colours - colours.mean()) * contrast + colours.mean()
    grey = colours.mean(axis=2, keepdims=True)
    return np.clip((colours - grey) * saturation + grey, 0, 255).astype(np.uint8)


def require_crop(packs: Sequence[Pack], crop: tuple[int, int]) -> None:
    """Raises InputError where crops of (height, width) are larger than the images."""
    for pack in packs:
        first = 0
        for drive in pack.drives:
            height, width = pack[first].target.shape
            if crop[0] > height or crop[1] > width:
                fault = f"{drive.name} has images of {height}x{width} at scale {pack.scale:g}"
                raise InputError(f"{pack.path}: {fault}; choose a --crop of no more than that")
            first += len(drive.frames)


def _example(image: Array, depth: Array, target: Array) -> Example:
    colours = torch.from_numpy(np.ascontiguousarray(image)).permute(2, 0, 1).float() / 255
    depths = (torch.from_numpy(np.ascontiguousarray(values, np.float32))[None] for values in (depth, target))
    return Example(colours, *depths)
