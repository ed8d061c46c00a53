"""LI2L: separate branches for LiDAR and image, each with a confidence.

Van Gansbeke, Neven, De Brabandere, Van Gool, "Sparse and Noisy LiDAR Completion with RGB Guidance and Uncertainty", MVA
2019.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from enrichment.networks.depth_network import DepthNetwork, he
from enrichment.networks.erfnet import ERFNet

WIDTH = 32  # channels of the local branch at full resolution, and of ERFNet's decoder at half resolution


class LI2L(DepthNetwork):
    """A global branch, ERFNet on image and depth, and a local one, two hourglasses on depth and the global guidance.

    Each predicts a depth and a confidence; the softmax of the confidences weights the depths. It has 2,544,753
    parameters: 387 fewer than the authors' network, which includes the unused 1 x 1 classifier of ERFNet's encoder.
    """

    def __init__(self) -> None:
        super().__init__()
        self.erfnet = ERFNet(4, 3, narrow=WIDTH)
        self.local = _Local().apply(he)

    def complete(self, image: Tensor, depth: Tensor) -> Tensor:
        """Complete depth in units of FAR."""
        maps, half, quarter = self.erfnet.scales(torch.cat([image, depth], dim=1))
        guidance, global_depth, global_confidence = maps.split(1, dim=1)
        local_depth, local_confidence = self.local(torch.cat([depth, guidance], dim=1), half, quarter).split(1, dim=1)
        weights = torch.softmax(torch.cat([global_confidence, local_confidence], dim=1), dim=1)
        return (weights * torch.cat([global_depth, local_depth], dim=1)).sum(dim=1, keepdim=True)


class _Local(nn.Module):
    """Depth and confidence (B, 2, H, W) from depth and guidance (B, 2, H, W) and ERFNet's features at 1/2 and 1/4."""

    def __init__(self) -> None:
        super().__init__()
        self.first = _convolution(2, WIDTH)
        self.guided, self.refining = _GuidedHourglass(), _RefiningHourglass()
        self.last = nn.Sequential(_convolution(WIDTH, WIDTH), nn.ReLU(), nn.Conv2d(WIDTH, 2, 3, padding=1))

    def forward(self, x: Tensor, half: Tensor, quarter: Tensor) -> Tensor:
        x = functional.relu(self.first(x))
        y, half, quarter = self.guided(x, half, quarter)
        maps: Tensor = self.last(x + self.refining(x + y, half, quarter))
        return maps


class _GuidedHourglass(nn.Module):
    """Hourglass down to 1/4 of the resolution; at 1/2 and 1/4 ERFNet's features are concatenated."""

    def __init__(self) -> None:
        super().__init__()
        two, four = 2 * WIDTH, 4 * WIDTH
        self.to_half = nn.Sequential(_convolution(WIDTH, WIDTH, 2), nn.ReLU(), _convolution(WIDTH, WIDTH), nn.ReLU())
        self.to_quarter = nn.Sequential(_convolution(two, two, 2), nn.ReLU(), _convolution(two, two), nn.ReLU())
        self.up = nn.Sequential(_upsampling(four, two), nn.ReLU(), _upsampling(two, WIDTH))

    def forward(self, x: Tensor, half: Tensor, quarter: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return features at full resolution (WIDTH channels), 1/2 (twice as many) and 1/4 (four times as many)."""
        half = torch.cat([self.to_half(x), half], dim=1)
        quarter = torch.cat([self.to_quarter(half), quarter], dim=1)
        return self.up(quarter), half, quarter


class _RefiningHourglass(nn.Module):
    """Hourglass down to 1/4 of the resolution; at 1/2 and 1/4 the features of the first hourglass are added."""

    def __init__(self) -> None:
        super().__init__()
        two, four = 2 * WIDTH, 4 * WIDTH
        self.to_half = nn.Sequential(
            _convolution(WIDTH, two, 2), nn.BatchNorm2d(two), nn.ReLU(), _convolution(two, two)
        )
        self.to_quarter = nn.Sequential(
            _convolution(two, two, 2), nn.BatchNorm2d(two), nn.ReLU(), _convolution(two, four)
        )
        self.up = nn.Sequential(_upsampling(four, two), nn.ReLU(), _upsampling(two, WIDTH))

    def forward(self, x: Tensor, half: Tensor, quarter: Tensor) -> Tensor:
        half = functional.relu(self.to_half(x) + half)
        quarter = functional.relu(self.to_quarter(half) + quarter)
        y: Tensor = self.up(quarter)
        return y


def _convolution(channels_in: int, channels_out: int, stride: int = 1) -> nn.Conv2d:
    return nn.Conv2d(channels_in, channels_out, 3, stride=stride, padding=1, bias=False)


def _upsampling(channels_in: int, channels_out: int) -> nn.Sequential:
    doubled = nn.ConvTranspose2d(channels_in, channels_out, 3, stride=2, padding=1, output_padding=1, bias=False)
    return nn.Sequential(doubled, nn.BatchNorm2d(channels_out))
