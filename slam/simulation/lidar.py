"""Scans of a spinning LiDAR: one ray for every pulse, and what becomes of its echo.

Where no other source is named, figures were measured on KITTI's raw drives 0005 and 0013.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.data.cloud import Array, PointCloud
from slam.data.distortion import deskew
from slam.data.sensor import Sensor
from slam.simulation.materials import MATERIALS
from slam.simulation.world import World

#: What the recording car's roof and rack hide of its HDL-64E: first and last ring, azimuth from and to [deg].
KITTI_CAR = (
    (44, 52, 157, 164),
    (44, 52, 197, 204),
    (52, 52, 169, 194),
    (53, 59, 156, 205),
    (60, 63, 151, 211),
    (48, 56, 281, 302),
    (57, 60, 279, 299),
    (61, 63, 279, 290),
    (56, 61, 127, 136),
    (62, 63, 127, 145),
    (56, 61, 227, 235),
    (62, 63, 218, 235),
    (57, 63, 344, 360),
    (57, 59, 0, 13),
    (60, 63, 0, 19),
    (61, 63, 27, 37),
    (60, 63, 322, 333),
)


@dataclass(frozen=True)
class Head:
    """How a LiDAR turns and how far it sees.

    columns     pulses of each laser in a turn
    nearest     and `farthest`: the ranges that it reports [m]
    asphalt     distance [m] at which half of the pulses are lost that graze a road from a car's roof
    encoder     step [rad] of the angles that it reports; the pulses themselves come evenly
    hidden      of its view by its own car: rows as in KITTI_CAR
    """

    columns: int
    nearest: float
    farthest: float
    asphalt: float
    encoder: float
    hidden: tuple[tuple[int, int, int, int], ...] = ()


HEADS = {
    "hdl64": Head(2156, 0.9, 80.0, 58.0, np.deg2rad(0.09), KITTI_CAR),
    "vlp16": Head(1800, 0.5, 100.0, 40.0, np.deg2rad(0.01)),  # user manual 63-9243, at 10 Hz
}

GAP = 0.1  # of a column, between two rings of a file: the first and last points of a ring stay on their side of +x
ROOF = 1.73  # m above the road
FALL = 1.4  # how steeply the chance of an echo falls with its power
LASER_SIGMA, PULSE_SIGMA = 0.023, 0.011  # m, of a laser's constant range error and of each pulse
WEAK = 3.0  # so much wider is the error of the weakest echoes
EDGE, MIXED = (0.2, 3.0), 0.3  # m between two surfaces, and the share of the pulses between them that see both
GRAZING = 0.15  # power of the cosine of incidence that reported reflectances fall by
FADING, FADING_FROM = 0.008, 20.0  # 1/m, from that range on: reported reflectances fall with range
LASER_SHADE, SHADE = 0.1, 0.05  # of reflectances: constant for a laser, and of each pulse

_REFLECTANCE, _RETROREFLECT, _LOST = (
    np.array([getattr(material, name) for material in MATERIALS], np.float32)
    for name in ("reflectance", "retroreflect", "lost")
)


@dataclass(frozen=True, eq=False)
class _Pulses:
    """R lasers times C columns, ring after ring, each counter-clockwise from +x: in the order of KITTI's files.

    azimuth    (R, C) float32, 0..2 pi
    direction  (R, C, 3) float32, of unit length, in the frame of the sensor at that instant
    reach      (R, C) float32: metres to what it meets, inf where it meets nothing
    material   (R, C) of that; `incidence` (R, C) the cosine of the angle to its normal
    """

    azimuth: Array
    direction: Array
    reach: Array
    material: Array
    incidence: Array


def scan(world: World, sensor: Sensor, pose: Array, motion: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Points (N, 3) float32 and reflectances (N,) float32 of one turn, as recorded and in KITTI's file order.

    `pose` (4, 4) is T_world_lidar at mid-sweep, looking ahead; `motion` (4, 4) is T_start_end of the sweep, which
    `slam.data.distortion.deskew` undoes; identity for a scan without distortion. Points are in the frame that the
    sensor had when it saw them. Whatever the world is, the same count of random numbers is drawn.
    """
    head, lasers = _head(sensor), _Lasers(sensor)
    shape = (sensor.ring_count, head.columns)
    turn = rng.random()
    lottery, mixing, between = rng.random((3, *shape), np.float32)
    wide, shade = rng.standard_normal((2, *shape), np.float32)

    pulses = _cast(world, sensor, pose, motion, lasers.phase + turn)
    chance = _echo_chance(pulses, head)
    reach = _mixed(pulses.reach, mixing, between)
    seen = (reach > head.nearest) & (reach < head.farthest) & (lottery < chance * (1 - _LOST[pulses.material]))
    seen &= ~_hidden(head, pulses.azimuth)

    sigma = np.float32(PULSE_SIGMA) * (1 + np.float32(WEAK) * (1 - chance))
    reported = (reach + lasers.range_error + sigma * wide)[seen]
    azimuth = _read_encoder(pulses.azimuth, head, lasers.phase)[seen]
    ring = np.nonzero(seen)[0]
    xyz = _points(reported, azimuth, sensor.elevation.astype(np.float32)[ring], sensor.offset.astype(np.float32)[ring])
    value = _reflectance(pulses, seen) + (lasers.shade + np.float32(SHADE) * shade)[seen]
    return _rounded(xyz, 1000), _rounded(np.clip(value, 0, 0.99), 100)


