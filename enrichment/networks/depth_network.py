"""Base class of the depth completion networks: units, and padding to sizes that can be halved three times."""

from __future__ import annotations

from abc import ABC, abstractmethod

from torch import Tensor, nn
from torch.nn import functional

FAR = 80.0  # m: unit of depth inside the networks, for values near 1
MULTIPLE = 8  # height and width inside the networks are multiples of it


class DepthNetwork(nn.Module, ABC):
    """Network that completes a sparse depth image, given the image.

    There is no activation after the last layer, as in the papers: a depth of 0 or less means none.
    """

    def forward(self, image: Tensor, depth: Tensor) -> Tensor:
        """Complete depth: (B, 1, H, W) [m], from RGB (B, 3, H, W) in 0..1 and depth (B, 1, H, W) [m], 0 = none."""
        height, width = depth.shape[-2:]
        padding = (0, -width % MULTIPLE, 0, -height % MULTIPLE)  # black, and without depth, at the right and bottom
        dense = self.complete(functional.pad(image, padding), functional.pad(depth / FAR, padding))
        return FAR * dense[..., :height, :width]

    @abstractmethod
    def complete(self, image: Tensor, depth: Tensor) -> Tensor:
        """Complete depth in units of FAR, with H and W multiples of eight."""


def he(module: nn.Module) -> None:
    """Initialise convolutions by He et al. 2015 for layers followed by ReLU, and biases with 0; for `Module.apply`."""
    if isinstance(module, nn.Conv2d | nn.ConvTranspose2d):
        nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
        if module.bias is not None:
            nn.init.zeros_(module.bias)
