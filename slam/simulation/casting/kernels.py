"""Kernels of ray casting: packets of eight rays, by Embree's functions.

This file holds kernels only, with all that they call: numba's cache does not see changes in other files.

A packet is a structure of arrays of LANES 32-bit numbers each, in the order of Embree's RTCRayHit8: `_OX` .. name the
rows. Triangles that lie in one plane and overlap can be equally far to the last bit, and a ray can pass so near to a
triangle's edge that it depends on rounding whether Embree looks at it; what is found then depends on the other rays of
the packet. Such rays are cast again, each alone, so that what a ray meets does not depend on its neighbours.
"""

import math

import numpy as np
from numba import carray, cfunc, njit, types

from slam.simulation.casting.embree import load

LANES = 8
_OX, _NEAR, _DX, _BEST, _FAR, _MASK, _TIED, _FLAGS = 0, 3, 4, 7, 8, 9, 10, 11  # of RTCRay8; time and id are ours to use
_NX, _U, _V, _TRIANGLE, _GEOMETRY, _INSTANCE = 12, 15, 16, 17, 18, 19  # of RTCHit8
ROWS = 24  # with room for what some builds of Embree append
_NOTHING = np.uint32(0xFFFFFFFF)
#: Hits this near to each other, of their distance and beside [in units of the direction], are a tie: the rounding of
#: distances, and that of coordinates some hundred metres from the origin.
TIE, CLOSE = np.float32(1e-5), np.float32(2e-5)
EDGE = np.float32(1e-3)  # of a triangle's height: nearer to an edge, rounding decides

load()  # before anything compiled is loaded from the cache: it refers to these functions by name
_intersect8, _occluded8 = (
    types.ExternalFunction(name, types.void(types.intp, types.intp, types.intp, types.intp))
    for name in ("rtcIntersect8", "rtcOccluded8")
)
_intersect1, _occluded1 = (
    types.ExternalFunction(name, types.void(types.intp, types.intp, types.intp))
    for name in ("rtcIntersect1", "rtcOccluded1")
)


@njit(inline="always")
def _inside(u, v):
    """Whether a place in a triangle, in barycentric coordinates, is not near an edge."""
    return u > EDGE and v > EDGE and u + v < np.float32(1) - EDGE


@cfunc(types.void(types.CPointer(types.voidptr)), cache=True)
def note_edges(arguments):
    """Embree's filter for occlusion rays: hits near an edge are noted and do not count."""
    valid = carray(arguments[0], LANES, np.int32)
    tied = carray(arguments[3], (_FLAGS + 1, LANES), np.uint32)[_TIED]
    hit = carray(arguments[4], (_V - _NX + 1, LANES), np.float32)
    for lane in range(LANES):
        if valid[lane] and not _inside(hit[_U - _NX, lane], hit[_V - _NX, lane]):
            tied[lane], valid[lane] = 1, 0


@cfunc(types.void(types.CPointer(types.voidptr)), cache=True)
def note_ties(arguments):
    """Embree's filter for nearest hits: note the distance of the nearest hit, and whether another one is as near.

    Hits that are slightly farther than the nearest are still reported by Embree.
    """
    valid = carray(arguments[0], LANES, np.int32)
    ray = carray(arguments[3], (_FLAGS + 1, LANES), np.float32)
    tied = carray(arguments[3], (_FLAGS + 1, LANES), np.uint32)[_TIED]
    for lane in range(LANES):
        if valid[lane]:
            reach, best = ray[_FAR, lane], ray[_BEST, lane]
            if best - reach <= TIE * reach + CLOSE:  # nearer by next to nothing, or farther
                tied[lane] = 1
            ray[_BEST, lane] = min(best, reach)
            ray[_FAR, lane] = ray[_BEST, lane] * (np.float32(1) + TIE) + CLOSE


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
def _taken_out(packet, lane, single, single_bits):
    """One ray of a packet on its own."""
    for axis in range(3):
        single[_OX + axis] = packet[_OX + axis, lane]
        single[_DX + axis] = packet[_DX + axis, lane]
    single[_NEAR] = 0.0
    single[_FAR] = np.inf
    single_bits[_MASK] = _NOTHING
    single_bits[_FLAGS] = 0
    for row in (_TRIANGLE, _GEOMETRY, _INSTANCE):
        single_bits[row] = _NOTHING


@njit(inline="always")
def _cast_packet(packet, bits, lanes, single, single_bits, scene, together, apart):
    """The first hit of each lane: its reach in row _BEST."""
    _reset(packet, bits)
    _intersect8(lanes.ctypes.data, scene, packet.ctypes.data, together)
    for lane in range(LANES):
        sure = bits[_TIED, lane] == 0 and _inside(packet[_U, lane], packet[_V, lane])
        if lanes[lane] and bits[_TRIANGLE, lane] != _NOTHING and not sure:
            _taken_out(packet, lane, single, single_bits)
            _intersect1(scene, single.ctypes.data, apart)
            packet[_BEST, lane], bits[_TRIANGLE, lane] = single[_FAR], single_bits[_TRIANGLE]
            for axis in range(3):
                packet[_NX + axis, lane] = single[_NX + axis]


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
    """Find the first triangle hit by each ray.

    Args:
        origin: (1, 3) or (N, 3).
        direction: (N, 3) float32.
        order: (N,) int32 in which rays are grouped into packets, or (0,) for the given order.
        centre: (3,) origin of the scenes.
        scenes: (S,) int64, addresses of the scenes.
        firsts: (S,) number of the first triangle of each scene.
        work: (3, ROWS, LANES) float32, aligned: a packet, a single ray, and which lanes have a ray.
        together: Address of Embree's arguments for packets.
        apart: Address of Embree's arguments for single rays.

    Returns:
        Distance (N,) float32, inf without a hit, triangle (N,) int32, -1 without a hit, normal (N, 3) float32.
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
def hidden(origin, direction, centre, scenes, work, together, apart):
    """Check which rays (N,) bool hit anything, at any distance; arguments as in `cast`."""
    count = len(direction)
    found = np.zeros(count, np.bool_)
    packet, single = work[0], work[1].ravel()
    lanes, number = work[2, 0].view(np.int32), work[2, 1].view(np.int32)
    bits, single_bits = packet.view(np.uint32), single.view(np.uint32)
    for at in range(0, count, LANES):
        _load(packet, lanes, number, at, origin, direction, centre, number[:0])
        for scene in scenes:
            _reset(packet, bits)
            _occluded8(lanes.ctypes.data, scene, packet.ctypes.data, together)
            for lane in range(LANES):
                if lanes[lane] and packet[_FAR, lane] > 0 and bits[_TIED, lane] == 1:
                    _taken_out(packet, lane, single, single_bits)
                    _occluded1(scene, single.ctypes.data, apart)
                    packet[_FAR, lane] = single[_FAR]
                if lanes[lane] and packet[_FAR, lane] < 0:
                    found[at + lane], lanes[lane] = True, 0
    return found
