"""The network Lift: ranges and their uncertainty on rays between the rings of a LiDAR, over 360 deg."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from enrichment.lift.channels import CANDIDATES, RAYS, RINGS, Candidate, Ray

ASIDE = 2  # columns to each side of a ray in its convolution
AROUND = 88  # columns of circular padding: at least the receptive field of the U-Net, and a multiple of 8
RESIDUAL = 0.05  # maximum correction, share of the range
NEAR_SEGMENT = 2.0  # initial logit of the candidate SEGMENT
MIN_SCALE = 0.01  # m


class Sizes(NamedTuple):
    """Sizes of the network, which decide its run time.

    Attributes:
        widths: Channels at 1, 1/2, 1/4 and 1/8 of the columns. 0 at first: the network has no level of all columns, and
            two columns share the features of their returns.
        hidden: Channels of a ray.
    """

    widths: tuple[int, int, int, int]
    hidden: int


LARGE = Sizes((32, 32, 48, 64), 48)  # as shipped
SMALL = Sizes((0, 16, 32, 48), 32)  # 0.43 of the run time of LARGE; see docs/lift.md for what it loses


class Answer(NamedTuple):
    """Output of Lift.

    Attributes:
        ranges: (B, Q, W), metres along rho.
        scale: (B, Q, W), scale of a Laplace distribution around the range [m].
        valid: (B, Q, W), logit of the presence of a return.
        logits: (B, CANDIDATES, Q, W), logits of the candidates' weights.
    """

    ranges: Tensor
    scale: Tensor
    valid: Tensor
    logits: Tensor


class Lift(nn.Module):
    """A U-Net over the range image of the rings, and a small network for each ray between two rings.

    The range of a ray is a weighted mean of its candidates, times a factor of 1 +- RESIDUAL. The weights depend on the
    surrounding rings, the ray's features and those of the adjacent rays. So the range is near some possible surface.

    Attributes:
        sizes: Numbers of channels.
    """

    def __init__(self, sizes: Sizes = LARGE) -> None:
        super().__init__()
        self.sizes = sizes
        (full, half, quarter, eighth), hidden = sizes
        self.stem = _Convolution(RINGS, full) if full else None
        self.to_half = nn.Sequential(_Convolution(full or RINGS, half, stride=2), _Block(half))
        self.to_quarter = nn.Sequential(_Convolution(half, quarter, stride=2), _Block(quarter), _Block(quarter, 2))
        self.to_eighth = nn.Sequential(_Convolution(quarter, eighth, stride=2), _Block(eighth), _Block(eighth, 2))
        self.up_quarter, self.up_half = _Up(eighth, quarter), _Up(quarter, half)
        self.up_full = _Up(half, full) if full else None
        features = full or half
        self.from_above, self.from_below = nn.Conv2d(features, hidden, 1, bias=False), nn.Conv2d(features, hidden, 1)
        self.from_ray = nn.Conv2d(RAYS, hidden, 1, bias=False)
        self.beside = nn.Conv2d(hidden, hidden, (1, 2 * ASIDE + 1), groups=hidden)
        self.mix, self.last = nn.Conv2d(hidden, hidden, 1), nn.Conv2d(hidden, CANDIDATES + 3, 1)
        with torch.no_grad():
            self.beside.weight[..., ASIDE] += 1.0
            self.last.weight.mul_(0.1)
            assert self.last.bias is not None
            self.last.bias.copy_(torch.eye(CANDIDATES + 3)[Candidate.SEGMENT] * NEAR_SEGMENT)

    def forward(self, rings: Tensor, upper: Tensor, rays: Tensor, candidates: Tensor) -> Answer:
        """Predict ranges; W must be a multiple of 8 and at least AROUND.

        Args:
            rings: (B, RINGS, K, W).
            upper: (Q,).
            rays: (B, RAYS, Q, W).
            candidates: (B, CANDIDATES, Q, W).
        """
        return self.along_rays(self.between(rings), upper, rays, candidates)

    def along_rays(self, between: Tensor, upper: Tensor, rays: Tensor, candidates: Tensor) -> Answer:
        """Predict the ranges of any Q rays from `between` and the arguments of `forward`."""
        x = functional.relu(between.index_select(2, upper) + self.from_ray(_around(rays, ASIDE)))
        x = functional.relu(self.mix(functional.relu(self.beside(x))))
        return self._answer(self.last(x).float(), rays, candidates)

    def between(self, rings: Tensor) -> Tensor:
        """Return what the rings (B, RINGS, K, W) tell about the rays between them, (B, hidden, K - 1, W + 2 ASIDE)."""
        around = _around(rings, AROUND)
        full = None if self.stem is None else self.stem(around)
        half = self.to_half(around if full is None else full)
        quarter = self.to_quarter(half)
        features = self.up_half(self.up_quarter(self.to_eighth(quarter), quarter), half)
        if self.up_full is not None:
            features = self.up_full(features, full)
        cut = (AROUND - ASIDE) * features.shape[-1] // around.shape[-1]
        features = features[..., cut:-cut]
        between = self.from_above(features[:, :, :-1]) + self.from_below(features[:, :, 1:])
        return between if self.up_full is not None else _twice(between)

    def _answer(self, out: Tensor, rays: Tensor, candidates: Tensor) -> Answer:
        logits = out[:, :CANDIDATES].masked_fill(candidates <= 0, -1e4)
        shift, scale, valid = out[:, CANDIDATES:].unbind(1)
        weights = (logits - logits.amax(dim=1, keepdim=True)).exp()  # five times as fast as ONNX Runtime's softmax
        mean = (weights * candidates).sum(dim=1) / weights.sum(dim=1)
        sigma = rays[:, Ray.SIGMA].exp() - 1  # sigma of ray-segment as initial scale
        scale = MIN_SCALE + (sigma + 0.02) * torch.exp(scale.clamp(-6, 6))
        return Answer(mean * (1 + RESIDUAL * torch.tanh(shift)), scale, valid, logits)


class _Convolution(nn.Module):
    """3 x 3 convolution with batch normalisation and ReLU; stride and dilation apply to the columns."""

    def __init__(self, channels_in: int, channels_out: int, stride: int = 1, dilation: int = 1) -> None:
        super().__init__()
        self.convolution = nn.Conv2d(
            channels_in, channels_out, 3, (1, stride), padding=(1, dilation), dilation=(1, dilation), bias=False
        )
        self.norm = nn.BatchNorm2d(channels_out)

    def forward(self, x: Tensor) -> Tensor:
        return functional.relu(self.norm(self.convolution(x)))


class _Block(nn.Module):
    """Residual block of two convolutions."""

    def __init__(self, channels: int, dilation: int = 1) -> None:
        super().__init__()
        self.block = nn.Sequential(_Convolution(channels, channels), _Convolution(channels, channels, 1, dilation))

    def forward(self, x: Tensor) -> Tensor:
        y: Tensor = x + self.block(x)
        return y


class _Up(nn.Module):
    """Upsampling to twice the columns, joined with the features at that resolution."""

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__()
        self.channels = [channels_in, channels_out]
        self.join = nn.Conv2d(channels_in + channels_out, channels_out, 1)
        self.block = _Block(channels_out)

    def forward(self, x: Tensor, finer: Tensor) -> Tensor:
        of_coarse, of_fine = self.join.weight.split(self.channels, dim=1)  # x before it is repeated: half the work
        coarse = _twice(functional.conv2d(x, of_coarse))
        y: Tensor = self.block(functional.relu(functional.conv2d(finer, of_fine, self.join.bias) + coarse))
        return y


def _twice(x: Tensor) -> Tensor:
    """Twice the columns, each repeated."""
    return functional.interpolate(x, scale_factor=(1.0, 2.0), mode="nearest")


def _around(x: Tensor, columns: int) -> Tensor:
    """Circular padding by `columns` on each side."""
    return torch.cat([x[..., -columns:], x, x[..., :columns]], dim=-1)


def sizes_of(weights: Mapping[str, Tensor]) -> Sizes:
    """Return the sizes of the network that has these weights.

    Raises:
        KeyError: They are not weights of Lift.
    """
    half, quarter, eighth = (
        len(weights[f"to_{level}.0.convolution.weight"]) for level in ("half", "quarter", "eighth")
    )
    full = len(weights["stem.convolution.weight"]) if "stem.convolution.weight" in weights else 0
    return Sizes((full, half, quarter, eighth), len(weights["mix.weight"]))
