"""Interface to Embree 4 from the package embreex, and its scenes.

embreex's Python interface casts single rays. Packets of neighbouring rays take half of the time, so the library is
called directly: from this module to set up scenes (ctypes), and from `kernels` to cast rays. The constants and
structures are documented in https://github.com/RenderKit/embree/blob/v4.4.0/doc/src/api.md.
"""

from __future__ import annotations

import ctypes
import weakref
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

import llvmlite.binding
import numpy as np

from slam.data.cloud import Array
from slam.data.errors import InputError

#: AVX-512 rounds otherwise: with AVX2 a simulation is the same on CPUs that have either. One thread: whole frames are
#: shared out among cores, which leaves none of them waiting.
DEVICE = b"threads=1,max_isa=avx2"
ROBUST, FILTERED = 1 << 2, 1 << 3  # flags of a scene: no ray slips between two triangles; queries may bring a filter
TRIANGLES, INDICES, VERTICES, THREE_UINTS, THREE_FLOATS = 0, 0, 1, 0x5003, 0x9003
NATIVE_RAY8 = 33  # a property: whether packets of eight are more than a loop over single rays

_POINTER, _SIZE, _UINT, _INT = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_uint, ctypes.c_int
_BUFFER = (_POINTER, _INT, _UINT, _INT, _POINTER, _SIZE, _SIZE, _SIZE)
_FUNCTIONS = {
    "rtcNewDevice": (_POINTER, (ctypes.c_char_p,)),
    "rtcGetDeviceError": (_INT, (_POINTER,)),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, (_POINTER, _INT)),
    "rtcNewScene": (_POINTER, (_POINTER,)),
    "rtcSetSceneFlags": (None, (_POINTER, _INT)),
    "rtcCommitScene": (None, (_POINTER,)),
    "rtcReleaseScene": (None, (_POINTER,)),
    "rtcNewGeometry": (_POINTER, (_POINTER, _INT)),
    "rtcSetSharedGeometryBuffer": (None, _BUFFER),
    "rtcCommitGeometry": (None, (_POINTER,)),
    "rtcAttachGeometry": (_UINT, (_POINTER, _POINTER)),
    "rtcReleaseGeometry": (None, (_POINTER,)),
}


def library() -> Path:
    """Return the path of Embree's shared library in embreex.

    Raises:
        InputError: It is missing.
    """
    spec = find_spec("embreex")
    package = Path(spec.submodule_search_locations[0]) if spec and spec.submodule_search_locations else None
    if package is not None:
        for folder in (package.with_name("embreex.libs"), package / ".dylibs", package):
            found = sorted(folder.glob("*embree4*"))
            if found:
                return found[0]
    raise InputError("embreex has no Embree in it; repair it: pip install --force-reinstall embreex")


class TriangleScene:
    """A scene of triangles for ray casting.

    Args:
        vertices: (V, 3) float32.
        triangles: (T, 3), indices of vertices.
    """

    def __init__(self, vertices: Array, triangles: Array) -> None:
        embree, device = _embree()
        # Embree reads vertices sixteen bytes at a time, and from these very arrays for as long as the scene lives.
        self._vertices = np.append(np.ascontiguousarray(vertices, np.float32).ravel(), np.float32(0))
        self._triangles = np.ascontiguousarray(triangles, np.uint32)
        self.address = int(embree.rtcNewScene(device))
        weakref.finalize(self, embree.rtcReleaseScene, self.address)
        embree.rtcSetSceneFlags(self.address, ROBUST | FILTERED)
        geometry = embree.rtcNewGeometry(device, TRIANGLES)
        for kind, layout, values, count in (
            (VERTICES, THREE_FLOATS, self._vertices, len(vertices)),
            (INDICES, THREE_UINTS, self._triangles, len(triangles)),
        ):
            embree.rtcSetSharedGeometryBuffer(geometry, kind, 0, layout, values.ctypes.data, 0, 12, count)
        embree.rtcCommitGeometry(geometry)
        embree.rtcAttachGeometry(self.address, geometry)
        embree.rtcReleaseGeometry(geometry)
        embree.rtcCommitScene(self.address)
        error = embree.rtcGetDeviceError(device)
        if error:
            raise RuntimeError(f"Embree: error {error} with {len(triangles)} triangles")

    def __len__(self) -> int:
        return len(self._triangles)


@lru_cache(maxsize=1)
def load() -> ctypes.CDLL:
    """Load the library, and register its functions by name for compiled kernels."""
    path = str(library())
    llvmlite.binding.load_library_permanently(path)
    embree = ctypes.CDLL(path)
    for name, (result, arguments) in _FUNCTIONS.items():
        function = getattr(embree, name)
        function.restype, function.argtypes = result, arguments
    return embree


@lru_cache(maxsize=1)
def _embree() -> tuple[ctypes.CDLL, int]:
    embree = load()
    device = embree.rtcNewDevice(DEVICE)
    if not device:
        raise RuntimeError(f"Embree: no device, error {embree.rtcGetDeviceError(None)}")
    return embree, device


def has_packets() -> bool:
    """Check whether embreex is installed and casts packets of eight rays on this CPU, which needs AVX."""
    if find_spec("embreex") is None:
        return False
    embree, device = _embree()
    return bool(embree.rtcGetDeviceProperty(device, NATIVE_RAY8))
