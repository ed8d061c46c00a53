"""The sensor rig, a LiDAR and a camera, that moves through a scene frame by frame."""

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
BLOCK, RADIUS = (
    30.0,
    115.0,
)  # metres of the path that share the static objects of one block, and the radius of the block
PARTS = 12  # of a sweep along a path that is known between the frames: at 10 Hz, 8 ms each


@dataclass(frozen=True)
class Mount:
    """Mounting of a LiDAR: `height` above the ground [m], None for the drive's default; `tilt` [rad], positive down."""

    height: float | None = None
    tilt: float = 0.0


@dataclass(frozen=True, eq=False)
class SimulatedFrame:
    """One recorded frame, with exact data on request.

    Attributes:
        scan: The recorded scan.
        exact: Scan of 64 channels without errors, or None.
        image: (H, W, 3) uint8 RGB at mid-sweep, None without a camera.
        depth: (H, W) float32, z in the camera frame [m], 0 = sky, or None.
    """

    scan: Scan
    image: Array | None
    exact: Scan | None
    depth: Array | None


class Rig:
    """The scene of a drive, and the sensor rig in it.

    Attributes:
        scene: The scene.
        lidar: The LiDAR.
        distort: Whether it moves during a sweep.
        poses: (N, 4, 4) T_world_lidar at mid-sweep, when the image is taken too.
        T_camera0_lidar: (4, 4); the camera stays level when the LiDAR is tilted.
        calibration: Calibration of the camera.
        height: Height of the LiDAR above the ground [m].
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
        """Simulate a frame; it does not depend on the frames simulated before."""
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
        """Return the motion of the LiDAR during the sweep of a frame.

        There is none without distortion; otherwise it follows the path of the drive if there is one, or else the
        velocity between the poses before and after.
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
        """Return the number of the section of the path whose frames share one static world."""
        return int(self._drive.way[index] // BLOCK)

    def _standing(self, block: int) -> StandingWorld:
        """The static world around the frames of a section of the path."""
        if self._block is None or self._block[0] != block:
            self._block = None  # frees the old one first
            frames = self._drive.position[self._drive.way // BLOCK == block, :2]
            middle = (frames.min(axis=0) + frames.max(axis=0)) / 2
            reach = np.linalg.norm(frames - middle, axis=1).max()
            self._block = block, StandingWorld(self.scene.around(middle, RADIUS + reach))
        return self._block[1]
