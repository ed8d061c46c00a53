"""The methods of enrichment by their names."""

from __future__ import annotations

from collections.abc import Callable, Collection

from enrichment.geometry.sparse_scan import Method
from slam.data.errors import InputError
from slam.data.yaml_files import nearest


def _ray_segment() -> Method:
    from enrichment.interpolation.ray_segment import RaySegment

    return RaySegment()


def _completion(name: str) -> Callable[[], Method]:
    def make() -> Method:
        from enrichment.interpolation.depth_completion import DepthCompletion

        return DepthCompletion(name)

    return make


def _joint() -> Method:
    from enrichment.methods.joint import Joint

    return Joint()


def _network(name: str) -> Callable[[], Method]:
    def make() -> Method:
        from enrichment.methods.onnx_network import ImageNetwork

        return ImageNetwork(name)

    return make


def _lift() -> Method:
    from enrichment.methods.lift import LiftMethod

    return LiftMethod()


#: The paper's networks, by the names of their weights too.
NETWORK_METHODS = ("l2l", "li2l", "f2l")
LIFT = "lift"

#: Calling an entry makes the method; what it needs is imported then.
METHODS: dict[str, Callable[[], Method]] = {
    "ray-segment": _ray_segment,
    "nearest": _completion("nearest"),
    "ip-basic": _completion("ip-basic"),
    "delaunay": _completion("delaunay"),
    "mrf": _completion("mrf"),
    "joint": _joint,
    LIFT: _lift,
    **{name: _network(name) for name in NETWORK_METHODS},
}


def runnable() -> list[str]:
    """Names of the methods that have all they need here: a network has to have its weights."""
    from enrichment.methods.onnx_network import has_weights

    return [name for name in METHODS if name not in (*NETWORK_METHODS, LIFT) or has_weights(name)]


def make_methods(names: Collection[str]) -> dict[str, Method]:
    """The methods of these names. Raises InputError on an unknown one, with the nearest right one."""
    for name in names:
        if name not in METHODS:
            raise InputError(f"unknown method '{name}'{nearest(name, METHODS)}")
    return {name: METHODS[name]() for name in names}
