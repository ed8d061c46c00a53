"""A sequence of three frames towards the wall of the street, and its pack."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from enrichment.training.pack import Pack, packed
from enrichment.training.samples import Source
from slam.data.cloud import Array, Calibration, Frame, PointCloud
from slam.data.sensor import Sensor, load_sensor

HEIGHT, WIDTH, STEP = 80, 240, 1.0  # pixels, pixels, m a frame
T_CAMERA_LIDAR = np.array([[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1.0]])
CALIBRATION = Calibration(np.array([[120.0, 0, 120], [0, 120, 30], [0, 0, 1]]), T_CAMERA_LIDAR)


@dataclass
class Drive:
    """A `Dataset` in memory."""

    path: Path
    clouds: list[PointCloud]
    sensor: Sensor | None = field(default_factory=lambda: load_sensor("hdl64"))
    calibration: Calibration | None = CALIBRATION
    without_image: frozenset[int] = frozenset()
    name: str = "street"
    problems: tuple[()] = ()

    @property
    def numbers(self) -> Array:
        return np.arange(len(self.clouds)) + 10

    @property
    def stamps(self) -> Array:
        return np.arange(len(self.clouds)) * 0.1

    @property
    def ground_truth(self) -> Array:
        poses = np.tile(np.eye(4), (len(self.clouds), 1, 1))
        poses[:, 0, 3] = STEP * np.arange(len(self.clouds))
        return poses

    def __len__(self) -> int:
        return len(self.clouds)

    def __getitem__(self, position: int) -> Frame:
        return Frame(
            position + 10,
            0.1 * position,
            self.clouds[position],
            self.calibration,
            lambda: None if position in self.without_image else image(position),
        )


def image(seed: int) -> Array:
    """Soft random colours, which WebP keeps."""
    coarse = np.random.default_rng(seed).integers(0, 256, (2, 4, 3)).astype(np.uint8)
    return np.kron(coarse, np.ones((HEIGHT // 2, WIDTH // 4, 1), np.uint8))


@pytest.fixture
def sequence(tmp_path: Path, dense: PointCloud) -> Drive:
    """The scan of the street, and how its points lie STEP and 2 STEP farther on."""
    return Drive(tmp_path, [dense.with_xyz(dense.xyz - [position * STEP, 0, 0]) for position in range(3)])


@pytest.fixture
def pack(tmp_path: Path, sequence: Drive) -> Pack:
    return packed(tmp_path / "street.npz", [Source(sequence, sequence.ground_truth, neighbours=1)])


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch) -> Callable[[int | None], None]:
    """`tiny()` makes the network "tiny" known; `tiny(5)`, one that breaks down at its fifth look at an example."""
    import torch
    from torch import Tensor, nn

    from enrichment.networks.depth_network import DepthNetwork
    from enrichment.networks.registry import NETWORKS

    class Tiny(DepthNetwork):
        def __init__(self, breaks_at: int | None) -> None:
            super().__init__()
            norm, dropout = nn.BatchNorm2d(4), nn.Dropout2d(0.3)
            self.layers = nn.Sequential(nn.Conv2d(4, 4, 3, padding=1), norm, nn.ReLU(), dropout, nn.Conv2d(4, 1, 1))
            self.left = breaks_at

        def complete(self, image: Tensor, depth: Tensor) -> Tensor:
            if self.left is not None and self.training:
                self.left -= 1
                if self.left == 0:
                    raise RuntimeError("power failure")
            dense: Tensor = self.layers(torch.cat([image, depth], dim=1))
            return dense

    def known(breaks_at: int | None = None) -> None:
        module = ModuleType("tiny_network")
        module.make = partial(Tiny, breaks_at)  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, "tiny_network", module)
        monkeypatch.setitem(NETWORKS.own, "tiny", "tiny_network:make")  # type: ignore[arg-type]

    return known
