"""L2L: depth completion from LiDAR only."""

from __future__ import annotations

from torch import Tensor

from enrichment.networks.depth_network import DepthNetwork
from enrichment.networks.sparse_convolution import SCNN


class L2L(DepthNetwork):
    """The sparsity-invariant network on the sparse depth; the image is not used."""

    def __init__(self) -> None:
        super().__init__()
        self.scnn = SCNN()

    def complete(self, image: Tensor, depth: Tensor) -> Tensor:
        """Complete depth in units of FAR."""
        dense: Tensor = self.scnn(depth)
        return dense
