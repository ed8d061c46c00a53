"""The networks that are trained for depth images, by their names."""

from __future__ import annotations

from typing import TYPE_CHECKING

from slam.data.registry import Registry

if TYPE_CHECKING:
    from enrichment.networks.depth_network import DepthNetwork

#: A factory makes the network untrained, with weights drawn from torch's own generator.
NETWORKS: Registry[DepthNetwork] = Registry(
    "network",
    {
        "l2l": "enrichment.networks.l2l:L2L",
        "li2l": "enrichment.networks.li2l:LI2L",
        "f2l": "enrichment.networks.f2l:F2L",
        "f2l-light": "enrichment.networks.f2l:f2l_light",
    },
)
