"""A car with a LiDAR and a camera that drives through its scene, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.data.kitti import rectified_camera
from slam.data.sensor import Sensor, load_sensor
from slam.simulation.camera import CAMERA, render
from slam.simulation.drives import Drive
from slam.simulation.lidar import exact_scan, scan
from slam.simulation.scene import SCENES
from slam.simulation.world import StandingWorld, World

LIDAR_HEIGHT = 1.73  # metres above the ground, as on KITTI's car
SWEEP = 0.1  # seconds
#: T_camera0_lidar: the camera looks ahead from 8 cm below the LiDAR and 27 cm before it, much as KITTI's does.
TR = np.array([[0, -1, 0, 0.0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1.0]])
BLOCK, RADIUS = 30.0, 115.0  # metres of the way that share one standing world, and what it holds around them


@dataclass(frozen=True, eq=False)
class SimulatedFrame:
    """What the car recorded in one frame, and the truth where that was asked for.

    scan, exact   (N, 4) float32: x, y, z, reflectance, in KITTI's file order; `exact` by 64 channels without any error
    image         (H, W, 3) uint8 RGB, None without a camera
    depth         (H, W) float32: z [m] in the camera's frame, 0 = sky
    """

    scan: Array
    image: Array | None
    exact: Array | None
    depth: Array | None


class Rig:
    """The scene around a drive, and the car in it.

    scene        all that the car sees
    poses        (N, 4, 4) T_world_lidar at mid-sweep, when the image is taken too
    calibration  the camera's
    """

    def __init__(
        self,
        drive: Drive,
        sensor: Sensor,
        seed: int,
        *,
        distort: bool = False,
        truth: bool = False,
        camera: bool = True,
    ) -> None:
        self._drive, self._sensor, self._seed = drive, sensor, seed
        self._distort, self._truth, self._camera = distort, truth, camera
        rng = np.random.default_rng([seed, 0])
        self.scene = SCENES.load(drive.scene)(drive, seed, rng)
        self.poses = self.scene.poses(LIDAR_HEIGHT if drive.height is None else drive.height)
        self.calibration = rectified_camera(np.vstack([CAMERA.P2, [0, 0, 0, 1]]), TR)
        self._look = self.scene.look(rng)
        self._block: tuple[int, StandingWorld] | None = None

    def frame(self, index: int) -> SimulatedFrame:
        """The same whichever frames were asked for before."""
        world = World(self._standing(self.stretch(index)), self.scene.moving(index))
        rng = np.random.default_rng([self._seed, 3, index])
        pose, motion = self.poses[index], self._motion(index)
        recorded = scan(world, self._sensor, pose, motion, rng)
        T_world_camera = pose @ se3.inverse(self.calibration.T_camera_lidar)
        image, depth = render(world, T_world_camera, self._look, rng) if self._camera else (None, None)
        exact = exact_scan(world, load_sensor("hdl64"), pose, motion) if self._truth else None
        return SimulatedFrame(
            scan=np.column_stack(recorded),
            image=image,
            exact=None if exact is None else np.column_stack(exact),
            depth=depth if self._truth else None,
        )

    def stretch(self, index: int) -> int:
        """The number of the stretch of the way whose frames share one standing world."""
        return int(self._drive.way[index] // BLOCK)

    def _standing(self, block: int) -> StandingWorld:
        """What stands around the frames of a stretch of the way."""
        if self._block is None or self._block[0] != block:
            self._block = None  # frees the old one first
            frames = self._drive.position[self._drive.way // BLOCK == block, :2]
            middle = (frames.min(axis=0) + frames.max(axis=0)) / 2
            reach = np.linalg.norm(frames - middle, axis=1).max()
            self._block = block, StandingWorld(self.scene.around(middle, RADIUS + reach))
        return self._block[1]

    def _motion(self, index: int) -> Array:
        """T_start_end of the frame's sweep, from the poses before and after; identity for a scan without distortion."""
        if not self._distort:
            return np.eye(4)
        first, last = max(index - 1, 0), min(index + 1, len(self.poses) - 1)
        motion = se3.inverse(self.poses[first]) @ self.poses[last]
        return se3.scale(motion, SWEEP / (self._drive.stamps[last] - self._drive.stamps[first]))
