"""Registry of the depth completion networks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from slam.data.registry import Registry

if TYPE_CHECKING:
    from enrichment.networks.depth_network import DepthNetwork

#: A factory creates an untrained network with random weights from torch's global generator.
NETWORKS: Registry[DepthNetwork] = Registry(
    "network",
    {
        "l2l": "enrichment.networks.l2l:L2L",
        "li2l": "enrichment.networks.li2l:LI2L",
        "f2l": "enrichment.networks.f2l:F2L",
        "f2l-light": "enrichment.networks.f2l:f2l_light",
    },
)
