"""ERFNet (Romera et al., "ERFNet: Efficient Residual Factorized ConvNet", T-ITS 2018)."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

EPSILON = 1e-3  # of batch normalisation


class ERFNet(nn.Module):
    """ERFNet, from maps (B, in, H, W) to maps (B, out, H, W), H and W multiples of eight.

    From 4 to 20 maps it has 2,064,336 parameters.

    Args:
        channels_in: Number of input maps.
        channels_out: Number of output maps.
        narrow: Channels of the decoder at half the resolution: 16 in ERFNet, 32 in Van Gansbeke et al. 2019.
    """

    def __init__(self, channels_in: int, channels_out: int, narrow: int = 16) -> None:
        super().__init__()
        self.encoder = nn.Sequential(
            _Downsampler(channels_in, 16),
            _Downsampler(16, 64),
            *[_NonBottleneck1D(64, 0.03) for _ in range(5)],
            _Downsampler(64, 128),
            *[_NonBottleneck1D(128, 0.3, dilation) for dilation in 2 * (2, 4, 8, 16)],
        )
        self.to_quarter = nn.Sequential(_Upsampler(128, 64), _NonBottleneck1D(64), _NonBottleneck1D(64))
        self.to_half = nn.Sequential(_Upsampler(64, narrow), _NonBottleneck1D(narrow), _NonBottleneck1D(narrow))
        self.to_full = nn.ConvTranspose2d(narrow, channels_out, 2, stride=2)

    def forward(self, x: Tensor) -> Tensor:
        """Compute the output maps."""
        return self.scales(x)[0]

    def scales(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Compute the output maps, and the decoder's features at 1/2 (`narrow` channels) and 1/4 resolution (64)."""
        quarter = self.to_quarter(self.encoder(x))
        half = self.to_half(quarter)
        return self.to_full(half), half, quarter


class _Downsampler(nn.Module):
    """Downsampling to half the resolution: a convolution concatenated with 2 x 2 max pooling."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__()
        self.convolution = nn.Conv2d(channels_in, channels_out - channels_in, 3, stride=2, padding=1)
        self.norm = nn.BatchNorm2d(channels_out, eps=EPSILON)

    def forward(self, x: Tensor) -> Tensor:
        both = torch.cat([self.convolution(x), functional.max_pool2d(x, 2)], dim=1)
        return functional.relu(self.norm(both))


class _Upsampler(nn.Sequential):
    """Upsampling to twice the resolution."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__(
            nn.ConvTranspose2d(channels_in, channels_out, 3, stride=2, padding=1, output_padding=1),
            nn.BatchNorm2d(channels_out, eps=EPSILON),
            nn.ReLU(),
        )


class _NonBottleneck1D(nn.Module):
    """Residual block of two 3 x 3 convolutions, each factorised into 3 x 1 and 1 x 3, the second one dilated."""

    def __init__(self, channels: int, dropout: float = 0.0, dilation: int = 1) -> None:
        super().__init__()
        self.block = nn.Sequential(
            nn.Conv2d(channels, channels, (3, 1), padding=(1, 0)),
            nn.ReLU(),
            nn.Conv2d(channels, channels, (1, 3), padding=(0, 1)),
            nn.BatchNorm2d(channels, eps=EPSILON),
            nn.ReLU(),
            nn.Conv2d(channels, channels, (3, 1), padding=(dilation, 0), dilation=(dilation, 1)),
            nn.ReLU(),
            nn.Conv2d(channels, channels, (1, 3), padding=(0, dilation), dilation=(1, dilation)),
            nn.BatchNorm2d(channels, eps=EPSILON),
            nn.Dropout2d(dropout),
        )

    def forward(self, x: Tensor) -> Tensor:
        return functional.relu(self.block(x) + x)
