"""The colour camera: images of the scene with exact depth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.random import Generator

from slam.data.cloud import Array
from slam.simulation import kernels, shading
from slam.simulation.materials import MATERIALS
from slam.simulation.world import World

RGB = tuple[float, float, float]
Seen = tuple[Array, Array, Array, Array, Array]  # rays (N, 3), reach (N,), triangle (N,), normal (N, 3), origin (3,)

_SKY_STEP = 7  # pixels between two samples of how much sky a surface sees
_NOISE = 0.02  # in the root of the light, where white is about 1
_CONTRAST = np.array([material.contrast for material in MATERIALS], np.float32)
_GLOSS = np.array([material.gloss for material in MATERIALS], np.float32)
_PATTERN = np.array([material.pattern for material in MATERIALS], np.uint8)


class Camera(NamedTuple):
    """P2 (3, 4) projects points of the rectified camera 0 to pixels (u, v); pixel centres are at integers."""

    P2: Array
    width: int
    height: int


#: KITTI's rectified colour camera 2 on 2011-09-26.
CAMERA = Camera(
    np.array([[721.5377, 0.0, 609.5593, 44.85728], [0.0, 721.5377, 172.854, 0.2163791], [0.0, 0.0, 1.0, 0.002745884]]),
    1242,
    375,
)


@dataclass(frozen=True)
class Look:
    """Time of day and weather. Light is linear RGB, where 1 is about that of a clear sky at the horizon.

    Attributes:
        sun: Unit vector towards the sun, world frame.
        sunlight: Light on a surface that faces the sun.
        zenith: Colour of the sky at the zenith.
        horizon: Colour of the sky at the horizon.
        haze: Share of light lost per metre of air.
        cover: Share of the sky behind clouds, 0..1.
        exposure: Exposure of the camera.
        seed: Random seed of the clouds.
        ground: Share of the light that the ground reflects.
        reach: Distance beyond which objects do not block light [m]; a few metres indoors, where light is diffuse.
    """

    sun: tuple[float, float, float]
    sunlight: RGB
    zenith: RGB
    horizon: RGB
    haze: float
    cover: float
    exposure: float
    seed: int
    ground: RGB = (0.17, 0.16, 0.14)
    reach: float = np.inf

    @staticmethod
    def of(rng: Generator) -> Look:
        """Draw a clear day, one with scattered clouds, or an overcast one, with a low or a high sun."""
        elevation, azimuth = np.deg2rad(rng.uniform(16, 58)), rng.uniform(0, 2 * np.pi)
        sun = (np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation))
        seed = int(rng.integers(1 << 31))
        weather = rng.uniform()
        if weather > 0.8:
            grey = float(rng.uniform(0.9, 1.3))
            return Look(
                sun=sun,
                sunlight=(0.0, 0.0, 0.0),
                zenith=(1.0 * grey, 1.04 * grey, 1.1 * grey),
                horizon=(0.86 * grey, 0.9 * grey, 0.94 * grey),
                haze=float(rng.uniform(0.0005, 0.0015)),
                cover=float(rng.uniform(0.7, 0.9)),
                exposure=1.9 / grey,
                seed=seed,
            )
        strength = float(3.6 * np.sqrt(np.sin(elevation)))
        warmth = float(1 - np.sin(elevation))
        return Look(
            sun=sun,
            sunlight=(strength, strength * (0.97 - 0.16 * warmth), strength * (0.9 - 0.36 * warmth)),
            zenith=(0.32, 0.46, 0.72),
            horizon=(0.86 + 0.1 * warmth, 0.95, 1.06 - 0.08 * warmth),
            haze=float(rng.uniform(0.0003, 0.001)),
            cover=float(rng.uniform(0.0, 0.6)),
            exposure=float(2.9 / strength),
            seed=seed,
        )


def render(world: World, T_world_camera: Array, look: Look, rng: Generator) -> tuple[Array, Array]:
    """Render the image and the depth of a camera.

    Args:
        world: The scene.
        T_world_camera: (4, 4), camera z forward, x right, y down; world z up.
        look: Time of day and weather.
        rng: Random generator of the noise.

    Returns:
        Image (H, W, 3) uint8 RGB, and depth (H, W) float32: z in the camera frame [m], 0 for sky.
    """
    rays = kernels.turned(_rays(), np.array(T_world_camera[:3, :3], np.float32))
    origin = np.array(T_world_camera[:3, 3], np.float64)
    hits = world.cast(origin, rays, _order())
    kernels.face_camera(hits.normal, rays)
    seen: Seen = (rays, hits.reach, hits.triangle, hits.normal, origin)
    light = shading.shade(
        *seen, CAMERA.width, CAMERA.P2[0, 0],
        world.colour, world.material, _linear(), _PATTERN, _CONTRAST, _GLOSS,
        _sunlit(world, seen, look), _mirrored(world, seen), *_open_sky(world, seen, look.reach), _SKY_STEP,
        _air(look), look.haze, look.cover, look.seed,
    )  # fmt: skip
    depth = np.where(hits.triangle >= 0, hits.reach, np.float32(0))
    return _developed(light, look, rng), depth.reshape(CAMERA.height, CAMERA.width)


@lru_cache(maxsize=1)
def _rays() -> Array:
    """(H * W, 3) float32, camera frame, z = 1: a reach along them is a depth."""
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width].reshape(2, -1)
    rays = np.column_stack([u, v, np.ones_like(u)]) @ np.linalg.inv(CAMERA.P2[:, :3]).T
    return rays.astype(np.float32)


@lru_cache(maxsize=1)
def _order() -> Array:
    """(H * W,) int32: pixels by squares of 4 x 4 and their halves, so that eight that follow each other are near."""
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width].reshape(2, -1)
    return np.lexsort((u % 2, v % 4, u // 2, v // 4)).astype(np.int32)


@lru_cache(maxsize=1)
def _linear() -> Array:
    """(256,) float32: share of the light that an sRGB value stands for (IEC 61966-2-1)."""
    value = np.arange(256) / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4).astype(np.float32)


@lru_cache(maxsize=1)
def _tone_curve() -> Array:
    """(2048,) uint8 over the square root, 0..2, of the exposed light: film's dark foot and soft shoulder, then sRGB."""
    film = (1 - np.exp(-1.25 * np.linspace(0, 2, 2048) ** 2)) ** 1.15
    return np.round(255 * np.where(film <= 0.0031308, 12.92 * film, 1.055 * film ** (1 / 2.4) - 0.055)).astype(np.uint8)


