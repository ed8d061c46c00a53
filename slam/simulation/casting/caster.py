"""Ray casting into several scenes."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from slam.data.cloud import Array
from slam.simulation.casting import kernels
from slam.simulation.casting.embree import TriangleScene

FILTER, COHERENT, ALL_FEATURES = 1 << 1, 1 << 16, 0xFFFFFFFF
ALIGNMENT = 64  # bytes
AS_THEY_COME: Array = np.zeros(0, np.int32)


class RayCaster:
    """Casts rays into several scenes at once.

    Args:
        scenes: The scenes; their triangles are numbered consecutively.
        centre: (3,) float64, common origin of the scenes, since Embree computes in float32.
    """

    def __init__(self, scenes: Sequence[TriangleScene], centre: Array) -> None:
        self._scenes, self._centre = tuple(scenes), centre  # kept, for Embree reads their arrays
        self._addresses = np.array([scene.address for scene in scenes], np.int64)
        self._firsts = np.cumsum([0, *(len(scene) for scene in scenes[:-1])]).astype(np.int32)

    def cast(self, origin: Array, direction: Array, order: Array | None = None) -> tuple[Array, Array, Array]:
        """Find the first triangle hit by each ray.

        Args:
            origin: (3,) or (N, 3).
            direction: (N, 3) float32.
            order: (N,) int32; packets hold consecutive rays of this order, and are faster for similar directions.

        Returns:
            Distance (N,) float32 in units of the direction, triangle (N,) int32, and unit normal (N, 3) float32; inf,
            -1 and zero for rays without a hit.
        """
        together, _, apart, work = _memory()
        reach, triangle, normal = kernels.cast(
            np.atleast_2d(origin), direction, AS_THEY_COME if order is None else order, self._centre, self._addresses,
            self._firsts, work, ctypes.addressof(together), ctypes.addressof(apart),
        )  # fmt: skip
        return reach, triangle, normal

    def hidden(self, origin: Array, direction: Array, alike: bool = True) -> Array:
        """Check which rays (N,) bool hit anything, at any distance.

        Args:
            origin: (3,) or (N, 3).
            direction: (N, 3) float32.
            alike: Consecutive rays have similar directions; stating False is faster if they have not.
        """
        _, together, apart, work = _memory()
        together = together if alike else apart
        return np.asarray(
            kernels.hidden(
                np.atleast_2d(origin), direction, self._centre, self._addresses, work, ctypes.addressof(together),
                ctypes.addressof(apart),
            )
        )  # fmt: skip


class _Arguments(ctypes.Structure):
    """RTCIntersectArguments and RTCOccludedArguments, which begin alike; NULL stands for Embree's own functions."""

    _fields_ = (
        ("flags", ctypes.c_uint),
        ("feature_mask", ctypes.c_uint),
        ("context", ctypes.c_void_p),
        ("filter", ctypes.c_void_p),
        ("function", ctypes.c_void_p),
        ("more", ctypes.c_uint64 * 4),
    )


@lru_cache(maxsize=1)
def _memory() -> tuple[_Arguments, _Arguments, _Arguments, Array]:
    """Embree's arguments for nearest hits of packets, any hits of packets and single rays, and the work memory."""
    shape = (3, kernels.ROWS, kernels.LANES)
    raw = np.zeros(4 * int(np.prod(shape)) + ALIGNMENT, np.uint8)
    start = -raw.ctypes.data % ALIGNMENT
    work = raw[start : start + 4 * int(np.prod(shape))].view(np.float32).reshape(shape)
    return (
        _Arguments(FILTER | COHERENT, ALL_FEATURES, filter=kernels.note_ties.address),
        _Arguments(FILTER | COHERENT, ALL_FEATURES, filter=kernels.note_edges.address),
        _Arguments(0, ALL_FEATURES),
        work,
    )
