"""Rays cast into scenes."""

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
        scenes: Their triangles count from 0 on, one scene's after another's.
        centre: (3,) float64, the origin of all of them: Embree computes in float32.
    """

    def __init__(self, scenes: Sequence[TriangleScene], centre: Array) -> None:
        self._scenes, self._centre = tuple(scenes), centre  # kept, for Embree reads their arrays
        self._addresses = np.array([scene.address for scene in scenes], np.int64)
        self._firsts = np.cumsum([0, *(len(scene) for scene in scenes[:-1])]).astype(np.int32)

    def cast(self, origin: Array, direction: Array, order: Array | None = None) -> tuple[Array, Array, Array]:
        """The first triangle that each ray meets: origin (3,) or (N, 3), direction (N, 3) float32.

        Rays are cast in packets of those that follow each other in `order` (N,) int32: it is quicker where these go
        nearly the same way.

        Returns reach (N,) float32 in units of the direction, triangle (N,) int32, and normal (N, 3) float32 of unit
        length; inf, -1 and zero where a ray meets nothing.
        """
        together, _, apart, work = _memory()
        reach, triangle, normal = kernels.cast(
            np.atleast_2d(origin), direction, AS_THEY_COME if order is None else order, self._centre, self._addresses,
            self._firsts, work, ctypes.addressof(together), ctypes.addressof(apart),
        )  # fmt: skip
        return reach, triangle, normal

    def hidden(self, origin: Array, direction: Array, alike: bool = True) -> Array:
        """(N,) bool: whether anything stands in a ray's way, at whatever distance.

        It is quicker to say where rays that follow each other are not `alike`, and go all ways.
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
    """Arguments for packets that look for the nearest hit, for those that look for any, and for single rays; and the
    kernels' working memory."""
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
