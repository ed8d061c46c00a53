"""The frames of a drive that loops, the pose graph and the map are made of."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.mapping.spill import Spill
from slam.mapping.visibility import SPHERE_COLUMNS, RangeImage
from slam.mapping.voxel_averages import VoxelAverages
from slam.settings import KeyframeSettings

RECENT = 32  # keyframes that stay unpacked: the surroundings of a query and of its candidates; 3 MB each
COORDINATE_STEP = 0.003  # m: coordinates are kept as whole multiples of it in 16 bits, which reach 98 m; noise is 20 mm


@dataclass(frozen=True, eq=False)
class Keyframe:
    """One of them.

    index  of its frame in the run, 0 = the first frame
    pose   (4, 4) T_world_lidar as the odometry has it
    way    metres driven since the first frame
    cloud  the points in its own frame, deskewed, vertically corrected and thinned: of its own scan and of those that
           follow up to the next keyframe
    view   how far the beams of its own scan went
    """

    index: int
    pose: Array
    way: float
    cloud: PointCloud
    view: RangeImage


class Keyframes(Sequence[Keyframe]):
    """The keyframes of a drive, as a sequence that is added to and read at any time, from any thread.

    A keyframe is done when the next one begins: its cloud has what all scans in between saw. Clouds are held compactly,
    7 bytes a point, 10 with colour; what is beyond the budget lies in a file without a name in the temporary folder
    (TMPDIR), which the operating system removes however the program ends.
    """

    def __init__(self, settings: KeyframeSettings | None = None) -> None:
        self.settings = settings or KeyframeSettings()
        limits = self.settings
        self._gathered = VoxelAverages(limits.voxel_size, limits.min_range, limits.max_range)
        self._begun: Keyframe | None = None  # its cloud is its own scan's alone
        self._kept: list[tuple[int, Array, float]] = []
        self.spill = Spill(int(1e6 * limits.memory_mb))
        self._unpacked_lately = lru_cache(RECENT)(self._unpack)  # neighbours are asked for again and again

    def add(self, cloud: PointCloud, pose: Array, index: int, way: float) -> Keyframe | None:
        """The next registered scan: deskewed, in the sensor's frame, seen from `pose` (4, 4), T_world_lidar.

        Returns the keyframe that is done now because this scan begins a new one, else None.
        """
        done = self.finish() if self._begun and self.begins(pose) else None
        if self._begun is None:
            beams = cloud.select(cloud.measured)  # a predicted point is no beam: nothing may be carved away by it
            self._begun = Keyframe(index, pose.copy(), way, cloud, RangeImage.of(beams))
        sure = cloud.select(cloud.sigma <= self.settings.max_sigma)
        self._gathered.insert(sure, se3.inverse(self._begun.pose) @ pose)
        return done

    def finish(self) -> Keyframe | None:
        """The keyframe that was being gathered, done now as it is; None where there was none."""
        if self._begun is None:
            return None
        begun, self._begun = self._begun, None
        self.spill.append(_packed(self._gathered.points(), begun.view))
        self._kept.append((begun.index, begun.pose, begun.way))
        self._gathered.clear()
        return self[-1]

    def __len__(self) -> int:
        return len(self._kept)

    def __getitem__(self, position: int) -> Keyframe:  # type: ignore[override]  # no slices
        return self._unpacked_lately(range(len(self._kept))[position])

    def _unpack(self, number: int) -> Keyframe:
        return Keyframe(*self._kept[number], *_unpacked(self.spill.read(number)))

    def __iter__(self) -> Iterator[Keyframe]:
        return (self[position] for position in range(len(self)))

    @property
    def indices(self) -> Array:
        """(K,) of their frames in the run."""
        return np.array([index for index, _, _ in self._kept], int)

    @property
    def poses(self) -> Array:
        """(K, 4, 4) T_world_lidar as the odometry has them."""
        return np.array([pose for _, pose, _ in self._kept]).reshape(-1, 4, 4)

    @property
    def ways(self) -> Array:
        """(K,) metres driven."""
        return np.array([way for _, _, way in self._kept], float)

    def begins(self, pose: Array) -> bool:
        """Whether a scan seen from there begins a new keyframe."""
        if self._begun is None:
            return True
        motion = se3.inverse(self._begun.pose) @ pose
        moved, turned = np.linalg.norm(motion[:3, 3]), np.rad2deg(se3.angle(motion))
        return bool(moved >= self.settings.distance or turned >= self.settings.angle_deg)


def _packed(cloud: PointCloud, view: RangeImage) -> bytes:
    """Points, whether they have colour, the view's first row; coordinates, intensities, colours; the view."""
    steps = np.round(cloud.xyz / np.float32(COORDINATE_STEP))
    within = (np.abs(steps) < 1 << 15).all(axis=1)
    header = np.array([within.sum(), cloud.colour is not None, view.first_row], np.int32)
    intensity = np.round(255 * np.clip(cloud.intensity[within], 0, 1)).astype(np.uint8)
    colour = np.zeros(0, np.uint8) if cloud.colour is None else cloud.colour[within]
    parts = (header, steps[within].astype(np.int16), intensity, colour, view.nearest)
    return b"".join(part.tobytes() for part in parts)


def _unpacked(block: bytes) -> tuple[PointCloud, RangeImage]:
    points, coloured, first_row = np.frombuffer(block, np.int32, 3).tolist()
    xyz = np.frombuffer(block, np.int16, 3 * points, 12).reshape(-1, 3) * np.float32(COORDINATE_STEP)
    at = 12 + 6 * points
    intensity = np.frombuffer(block, np.uint8, points, at) / np.float32(255)
    colour = np.frombuffer(block, np.uint8, 3 * points, at + points).reshape(-1, 3) if coloured else None
    nearest = np.frombuffer(block, np.uint16, offset=at + (4 if coloured else 1) * points).reshape(-1, SPHERE_COLUMNS)
    return PointCloud(xyz, intensity, colour=colour), RangeImage(first_row, nearest)
