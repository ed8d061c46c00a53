"""The loops of ray casting: rays in packets of eight, through Embree's functions. Nothing else here, for numba's
cache does not see a change in another.

A packet is a structure of arrays of LANES 32-bit numbers each, in the order of Embree's RTCRayHit8: `_OX` .. name the
rows. Triangles that lie in one plane and overlap, or share an edge, can be equally far to the last bit; which of them
is found then depends on the order in which Embree looks at them, and that on the rays of the packet. Such rays are
cast again, each alone, so that what a ray meets never depends on its neighbours.
"""

import math

import numpy as np
from numba import carray, cfunc, njit, types

from slam.simulation.casting.embree import load

LANES = 8
_OX, _NEAR, _DX, _BEST, _FAR, _MASK, _TIED, _FLAGS = 0, 3, 4, 7, 8, 9, 10, 11  # of RTCRay8; time and id are ours to use
_NX, _TRIANGLE, _GEOMETRY, _INSTANCE = 12, 17, 18, 19  # of RTCHit8
ROWS = 24  # with room for what some builds of Embree append
_NOTHING = np.uint32(0xFFFFFFFF)
TIE = np.float32(1e-6)  # relative: some four steps of a float32

load()  # before anything compiled is loaded from the cache: it refers to these functions by name
_intersect8, _occluded8 = (
    types.ExternalFunction(name, types.void(types.intp, types.intp, types.intp, types.intp))
    for name in ("rtcIntersect8", "rtcOccluded8")
)
_intersect1 = types.ExternalFunction("rtcIntersect1", types.void(types.intp, types.intp, types.intp))


@cfunc(types.void(types.CPointer(types.voidptr)), cache=True)
def note_ties(arguments):
    """Embree's filter: notes the nearest hit of each ray and whether another is as near. Hits a little farther than the
    nearest go on being offered."""
    valid = carray(arguments[0], LANES, np.int32)
    ray = carray(arguments[3], (_FLAGS + 1, LANES), np.float32)
    tied = carray(arguments[3], (_FLAGS + 1, LANES), np.uint32)[_TIED]
    for lane in range(LANES):
        if valid[lane]:
            reach, best = ray[_FAR, lane], ray[_BEST, lane]
            if abs(reach - best) <= TIE * reach:
                tied[lane] = 1
            ray[_BEST, lane] = min(best, reach)
            ray[_FAR, lane] = ray[_BEST, lane] * (np.float32(1) + TIE)


@njit(inline="always")
def _load(packet, lanes, number, at, origin, direction, centre, order):
    """The rays from `at` on into a packet, and their numbers; behind the last one, lanes have no ray."""
    common, count = len(origin) == 1, len(direction)
    for lane in range(LANES):
        i = min(at + lane, count - 1)
        lanes[lane] = -1 if at + lane < count else 0
        if len(order):
            i = order[i]
        number[lane] = i
        j = 0 if common else i
        for axis in range(3):
            packet[_OX + axis, lane] = origin[j, axis] - centre[axis]
            packet[_DX + axis, lane] = direction[i, axis]


@njit(inline="always")
def _reset(packet, bits):
    """Every ray from its start to infinity, with no hit yet."""
    for lane in range(LANES):
        packet[_NEAR, lane] = 0.0
        packet[_BEST, lane] = np.inf
        packet[_FAR, lane] = np.inf
        bits[_MASK, lane] = _NOTHING
        bits[_TIED, lane] = 0
        bits[_FLAGS, lane] = 0
        bits[_TRIANGLE, lane] = _NOTHING
        bits[_GEOMETRY, lane] = _NOTHING
        bits[_INSTANCE, lane] = _NOTHING


