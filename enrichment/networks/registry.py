"""The networks by their names."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from enrichment.networks.depth_network import DepthNetwork
from enrichment.networks.f2l import F2L
from enrichment.networks.l2l import L2L
from enrichment.networks.li2l import LI2L

#: Calling an entry makes the network untrained, with weights drawn from torch's own generator.
NETWORKS: dict[str, Callable[[], DepthNetwork]] = {
    "l2l": L2L,
    "li2l": LI2L,
    "f2l": F2L,
    "f2l-light": partial(F2L, light=True),
}
