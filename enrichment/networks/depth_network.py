"""What all networks share: units, and sizes that can be halved three times."""

from __future__ import annotations

from abc import ABC, abstractmethod

from torch import Tensor, nn
from torch.nn import functional

FAR = 80.0  # m: the networks' own unit of depth, for numbers near 1
MULTIPLE = 8  # of which height and width are inside


class DepthNetwork(nn.Module, ABC):
    """From an image and a sparse depth image to a dense one.

    There is no activation behind the last layer, as in the papers: a depth of 0 or less means none.
    """

    def forward(self, image: Tensor, depth: Tensor) -> Tensor:
        """(B, 1, H, W) metres, from RGB (B, 3, H, W) in 0..1 and depth (B, 1, H, W) in metres, 0 = none."""
        height, width = depth.shape[-2:]
        room = (0, -width % MULTIPLE, 0, -height % MULTIPLE)  # black, and without depth, at the right and below
        dense = self.complete(functional.pad(image, room), functional.pad(depth / FAR, room))
        return FAR * dense[..., :height, :width]

    @abstractmethod
    def complete(self, image: Tensor, depth: Tensor) -> Tensor:
        """The same with depths in units of FAR, H and W multiples of eight."""


def he(module: nn.Module) -> None:
    """For `apply`: convolutions start as He et al. 2015 have it for layers followed by ReLU, biases at 0."""
    if isinstance(module, nn.Conv2d | nn.ConvTranspose2d):
        nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
        if module.bias is not None:
            nn.init.zeros_(module.bias)