def exact_scan(world: World, sensor: Sensor, pose: Array, motion: Array) -> tuple[Array, Array]:
    """The same without noise: every pulse that meets something within range, where it meets it."""
    head = _head(sensor)
    pulses = _cast(world, sensor, pose, motion, _Lasers(sensor).phase)
    seen = (pulses.reach > head.nearest) & (pulses.reach < head.farthest)
    xyz = pulses.reach[seen, None] * pulses.direction[seen]
    xyz[:, 2] += sensor.offset.astype(np.float32)[np.nonzero(seen)[0]]
    return xyz, np.clip(_reflectance(pulses, seen), 0, 1)


class _Lasers:
    """What is different from laser to laser and stays so, (R, 1) each: one instrument, whatever is simulated.

    phase        of its pulses within a column, 0..1
    range_error  metres
    shade        error of its reflectances, mostly small, of some lasers far too dark
    """

    def __init__(self, sensor: Sensor) -> None:
        rng, shape = np.random.default_rng(70), (sensor.ring_count, 1)
        self.phase: Array = rng.random(shape)
        self.range_error = (LASER_SIGMA * rng.standard_normal(shape)).astype(np.float32)
        self.shade = (LASER_SHADE * (0.7 - rng.exponential(size=shape))).astype(np.float32)


def _head(sensor: Sensor) -> Head:
    """Its own, or that of a small LiDAR."""
    return HEADS.get(sensor.name, HEADS["vlp16"])


def _cast(world: World, sensor: Sensor, pose: Array, motion: Array, phase: Array) -> _Pulses:
    """Every pulse of a turn, with each laser at its phase (R, 1) within the columns."""
    step = 2 * np.pi / _head(sensor).columns
    within = GAP + (1 - 2 * GAP) * (phase % 1)
    azimuth = (step * (np.arange(_head(sensor).columns) + within)).astype(np.float32)
    shape, unit = azimuth.shape, np.ones(azimuth.size, np.float32)
    elevation = np.repeat(sensor.elevation.astype(np.float32), shape[1])
    direction = _points(unit, azimuth.ravel(), elevation, np.zeros_like(unit))
    origin = np.zeros_like(direction)
    origin[:, 2] = np.repeat(sensor.offset, shape[1])

    start, way = _at_mid_sweep(origin, direction, azimuth.ravel(), motion)
    rotation = pose[:3, :3].astype(np.float32)
    start, way = (np.einsum("ij,kj->ik", v, rotation) for v in (start, way))  # `@` waits long for BLAS's threads
    hits = world.cast(start + pose[:3, 3], way)
    incidence = np.abs(np.einsum("ij,ij->i", way, hits.normal))
    return _Pulses(
        azimuth,
        direction.reshape(*shape, 3),
        hits.reach.reshape(shape),
        np.where(hits.triangle < 0, 0, world.material[hits.triangle]).reshape(shape),
        np.where(hits.triangle < 0, 0, incidence).reshape(shape),
    )


def _at_mid_sweep(origin: Array, direction: Array, azimuth: Array, motion: Array) -> tuple[Array, Array]:
    """Rays given in the frames of the sensor when it sent them, in its frame at mid-sweep."""
    fraction = (0.5 - azimuth / np.float32(2 * np.pi)) % 1
    both = PointCloud(
        np.concatenate([origin, origin + direction]), np.zeros(2 * len(origin)), time=np.tile(fraction, 2)
    )
    start, tip = np.split(deskew(both, motion).xyz, 2)
    return start, tip - start


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
    """Some of the pulses at an edge see it and what is beside it, and report a range between the two."""
    beside = np.roll(reach, -1, axis=1)
    found = np.isfinite(reach) & np.isfinite(beside) & (mixing < MIXED)
    gap = np.subtract(beside, reach, where=found, out=np.zeros_like(reach))
    edge = (np.abs(gap) > EDGE[0]) & (np.abs(gap) < EDGE[1])
    return np.where(edge, reach + between * gap, reach)


def _hidden(head: Head, azimuth: Array) -> Array:
    """(R, C) bool: does the car that carries the sensor stand in the way?"""
    hidden = np.zeros(azimuth.shape, bool)
    for first, last, start, end in head.hidden:
        rings = slice(first, last + 1)
        hidden[rings] |= (azimuth[rings] > np.deg2rad(start)) & (azimuth[rings] < np.deg2rad(end))
    return hidden


def _read_encoder(azimuth: Array, head: Head, phase: Array) -> Array:
    """(R, C): the step of the encoder in which a pulse was sent; its middle, and never over +x."""
    step, edge = np.float32(head.encoder), 2 * np.pi / head.columns * GAP
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
    """To so many steps a unit, float32."""
    return np.round(values * np.float32(steps)) / np.float32(steps)
