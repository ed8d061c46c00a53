"""F2L: the paper's own network, a fusion of image features and LiDAR depth."""

from __future__ import annotations

from functools import partial

import torch
from torch import Tensor, nn

from enrichment.networks.depth_network import DepthNetwork, he
from enrichment.networks.erfnet import ERFNet
from enrichment.networks.sparse_convolution import SCNN

FEATURES = 20  # maps from ERFNet to the head
WIDTH = 32  # filters per layer of the head


class F2L(DepthNetwork):
    """ERFNet on the image and the sparse depth, SCNN on the sparse depth, and a head on the 21 maps of both.

    The head is Table I of Yue et al., four convolutions with ReLU; the projection of its 32 maps to one is not in the
    table and was added. Nearly all of the computation is in the 11 x 11 and 7 x 7 convolutions.

    Args:
        light: Use depthwise separable convolutions for these two, with a twentieth of the computation.
    """

    def __init__(self, light: bool = False) -> None:
        super().__init__()
        self.erfnet, self.scnn = ERFNet(4, FEATURES), SCNN()
        large = _separable if light else _plain
        self.head = nn.Sequential(
            large(FEATURES + 1, 11),
            large(WIDTH, 7),
            _plain(WIDTH, 5),
            _plain(WIDTH, 1),
            nn.Conv2d(WIDTH, 1, 1),
        ).apply(he)
        self._start_with_scnn()

    def _start_with_scnn(self) -> None:
        """Initialise the head so that its output is SCNN's map: it learns how the image changes that depth."""
        channel = FEATURES
        with torch.no_grad():
            for layer in (module for module in self.head.modules() if isinstance(module, nn.Conv2d)):
                each, middle = layer.groups > 1, layer.kernel_size[0] // 2
                row = channel if each else 0
                layer.weight[row] = 0
                layer.weight[row, 0 if each else channel, middle, middle] = 1
                channel = row

    def complete(self, image: Tensor, depth: Tensor) -> Tensor:
        """Complete depth in units of FAR."""
        features = self.erfnet(torch.cat([image, depth], dim=1))
        dense: Tensor = self.head(torch.cat([features, self.scnn(depth)], dim=1))
        return dense


f2l_light = partial(F2L, light=True)


def _plain(channels_in: int, size: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(channels_in, WIDTH, size, padding=size // 2), nn.ReLU())


def _separable(channels_in: int, size: int) -> nn.Sequential:
    each = nn.Conv2d(channels_in, channels_in, size, padding=size // 2, groups=channels_in)
    return nn.Sequential(each, nn.Conv2d(channels_in, WIDTH, 1), nn.ReLU())
