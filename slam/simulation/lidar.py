"""Scans of a spinning LiDAR: one ray per pulse, and a model of its echo.

Where no other source is named, figures were measured on KITTI's raw drives 0005 and 0013.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.data.cloud import Array
from slam.simulation import kernels
from slam.simulation.heads import Head, Lidar
from slam.simulation.materials import MATERIALS
from slam.simulation.sweep import Sweep
from slam.simulation.world import World

GAP = 0.1  # of a column, between two rings of a file: the first and last points of a ring stay on their side of +x
ROOF = 1.73  # m above the road
FALL = 1.4  # how steeply the chance of an echo falls with its power
WEAK = 3.0  # ratio of the weakest echoes' range error to that of strong ones
EDGE, MIXED = (0.2, 3.0), 0.3  # m between two surfaces, and the share of the pulses between them that see both
GRAZING = 0.15  # power of the cosine of incidence that reported reflectances fall by
FADING, FADING_FROM = 0.008, 20.0  # 1/m, from that range on: reported reflectances fall with range
LASER_SHADE, SHADE = 0.1, 0.05  # of reflectances: constant for a laser, and of each pulse

_REFLECTANCE, _RETROREFLECT, _LOST = (
    np.array([getattr(material, name) for material in MATERIALS], np.float32)
    for name in ("reflectance", "retroreflect", "lost")
)


@dataclass(frozen=True, eq=False)
class Scan:
    """The N points of one revolution, ring by ring from the top, each counter-clockwise from +x: KITTI's file order.

    Attributes:
        xyz: (N, 3) float32 [m], in the sensor frame at the time of each point.
        reflectance: (N,) float32.
        ring: (N,) uint16, 0 = top.
        fraction: (N,) float32, fraction of the sweep at each point: 0 where the head points to the rear, from where it
            turns over the left and the front (1/2) to the right.
    """

    xyz: Array
    reflectance: Array
    ring: Array
    fraction: Array


@dataclass(frozen=True, eq=False)
class _Pulses:
    """Pulses of R lasers x C columns, in the order of a `Scan`.

    Attributes:
        azimuth: (R, C) float32, 0..2 pi.
        fraction: (R, C) float32, fraction of the sweep.
        direction: (R, C, 3) float32 unit vectors, in the sensor frame at that instant.
        reach: (R, C) float32, distance of the hit [m], inf without a hit.
        material: (R, C), material of the hit.
        incidence: (R, C), cosine of the angle to the normal of the hit.
    """

    azimuth: Array
    fraction: Array
    direction: Array
    reach: Array
    material: Array
    incidence: Array


def scan(world: World, lidar: Lidar, sweep: Sweep, rng: np.random.Generator) -> Scan:
    """Simulate one revolution as recorded. The number of random draws does not depend on the world."""
    head, sensor, lasers = lidar.head, lidar.sensor, _Lasers(lidar)
    shape = (sensor.ring_count, lidar.columns)
    turn = rng.random()
    lottery, mixing, between = rng.random((3, *shape), np.float32)
    wide, shade = rng.standard_normal((2, *shape), np.float32)

    pulses = _cast(world, lidar, sweep, lasers.phase + turn)
    chance = _echo_chance(pulses, head)
    reach = _mixed(pulses.reach, mixing, between)
    seen = (reach > head.nearest) & (reach < head.farthest) & (lottery < chance * (1 - _LOST[pulses.material]))
    seen &= ~_hidden(head, pulses.azimuth)

    sigma = np.float32(head.pulse_sigma) * (1 + np.float32(WEAK) * (1 - chance))
    reported = (reach + lasers.range_error + sigma * wide)[seen]
    azimuth = _read_encoder(pulses.azimuth, lidar, lasers.phase)[seen]
    ring = np.nonzero(seen)[0]
    xyz = _points(reported, azimuth, sensor.elevation.astype(np.float32)[ring], sensor.offset.astype(np.float32)[ring])
    value = _reflectance(pulses, seen) + (lasers.shade + np.float32(SHADE) * shade)[seen]
    reflectance = _rounded(np.clip(value, 0, 0.99), 100)
    return Scan(_rounded(xyz, 1000), reflectance, ring.astype(np.uint16), pulses.fraction[seen])


def exact_scan(world: World, lidar: Lidar, sweep: Sweep) -> Scan:
    """Simulate one revolution without noise: the exact hit of every pulse within range."""
    head = lidar.head
    pulses = _cast(world, lidar, sweep, _Lasers(lidar).phase)
    seen = (pulses.reach > head.nearest) & (pulses.reach < head.farthest)
    ring = np.nonzero(seen)[0]
    xyz = pulses.reach[seen, None] * pulses.direction[seen]
    xyz[:, 2] += lidar.sensor.offset.astype(np.float32)[ring]
    return Scan(xyz, np.clip(_reflectance(pulses, seen), 0, 1), ring.astype(np.uint16), pulses.fraction[seen])


class _Lasers:
    """Constant deviations of the lasers, (R, 1) each: the same instrument in every simulation.

    Attributes:
        phase: Phase of the pulses within a column, 0..1.
        range_error: Range error [m].
        shade: Error of the reflectances, mostly small, large and negative for some lasers.
    """

    def __init__(self, lidar: Lidar) -> None:
        rng, shape = np.random.default_rng(70), (lidar.sensor.ring_count, 1)
        phase = rng.random(shape)
        self.phase: Array = np.zeros(shape) if lidar.head.together else phase
        self.range_error = (lidar.head.laser_sigma * rng.standard_normal(shape)).astype(np.float32)
        self.shade = (LASER_SHADE * (0.7 - rng.exponential(size=shape))).astype(np.float32)


def _cast(world: World, lidar: Lidar, sweep: Sweep, phase: Array) -> _Pulses:
    """Every pulse of a turn, with each laser at its phase (R, 1) within the columns of the head."""
    sensor, step = lidar.sensor, 2 * np.pi / lidar.columns
    aside = sensor.azimuth[:, None]
    within = GAP + (1 - 2 * GAP) * ((phase + aside / step) % 1)
    azimuth = (step * (np.arange(lidar.columns) + within)).astype(np.float32)
    fraction = (0.5 - (azimuth - aside.astype(np.float32)) / np.float32(2 * np.pi)) % 1
    shape, unit = azimuth.shape, np.ones(azimuth.size, np.float32)
    elevation = np.repeat(sensor.elevation.astype(np.float32), shape[1])
    direction = _points(unit, azimuth.ravel(), elevation, np.zeros_like(unit))
    origin = np.zeros_like(direction)
    origin[:, 2] = np.repeat(sensor.offset, shape[1])

    start, way = sweep.in_world(origin, direction, fraction.ravel())
    hits = world.cast(start, way)
    incidence = kernels.incidence(way, hits.normal)
    return _Pulses(
        azimuth,
        fraction,
        direction.reshape(*shape, 3),
        hits.reach.reshape(shape),
        np.where(hits.triangle < 0, 0, world.material[hits.triangle]).reshape(shape),
        np.where(hits.triangle < 0, 0, incidence).reshape(shape),
    )


def _points(reach: Array, azimuth: Array, elevation: Array, offset: Array) -> Array:
    """(N, 3) float32, on the lines of the lasers."""
    rho = reach * np.cos(elevation)
    xyz = np.empty((len(reach), 3), np.float32)
    xyz[:, 0], xyz[:, 1] = rho * np.cos(azimuth), rho * np.sin(azimuth)
    xyz[:, 2] = reach * np.sin(elevation) + offset
    return xyz


def _echo_chance(pulses: _Pulses, head: Head) -> Array:
    """(R, C): of an echo strong enough to be seen, by its power ~ reflectance * cosine / range^2."""
    retro = _RETROREFLECT[pulses.material]
    power = _REFLECTANCE[pulses.material] * (retro + (1 - retro) * pulses.incidence) / pulses.reach**2
    asphalt = MATERIALS[0].reflectance * ROOF / head.asphalt**3
    strength = (power * np.float32(1 / asphalt)) ** np.float32(FALL)
    return strength / (1 + strength)


def _mixed(reach: Array, mixing: Array, between: Array) -> Array:
    """Let some of the pulses at an edge, which hit it and the background, report a range between the two."""
    beside = np.roll(reach, -1, axis=1)
    found = np.isfinite(reach) & np.isfinite(beside) & (mixing < MIXED)
    gap = np.subtract(beside, reach, where=found, out=np.zeros_like(reach))
    edge = (np.abs(gap) > EDGE[0]) & (np.abs(gap) < EDGE[1])
    return np.where(edge, reach + between * gap, reach)


def _hidden(head: Head, azimuth: Array) -> Array:
    """(R, C) bool: whether the car that carries the sensor occludes the ray."""
    hidden = np.zeros(azimuth.shape, bool)
    for first, last, start, end in head.hidden:
        rings = slice(first, last + 1)
        hidden[rings] |= (azimuth[rings] > np.deg2rad(start)) & (azimuth[rings] < np.deg2rad(end))
    return hidden


def _read_encoder(azimuth: Array, lidar: Lidar, phase: Array) -> Array:
    """(R, C): the step of the encoder in which a pulse was sent; its middle, and never over +x."""
    step, edge = np.float32(lidar.head.encoder), 2 * np.pi / lidar.columns * GAP
    shift = phase.astype(np.float32)
    return np.clip((np.floor(azimuth / step + shift) + np.float32(0.5) - shift) * step, edge, 2 * np.pi - edge)


def _reflectance(pulses: _Pulses, seen: Array) -> Array:
    """(N,) as reported, without noise, of the pulses that are seen: falling a little with incidence and with range."""
    material = pulses.material[seen]
    diffuse = 1 - _RETROREFLECT[material]
    dimmed = diffuse * (1 - pulses.incidence[seen] ** np.float32(GRAZING))
    faded = diffuse * np.float32(FADING) * np.maximum(pulses.reach[seen] - np.float32(FADING_FROM), 0)
    return np.asarray(_REFLECTANCE[material] * (1 - dimmed) - faded)


def _rounded(values: Array, steps: int) -> Array:
    """Round to a number of steps per unit, float32."""
    return np.round(values * np.float32(steps)) / np.float32(steps)