@njit(inline="always")
def _alone(packet, bits, lane, single, single_bits, scene, arguments):
    """One ray of a packet cast again, without its neighbours."""
    for axis in range(3):
        single[_OX + axis] = packet[_OX + axis, lane]
        single[_DX + axis] = packet[_DX + axis, lane]
    single[_NEAR] = 0.0
    single[_FAR] = np.inf
    single_bits[_MASK] = _NOTHING
    single_bits[_FLAGS] = 0
    for row in (_TRIANGLE, _GEOMETRY, _INSTANCE):
        single_bits[row] = _NOTHING
    _intersect1(scene, single.ctypes.data, arguments)
    packet[_BEST, lane] = single[_FAR]
    for axis in range(3):
        packet[_NX + axis, lane] = single[_NX + axis]
    bits[_TRIANGLE, lane] = single_bits[_TRIANGLE]


@njit(inline="always")
def _cast_packet(packet, bits, lanes, single, single_bits, scene, together, apart):
    """The first hit of each lane: its reach in row _BEST."""
    _reset(packet, bits)
    _intersect8(lanes.ctypes.data, scene, packet.ctypes.data, together)
    for lane in range(LANES):
        if lanes[lane] and bits[_TIED, lane] == 1:
            _alone(packet, bits, lane, single, single_bits, scene, apart)


@njit(inline="always")
def _keep(packet, bits, lanes, number, first, reach, triangle, normal):
    """Hits of a packet, with triangles numbered from `first`, where they are nearer than those that there are."""
    for lane in range(LANES):
        i = number[lane]
        if lanes[lane] and bits[_TRIANGLE, lane] != _NOTHING and packet[_BEST, lane] < reach[i]:
            reach[i] = packet[_BEST, lane]
            triangle[i] = np.int32(bits[_TRIANGLE, lane]) + first
            x, y, z = packet[_NX, lane], packet[_NX + 1, lane], packet[_NX + 2, lane]
            scale = np.float32(1) / np.float32(math.sqrt(x * x + y * y + z * z))
            normal[i, 0], normal[i, 1], normal[i, 2] = x * scale, y * scale, z * scale


@njit(cache=True, nogil=True)
def cast(origin, direction, order, centre, scenes, firsts, work, together, apart):
    """The first triangle that each ray meets; origin (1, 3) or (N, 3), direction (N, 3) float32.

    order             (N,) int32 in which rays are taken together, or (0,): as they come
    scenes            (S,) int64: addresses of scenes whose origin is `centre` (3,), their triangles numbered from
                      `firsts` (S,) on
    work              (3, ROWS, LANES) float32, aligned: a packet, a ray of its own, and which lanes have a ray
    together, apart   addresses of Embree's arguments for packets and for single rays
    Returns reach (N,) float32, inf where nothing is met, triangle (N,) int32, there -1, normal (N, 3) float32.
    """
    count = len(direction)
    reach = np.full(count, np.inf, np.float32)
    triangle = np.full(count, -1, np.int32)
    normal = np.zeros((count, 3), np.float32)
    packet, single = work[0], work[1].ravel()
    lanes, number = work[2, 0].view(np.int32), work[2, 1].view(np.int32)
    bits, single_bits = packet.view(np.uint32), single.view(np.uint32)
    for at in range(0, count, LANES):
        _load(packet, lanes, number, at, origin, direction, centre, order)
        for scene in range(len(scenes)):
            _cast_packet(packet, bits, lanes, single, single_bits, scenes[scene], together, apart)
            _keep(packet, bits, lanes, number, firsts[scene], reach, triangle, normal)
    return reach, triangle, normal


@njit(cache=True, nogil=True)
def hidden(origin, direction, centre, scenes, work, arguments):
    """(N,) bool: whether anything stands in a ray's way, at whatever distance; as `cast`."""
    count = len(direction)
    found = np.zeros(count, np.bool_)
    packet, lanes, number = work[0], work[2, 0].view(np.int32), work[2, 1].view(np.int32)
    bits = packet.view(np.uint32)
    for at in range(0, count, LANES):
        _load(packet, lanes, number, at, origin, direction, centre, number[:0])
        for scene in scenes:
            _reset(packet, bits)
            _occluded8(lanes.ctypes.data, scene, packet.ctypes.data, arguments)
            for lane in range(LANES):
                if lanes[lane] and packet[_FAR, lane] < 0:
                    found[at + lane], lanes[lane] = True, 0
    return found
