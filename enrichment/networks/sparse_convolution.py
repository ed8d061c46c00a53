"""Sparsity-invariant convolution (Uhrig et al., "Sparsity Invariant CNNs", 3DV 2017), and its network SCNN."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

EPSILON = 1e-6  # added to the count, so that an empty window gives the bias


class SparseConvolution(nn.Module):
    """Sparse convolution, equation 1 of the paper.

    y = conv(x * m, w) / (sum of m over the window + EPSILON) + b, and m' = maximum of m over the window, for maps x (B,
    in, H, W) with the mask m (B, 1, H, W), 1 where x is known, else 0. The size is unchanged.
    """

    def __init__(self, channels_in: int, channels_out: int, size: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.empty(channels_out, channels_in, size, size))
        self.bias = nn.Parameter(torch.zeros(channels_out))
        # The division turns the sum into a mean. One random value for the whole window, by He et al. for 1 x 1, keeps
        # the scale of a smooth input for any size and density; a second one for each position breaks the symmetry.
        scale = (2 / channels_in) ** 0.5
        with torch.no_grad():
            whole = torch.randn(channels_out, channels_in, 1, 1)
            self.weight.copy_(scale * (whole + torch.randn(self.weight.shape)))

    def forward(self, x: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
        """Compute y and its mask."""
        size = self.weight.shape[-1]
        count = size**2 * functional.avg_pool2d(mask, size, stride=1, padding=size // 2)
        y = functional.conv2d(x * mask, self.weight, padding=size // 2) / (count + EPSILON)
        return y + self.bias[:, None, None], functional.max_pool2d(mask, size, stride=1, padding=size // 2)


class SCNN(nn.Module):
    """Dense depth from sparse depth by five sparse convolutions of 16 channels with ReLU and one of size 1.

    It has 25,585 parameters. Depths are (B, 1, H, W), 0 = none; farther than 12 pixels from any depth the output is the
    bias. It is initialised as a mean: the first channel of each layer is the mean of that channel over the window, and
    the output is the first channel. So outputs are plausible depths, above 0, from the first step on.
    """

    SIZES, CHANNELS = (11, 7, 5, 3, 3), 16

    def __init__(self) -> None:
        super().__init__()
        channels_in = (1, *[self.CHANNELS] * (len(self.SIZES) - 1))
        pairs = zip(channels_in, self.SIZES, strict=True)
        self.layers = nn.ModuleList(SparseConvolution(channels, self.CHANNELS, size) for channels, size in pairs)
        self.last = SparseConvolution(self.CHANNELS, 1, 1)
        with torch.no_grad():
            for layer in (*self.layers, self.last):
                layer.weight[0] = 0
                layer.weight[0, 0] = 1

    def forward(self, depth: Tensor) -> Tensor:
        """Complete depth (B, 1, H, W)."""
        x, mask = depth, (depth > 0).to(depth.dtype)
        for layer in self.layers:
            x, mask = layer(x, mask)
            x = functional.relu(x)
        return self.last(x, mask)[0]