def _air(look: Look) -> Array:
    """(5, 3) for the kernels: sun, sunlight, zenith, horizon, and what the ground gives back of them."""
    sky = 0.5 * (np.array(look.zenith) + look.horizon)
    ground = np.array(look.ground) * (sky + look.sun[2] * np.array(look.sunlight))
    return np.array([look.sun, look.sunlight, look.zenith, look.horizon, ground])


def _sunlit(world: World, seen: Seen, look: Look) -> Array:
    """Sunlight (N,) float32: 1 in the sun, 0 in the shade, softened by a pixel.

    A ray is cast for every second pixel; the others take the mean of their neighbours.
    """
    sunlit, asked = np.zeros((2, CAMERA.height, CAMERA.width), np.float32)
    if any(look.sunlight):
        pixels, start = kernels.sun_rays(*seen, _order(), CAMERA.width, np.array(look.sun))
        towards = np.broadcast_to(np.array(look.sun, np.float32), start.shape)
        asked.reshape(-1)[pixels] = 1
        sunlit.reshape(-1)[pixels] = ~world.hidden(start, towards)
    return (cv2.blur(sunlit, (3, 3)) / np.maximum(cv2.blur(asked, (3, 3)), np.float32(0.1))).reshape(-1)


def _mirrored(world: World, seen: Seen) -> Array:
    """(N,) int32: the triangle that a glossy surface mirrors, -1 where that is the sky."""
    mirrored = np.full(len(seen[0]), -1, np.int32)
    pixels, start, direction = kernels.mirror_rays(*seen, _order(), world.material, _GLOSS)
    if len(pixels):
        mirrored[pixels] = world.cast(start, direction).triangle
        kernels.double(mirrored, seen[2])
    return mirrored


def _open_sky(world: World, seen: Seen, farthest: float) -> tuple[Array, Array]:
    """Share of the hemisphere above the surface that is open: without anything nearer than `farthest` [m].

    It is computed at every `_SKY_STEP`-th pixel in both axes, with a mask of where it may be interpolated (see
    `shading.smooth_cells`). It darkens corners, narrow streets and the ground below cars.
    """
    rows, columns = CAMERA.height // _SKY_STEP, CAMERA.width // _SKY_STEP
    cells, start, direction = kernels.sky_rays(*seen, CAMERA.width, _SKY_STEP)
    openness = np.zeros(rows * columns, np.float32)
    if len(cells):
        if np.isinf(farthest):
            hidden = world.hidden(start, direction, alike=False)
        else:
            hidden = world.cast(start, direction).reach < farthest
        openness += np.bincount(cells, ~hidden, rows * columns) / 4
    _, reach, triangle, normal, _ = seen
    return shading.smooth_cells(openness.reshape(rows, columns), reach, triangle, normal, CAMERA.width, _SKY_STEP)


def _developed(light: Array, look: Look, rng: Generator) -> Array:
    """The sensor's picture (H, W, 3) uint8; the lens is a little soft."""
    grain = int(rng.integers(1 << 62))
    image = shading.develop(light, CAMERA.width, look.exposure, _NOISE, grain, _tone_curve())
    soft = cv2.GaussianBlur(image.reshape(CAMERA.height, CAMERA.width, 3), (3, 3), 0.7)
    return soft[..., ::-1]  # a view: it is written blue first
