"""Registry of the enrichment methods; docs/adding-a-method.md describes how another package adds one."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

from slam.data.registry import Registry

if TYPE_CHECKING:
    from enrichment.geometry.sparse_scan import Method
    from enrichment.interpolation.depth_completion import DepthCompletion

#: Depth completion without training. Each is an enrichment method, too.
COMPLETIONS: Registry[DepthCompletion] = Registry(
    "depth completion",
    {
        "nearest": "enrichment.interpolation.depth_completion:nearest_method",
        "ip-basic": "enrichment.interpolation.depth_completion:ip_basic_method",
        "delaunay": "enrichment.interpolation.depth_completion:delaunay_method",
        "mrf": "enrichment.interpolation.depth_completion:markov_random_field_method",
    },
)
#: The paper's networks by the names of their weights.
NETWORK_METHODS = {
    "l2l": "enrichment.methods.onnx_network:l2l",
    "li2l": "enrichment.methods.onnx_network:li2l",
    "f2l": "enrichment.methods.onnx_network:f2l",
}
LIFT = "lift"

METHODS: Registry[Method] = Registry(
    "enrichment method",
    {
        "ray-segment": "enrichment.interpolation.ray_segment:RaySegment",
        **COMPLETIONS.own,
        "joint": "enrichment.methods.joint:Joint",
        LIFT: "enrichment.methods.lift:LiftMethod",
        **NETWORK_METHODS,
    },
    "lidarlift.methods",
)


def can_run(name: str) -> bool:
    """Check whether a method can run: networks need their weights."""
    if name not in (*NETWORK_METHODS, LIFT):
        return True
    from enrichment.methods.onnx_network import has_weights  # slow to import

    return has_weights(name)


def runnable() -> list[str]:
    """Return the names of the methods that can run."""
    return [name for name in METHODS.names() if can_run(name)]


def make_methods(names: Collection[str]) -> dict[str, Method]:
    """Create the methods with these names.

    Raises:
        InputError: As `Registry.load`, before any method is created.
    """
    factories = {name: METHODS.load(name) for name in names}
    return {name: make() for name, make in factories.items()}
