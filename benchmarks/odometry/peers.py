"""The systems that lidarlift's odometry is compared with, each with the settings its authors ship.

All take the same scans: deskewed by the same kernel from the system's own constant-velocity prediction, with the same
vertical correction. KISS-ICP's own deskewing is off for that reason.
"""

from __future__ import annotations

from collections import deque
from importlib.resources import as_file, files
from typing import Any

import numpy as np
import small_gicp
from kiss_icp.config import KISSConfig
from kiss_icp.config.config import MappingConfig
from kiss_icp.kiss_icp import KissICP

from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.data.distortion import correct_vertical, deskew

MIN_RANGE, MAX_RANGE = 2.5, 100.0  # metres, for the peers that have no setting of their own


class Peer:
    """A constant-velocity odometry around one registration method."""

    period = 0.1  # s from one scan to the next

    def __init__(self, vertical_correction: float, threads: int = 1) -> None:
        self.vertical_correction, self.threads = vertical_correction, threads
        self.pose, self.motion = np.eye(4), np.eye(4)
        self.frames = 0

    def register(self, cloud: PointCloud) -> Array:
        """Pose (4, 4) of the scan in the frame of the first."""
        scan = correct_vertical(deskew(cloud, se3.log(self.motion) / self.period), self.vertical_correction)
        pose = se3.normalized(self.align(scan.xyz.astype(np.float64), self.pose @ self.motion))
        self.motion, self.pose = se3.inverse(self.pose) @ pose, pose
        self.frames += 1
        return pose

    def align(self, xyz: Array, guess: Array) -> Array:
        raise NotImplementedError


class Kiss(Peer):
    """KISS-ICP (Vizzo et al., RA-L 2023), its default configuration."""

    def __init__(self, vertical_correction: float, threads: int = 1) -> None:
        super().__init__(vertical_correction, threads)
        config = KISSConfig(mapping=MappingConfig(voxel_size=1.0))  # its default, max_range / 100
        config.data.deskew = False
        config.registration.max_num_threads = threads
        self.system = KissICP(config)

    def align(self, xyz: Array, guess: Array) -> Array:
        del guess  # it predicts by itself, likewise
        self.system.register_frame(xyz, np.zeros(len(xyz)))
        return self.system.last_pose.copy()


class GenZ(Peer):
    """GenZ-ICP (Lee et al., RA-L 2025), one of its wheel's configurations; it has no switch for threads."""

    def __init__(self, vertical_correction: float, threads: int = 1, *, configuration: str) -> None:
        super().__init__(vertical_correction, threads)
        from genz_icp.config import load_config
        from genz_icp.genz_icp import GenZICP

        with as_file(files("genz_icp.config") / "pretuned" / f"{configuration}.yaml") as path:
            self.system = GenZICP(load_config(path))

    def align(self, xyz: Array, guess: Array) -> Array:
        del guess  # it predicts by itself, likewise
        self.system.register_frame(xyz, None)
        return self.system.last_pose.copy()


def crop(xyz: Array) -> Array:
    """The points between the ranges that small_gicp and Open3D are given."""
    squared = np.einsum("ij,ij->i", xyz, xyz)
    return xyz[(squared > MIN_RANGE**2) & (squared < MAX_RANGE**2)]


class VoxelizedGicp(Peer):
    """small_gicp's VGICP against its incremental voxel map (its odometry example's settings)."""

    def __init__(self, vertical_correction: float, threads: int = 1) -> None:
        super().__init__(vertical_correction, threads)
        self.map = small_gicp.GaussianVoxelMap(1.0)
        self.map.set_lru(horizon=100, clear_cycle=10)

    def align(self, xyz: Array, guess: Array) -> Array:
        source, _ = small_gicp.preprocess_points(crop(xyz), 0.25, num_threads=self.threads)
        pose = guess
        if self.frames:
            pose = small_gicp.align(self.map, source, guess, num_threads=self.threads).T_target_source
        self.map.insert(source, pose)
        return pose


class Gicp(Peer):
    """small_gicp's GICP from scan to scan."""

    target: tuple[small_gicp.PointCloud, small_gicp.KdTree] | None = None

    def align(self, xyz: Array, guess: Array) -> Array:
        source, tree = small_gicp.preprocess_points(crop(xyz), 0.25, num_threads=self.threads)
        pose = guess
        if self.target is not None:
            motion = small_gicp.align(*self._ordered(source), self.motion, num_threads=self.threads).T_target_source
            pose = self.pose @ motion
        self.target = source, tree
        return pose

    def _ordered(self, source: small_gicp.PointCloud) -> tuple[Any, ...]:
        assert self.target is not None
        return self.target[0], source, self.target[1]


class PointToPlane(Peer):
    """Open3D's point-to-plane ICP from scan to scan, 0.5 m voxels."""

    target = None

    def align(self, xyz: Array, guess: Array) -> Array:
        import open3d as o3d

        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(crop(xyz))).voxel_down_sample(0.5)
        cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(20))
        pose = guess
        if self.target is not None:
            registration = o3d.pipelines.registration
            method = registration.TransformationEstimationPointToPlane()
            pose = (
                self.pose @ registration.registration_icp(cloud, self.target, 1.0, self.motion, method).transformation
            )
        self.target = cloud
        return pose


class DenseGicp(Peer):
    """The yardstick, slow and dense: GICP against the last scans at a quarter of a metre, kept point by point."""

    def __init__(self, vertical_correction: float) -> None:
        super().__init__(vertical_correction, threads=2)
        self.scans: deque[Array] = deque(maxlen=20)

    def align(self, xyz: Array, guess: Array) -> Array:
        source, _ = small_gicp.preprocess_points(crop(xyz), 0.25, num_threads=self.threads)
        pose = guess
        if self.scans:
            target, tree = small_gicp.preprocess_points(np.vstack(self.scans), 0.25, num_threads=self.threads)
            pose = small_gicp.align(
                target, source, tree, guess, num_threads=self.threads, max_iterations=50,
                rotation_epsilon=1e-5, translation_epsilon=1e-4,
            ).T_target_source  # fmt: skip
        points = np.asarray(source.points())[:, :3]
        self.scans.append(points @ pose[:3, :3].T + pose[:3, 3])
        return pose
