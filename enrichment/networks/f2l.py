"""F2L: the paper's own network, image features and LiDAR depth fused."""

from __future__ import annotations

from functools import partial

import torch
from torch import Tensor, nn

from enrichment.networks.depth_network import DepthNetwork, he
from enrichment.networks.erfnet import ERFNet
from enrichment.networks.sparse_convolution import SCNN

FEATURES = 20  # maps that ERFNet gives to the head
WIDTH = 32  # filters of each layer of the head


class F2L(DepthNetwork):
    """ERFNet on the image and the sparse depth, SCNN on the sparse depth, and a head on the 21 maps of both.

    The head is Table I of Yue et al., four convolutions with ReLU; the projection of its 32 maps to one is not in the
    table and was added. Nearly all of the work is in its 11 x 11 and 7 x 7: `light` makes each of these a convolution
    of every map by itself and one of size 1 across maps, a twentieth of the work.
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
        """Let the head's first channel pass SCNN's map on, and the output be that channel: what it has to learn is how
        the image changes that depth."""
        channel = FEATURES
        with torch.no_grad():
            for layer in (module for module in self.head.modules() if isinstance(module, nn.Conv2d)):
                each, middle = layer.groups > 1, layer.kernel_size[0] // 2
                row = channel if each else 0
                layer.weight[row] = 0
                layer.weight[row, 0 if each else channel, middle, middle] = 1
                channel = row

    def complete(self, image: Tensor, depth: Tensor) -> Tensor:
        features = self.erfnet(torch.cat([image, depth], dim=1))
        dense: Tensor = self.head(torch.cat([features, self.scnn(depth)], dim=1))
        return dense


f2l_light = partial(F2L, light=True)


def _plain(channels_in: int, size: int) -> nn.Sequential:
    return nn.Sequential(nn.Conv2d(channels_in, WIDTH, size, padding=size // 2), nn.ReLU())


def _separable(channels_in: int, size: int) -> nn.Sequential:
    each = nn.Conv2d(channels_in, channels_in, size, padding=size // 2, groups=channels_in)
    return nn.Sequential(each, nn.Conv2d(channels_in, WIDTH, 1), nn.ReLU())
