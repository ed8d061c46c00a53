"""Keyframes: the frames that loop closure, the pose graph and the map use."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.data.errors import InputError
from slam.data.growing import Growing
from slam.mapping.spill import Spill
from slam.mapping.visibility import SPHERE_COLUMNS, SPHERE_ROWS, RangeImage
from slam.mapping.voxel_averages import VoxelAverages
from slam.settings import KeyframeSettings

RECENT = 20  # unpacked keyframes in the cache, for the submaps of a query and of one candidate; 3 MB each
COORDINATE_STEP = 0.003  # m: resolution of coordinates stored in 16 bits, which cover 98 m; the range noise is 20 mm


@dataclass(frozen=True, eq=False)
class Keyframe:
    """One keyframe.

    Attributes:
        index: Index of its frame in the run, from 0.
        pose: (4, 4) T_world_lidar by the odometry.
        travelled: Travelled distance since the first frame [m].
        cloud: Points in the keyframe's frame, deskewed, vertically corrected and downsampled: of its own scan and of
            the scans up to the next keyframe.
        view: Range image of its own scan.
    """

    index: int
    pose: Array
    travelled: float
    cloud: PointCloud
    view: RangeImage


@dataclass(frozen=True, eq=False)
class Place:
    """A keyframe without its cloud and view; attributes as in `Keyframe`."""

    index: int
    pose: Array
    travelled: float


@dataclass(frozen=True, eq=False)
class _Begun:
    """The keyframe whose scans are being gathered; attributes as in `Keyframe`."""

    index: int
    pose: Array
    travelled: float
    view: RangeImage


class Storage(Protocol):
    """Where complete keyframes are kept beyond the run, as in a session."""

    def store(self, index: int, travelled: float, pose: Array, block: bytes) -> None:
        """Store the next keyframe: `block` holds its packed cloud and view."""

    def block(self, number: int) -> bytes:
        """Return the block of a keyframe."""
        ...


class Keyframes(Sequence[Keyframe]):
    """The keyframes of a run, a growing sequence that any thread can read at any time.

    A keyframe is complete when the next one begins: its cloud includes all scans in between. Clouds take 7 bytes per
    point, 10 with colour; beyond the memory budget they are read from `storage`, or without one stored in an unnamed
    file in the temporary folder (TMPDIR), which the operating system removes however the program ends.

    Args:
        settings: Settings.
        storage: Stores the keyframes.
        kept: Index, pose and travelled distance of the keyframes that `storage` has already.
    """

    def __init__(
        self,
        settings: KeyframeSettings | None = None,
        storage: Storage | None = None,
        kept: Sequence[tuple[int, Array, float]] = (),
    ) -> None:
        self.settings = settings or KeyframeSettings()
        limits = self.settings
        self._gathered = VoxelAverages(limits.voxel_size, limits.min_range, limits.max_range)
        self._begun: _Begun | None = None
        self._places, self._storage = Growing(2 + 16), storage
        for place in kept:
            self._keep(Place(*place))
        self.spill = Spill(int(1e6 * limits.memory_mb), storage.block if storage else None, len(kept))
        self._unpacked_lately = lru_cache(RECENT)(self._unpack)  # submaps read the same neighbours repeatedly

    def add(self, cloud: PointCloud, pose: Array, index: int, travelled: float) -> Keyframe | None:
        """Add the next registered scan.

        Args:
            cloud: The deskewed scan in the sensor frame.
            pose: (4, 4) T_world_lidar.
            index: Index of the frame in the run.
            travelled: Travelled distance since the first frame [m].

        Returns:
            The keyframe that is complete because this scan begins a new one, else None.
        """
        done = self.finish() if self._begun and self.begins(pose) else None
        if self._begun is None:
            self._begun = _Begun(index, pose.copy(), travelled, RangeImage.of(cloud))
        self._gathered.insert(cloud, se3.inverse(self._begun.pose) @ pose, self.settings.max_sigma)
        return done

    def finish(self) -> Keyframe | None:
        """Complete the current keyframe and return it; None if there is none."""
        if self._begun is None:
            return None
        begun, self._begun = self._begun, None
        block = _packed(self._gathered, begun.view)
        if self._storage:
            self._storage.store(begun.index, begun.travelled, begun.pose, block)
        self.spill.append(block)
        self._keep(Place(begun.index, begun.pose, begun.travelled))
        self._gathered.clear()
        return self[-1]

    def state(self) -> dict[str, Any]:
        """Return the keyframe that is not complete yet, for `restore`."""
        return {"begun": self._begun, "gathered": self._gathered.state()}

    def restore(self, state: dict[str, Any]) -> None:
        """Continue with a keyframe that was not complete."""
        self._begun = state["begun"]
        self._gathered.restore(state["gathered"])

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, position: int) -> Keyframe:  # type: ignore[override]  # no slices
        return self._unpacked_lately(range(len(self))[position])

    def _unpack(self, number: int) -> Keyframe:
        place = self.place(number)
        return Keyframe(place.index, place.pose, place.travelled, *_unpacked(self.spill.read(number)))

    def __iter__(self) -> Iterator[Keyframe]:
        return (self[position] for position in range(len(self)))

    def place(self, position: int) -> Place:
        """Return what is known of a keyframe without its cloud, which may be on disk."""
        row = self._places[position]
        return Place(int(row[0]), row[2:].reshape(4, 4), float(row[1]))

    @property
    def indices(self) -> Array:
        """Frame indices (K,) in the run."""
        return self._places.array(0).astype(int)

    @property
    def poses(self) -> Array:
        """Odometry poses (K, 4, 4) T_world_lidar."""
        return self._places.array(slice(2, None)).reshape(-1, 4, 4)

    @property
    def travelled(self) -> Array:
        """Travelled distances (K,) [m]."""
        return self._places.array(1)

    def _keep(self, place: Place) -> None:
        self._places.append(np.concatenate([(place.index, place.travelled), place.pose.ravel()]))

    def forget(self, position: int) -> None:
        """Free the cloud and the view of a keyframe, which are not read again."""
        self.spill.forget(position)

    def begins(self, pose: Array) -> bool:
        """Check whether a scan at this pose (4, 4) T_world_lidar begins a new keyframe."""
        if self._begun is None:
            return True
        motion = se3.inverse(self._begun.pose) @ pose
        moved, turned = np.linalg.norm(motion[:3, 3]), np.rad2deg(se3.angle(motion))
        return bool(moved >= self.settings.distance or turned >= self.settings.angle_deg)


class SomeKeyframes(Sequence[Keyframe]):
    """Some keyframes of a run, such as the first ones, as they were before there were more.

    Args:
        keyframes: All keyframes.
        positions: The positions of these.
    """

    def __init__(self, keyframes: Keyframes, positions: Sequence[int]) -> None:
        self._keyframes, self._positions = keyframes, positions

    def __len__(self) -> int:
        return len(self._positions)

    def __getitem__(self, position: int) -> Keyframe:  # type: ignore[override]  # no slices
        return self._keyframes[self._positions[position]]

    def place(self, position: int) -> Place:
        """Return what is known of a keyframe without its cloud, which may be on disk."""
        return self._keyframes.place(self._positions[position])


def _packed(gathered: VoxelAverages, view: RangeImage) -> bytes:
    """Bytes: header (points, has colour, first row of the view), coordinates, intensities, colours, view."""
    xyz, intensity, colour = gathered.steps(COORDINATE_STEP)
    header = np.array([len(xyz), colour is not None, view.first_row], np.int32)
    parts = (header, xyz, intensity, np.zeros(0, np.uint8) if colour is None else colour, view.nearest)
    return b"".join(part.tobytes() for part in parts)


def _unpacked(block: bytes) -> tuple[PointCloud, RangeImage]:
    """The cloud and the view of a block.

    Raises:
        InputError: The block, from a file, is damaged.
    """
    points, coloured, first_row = np.frombuffer(block, np.int32, 3).tolist() if len(block) >= 12 else (-1, 0, 0)
    pixels, rest = divmod(len(block) - 12 - (10 if coloured else 7) * points, 2)
    rows, partial_row = divmod(pixels, SPHERE_COLUMNS)
    if not (0 <= points <= len(block) and 0 <= first_row <= first_row + rows <= SPHERE_ROWS) or rest or partial_row:
        raise InputError(f"a keyframe of {len(block)} bytes is damaged; choose another session")
    xyz = np.frombuffer(block, np.int16, 3 * points, 12).reshape(-1, 3) * np.float32(COORDINATE_STEP)
    at = 12 + 6 * points
    intensity = np.frombuffer(block, np.uint8, points, at) / np.float32(255)
    colour = np.frombuffer(block, np.uint8, 3 * points, at + points).reshape(-1, 3) if coloured else None
    nearest = np.frombuffer(block, np.uint16, offset=at + (4 if coloured else 1) * points).reshape(-1, SPHERE_COLUMNS)
    return PointCloud(xyz, intensity, colour=colour), RangeImage(first_row, nearest)
