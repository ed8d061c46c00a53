"""A car with a LiDAR and a camera that drives through its scene, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.data.kitti import rectified_camera
from slam.simulation.camera import CAMERA, render
from slam.simulation.drives import Drive
from slam.simulation.heads import Lidar
from slam.simulation.lidar import Scan, exact_scan, scan
from slam.simulation.scene import SCENES
from slam.simulation.sweep import Sweep
from slam.simulation.world import StandingWorld, World

LIDAR_HEIGHT = 1.73  # metres above the ground, as on KITTI's car
#: T_camera0_lidar of a level LiDAR: the camera looks ahead from 8 cm below and 27 cm before it, much as KITTI's does.
TR = np.array([[0, -1, 0, 0.0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1.0]])
BLOCK, RADIUS = 30.0, 115.0  # metres of the way that share one standing world, and what it holds around them
PARTS = 12  # of a sweep along a path that is known between the frames: at 10 Hz, 8 ms each


@dataclass(frozen=True)
class Mount:
    """How a LiDAR is mounted: `height` above the ground [m], None for the drive's own, and `tilt` [rad], nose down."""

    height: float | None = None
    tilt: float = 0.0


@dataclass(frozen=True, eq=False)
class SimulatedFrame:
    """What the car recorded in one frame, and the truth where that was asked for.

    scan, exact   as they were seen; `exact` by 64 channels without any error
    image         (H, W, 3) uint8 RGB, taken at mid-sweep, None without a camera
    depth         (H, W) float32: z [m] in the camera's frame, 0 = sky
    """

    scan: Scan
    image: Array | None
    exact: Scan | None
    depth: Array | None


class Rig:
    """The scene around a drive, and the car in it.

    scene            all that the car sees
    lidar            and `distort`: whether it moves during a sweep
    poses            (N, 4, 4) T_world_lidar at mid-sweep, when the image is taken too
    T_camera0_lidar  (4, 4): the camera stays level when the LiDAR is tilted
    calibration      the camera's
    height           of the LiDAR above the ground [m]
    """

    def __init__(
        self,
        drive: Drive,
        lidar: Lidar,
        seed: int,
        *,
        mount: Mount = Mount(),
        distort: bool = False,
        truth: bool = False,
        camera: bool = True,
    ) -> None:
        self._drive, self._seed = drive, seed
        self.distort, self._truth, self._camera = distort, truth, camera
        rng = np.random.default_rng([seed, 0])
        self.scene = SCENES.load(drive.scene)(drive, seed, rng)
        self.height = height = mount.height or drive.height or LIDAR_HEIGHT
        T_level_lidar = se3.exp(np.array([0, mount.tilt, 0, 0, 0, 0.0]))
        self.lidar = lidar if (height, mount.tilt) == (LIDAR_HEIGHT, 0) else lidar.unhidden()
        self.T_camera0_lidar = TR @ T_level_lidar
        self.poses = self.scene.poses(height) @ T_level_lidar
        self.calibration = rectified_camera(np.vstack([CAMERA.P2, [0, 0, 0, 1]]), self.T_camera0_lidar)
        self._look = self.scene.look(rng)
        self._block: tuple[int, StandingWorld] | None = None

    def frame(self, index: int) -> SimulatedFrame:
        """The same whichever frames were asked for before."""
        world = World(self._standing(self.stretch(index)), self.scene.moving(index))
        rng = np.random.default_rng([self._seed, 3, index])
        sweep = self.sweep(index)
        recorded = scan(world, self.lidar, sweep, rng)
        T_world_camera = self.poses[index] @ se3.inverse(self.calibration.T_camera_lidar)
        image, depth = render(world, T_world_camera, self._look, rng) if self._camera else (None, None)
        return SimulatedFrame(
            scan=recorded,
            image=image,
            exact=exact_scan(world, Lidar.of("hdl64", self.lidar.rate), sweep) if self._truth else None,
            depth=depth if self._truth else None,
        )

    def sweep(self, index: int) -> Sweep:
        """How the LiDAR moves in a frame's sweep.

        Not at all for a scan without distortion; along the path of a drive that has one; else at the velocity between
        the poses before and after.
        """
        pose, drive = self.poses[index], self._drive
        if not self.distort:
            return Sweep.steady(pose, np.eye(4))
        if drive.path is None:
            first, last = max(index - 1, 0), min(index + 1, len(self.poses) - 1)
            motion = se3.inverse(self.poses[first]) @ self.poses[last]
            share = 1 / self.lidar.rate / (drive.stamps[last] - drive.stamps[first])
            return Sweep.steady(pose, se3.scale(motion, share))
        (carried,) = drive.path(drive.stamps[index : index + 1])
        way = np.array(drive.path(drive.stamps[index] + np.linspace(-0.5, 0.5, PARTS + 1) / self.lidar.rate))
        way[:, :3, :3] = way[:, :3, :3] @ (carried[:3, :3].T @ pose[:3, :3])  # tilted
        way[:, :3, 3] += pose[:3, 3] - carried[:3, 3]  # higher or lower
        return Sweep.along(way)

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
