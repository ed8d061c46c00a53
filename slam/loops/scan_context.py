"""Scan context: place recognition by the height of the surroundings.

A descriptor holds the maximum height in each cell of a polar grid around the sensor: rings x sectors (Kim and Kim,
"Scan Context", IROS 2018). A yaw rotation of the sensor shifts its columns, so a place is recognised from any heading,
and the shift gives the yaw. Passes on another lane are recognised by virtual sensors with a lateral shift (root-shift
augmentation; Kim, Choi and Kim, "Scan Context++", T-RO 2021).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slam.data import se3
from slam.data.cloud import Array
from slam.loops import kernels
from slam.settings import ScanContextSettings


@dataclass(frozen=True)
class Candidate:
    """A place similar to the query, not yet verified.

    Attributes:
        index: Index of the place, in the order of insertion, from 0.
        distance: Scan context distance, 0 (identical) to 1.
        yaw: Heading of the query in the candidate's frame [rad], -pi to pi, to half a sector.
        lateral_shift: Offset of the candidate's path to the left of the query [m].
    """

    index: int
    distance: float
    yaw: float
    lateral_shift: float

    @property
    def relative_pose(self) -> Array:
        """Initial T_candidate_query (4, 4) from yaw and lateral shift; it may be metres off along the path."""
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        T = np.eye(4)
        T[:2, :2] = [[cos, -sin], [sin, cos]]
        T[:2, 3] = sin * self.lateral_shift, -cos * self.lateral_shift
        return T


DEFAULT = ScanContextSettings()

DECIMALS = 5  # of a distance of descriptors: the transforms are in single precision
# m: of twice the size, true first candidates are less similar; of this size or with all points, the same places come
# first on recordings of KITTI 00 and NCLT, with the same margin to the others
COLUMN = 0.5
HARMONICS = 4  # of the height over azimuth in a ring's key, beside its mean; fewer confuse places in sparse clouds


def descriptor(xyz: Array, settings: ScanContextSettings = DEFAULT) -> Array:
    """Compute the descriptor (rings, sectors) float32 of points (N, 3) in the sensor frame, z up.

    Each cell holds the maximum height above the ground [m], 0 if it is empty.
    """
    return _descriptors(xyz, (0.0,), settings)[0]


def ring_key(descriptor: Array) -> Array:
    """Compute the key of descriptors, (..., rings, sectors) -> (..., rings * (1 + HARMONICS)) float32.

    The mean of each ring, then the amplitudes of its first harmonics over azimuth: a yaw rotation shifts their phases
    only. The means alone miss 1.5 and 28.8 % of the revisits of two recordings among 10,000 places, with the harmonics
    0.00 and 0.67 % (benchmarks/results/ring_keys.md).
    """
    *places, rings, sectors = descriptor.shape
    waves = np.abs(np.fft.rfft(descriptor, axis=-1)[..., : HARMONICS + 1])
    key = np.zeros((*places, HARMONICS + 1, rings), np.float32)
    key[..., : waves.shape[-1], :] = np.swapaxes(waves, -1, -2) / sectors  # a grid of few sectors has fewer harmonics
    key[..., 1:, :] *= 2  # the other half of the amplitude belongs to the negative frequencies
    return key.reshape(*places, -1)


def distance(a: Array, b: Array) -> tuple[float, float]:
    """Compute the distance of two descriptors, 0 to 1, and the yaw [rad] of a in b's frame at the minimum.

    The distance is 1 - mean cosine over the columns that are filled in both, minimised over all column shifts (eq. 6
    and 7 of the paper); 1 if there are no such columns.
    """
    distances, shifts = _aligned(_spectra(a[None]), _spectra(b[None]), a.shape[1])
    return float(distances[0, 0]), float(_yaw(shifts[0, 0], a.shape[1]))


def highest_points(xyz: Array, settings: ScanContextSettings) -> Array:
    """Select the points (M, 3) of a cloud (N, 3) float32, in its sensor's frame, that submaps for descriptors need.

    A descriptor holds maximum heights, so the highest point of each column of `COLUMN` is enough.
    """
    reach = settings.max_range + settings.submap_length + max(map(abs, settings.lateral_shifts))
    return xyz[kernels.highest(xyz, COLUMN, reach)]


def levelled_submap(clouds: Sequence[Array], poses: Array, travelled: Array, length: float) -> Array:
    """Join the clouds of the last keyframe and of those up to `length` before it.

    The submap is levelled because a tilt raises points ahead and would lower the same points in the reverse direction.

    Args:
        clouds: Points (Nk, 3) float32 of each keyframe, in its own frame.
        poses: (K, 4, 4) T_world_lidar of the keyframes.
        travelled: (K,) travelled distance [m] of the keyframes.
        length: Travelled distance [m] covered by the submap.

    Returns:
        Points (N, 3) float32 in the `levelled` frame of the last keyframe.
    """
    first = int(np.searchsorted(travelled, travelled[-1] - length))
    T_level_lidar = (se3.inverse(levelled(poses[-1])) @ poses[first:]).astype(np.float32)
    return np.concatenate([clouds[first + k] @ T[:3, :3].T + T[:3, 3] for k, T in enumerate(T_level_lidar)])


def levelled(pose: Array) -> Array:
    """Remove roll and pitch from a pose (4, 4), keeping position and heading."""
    yaw = np.arctan2(pose[1, 0], pose[0, 0])
    result = se3.exp(np.array([0.0, 0.0, yaw, 0.0, 0.0, 0.0]))
    result[:3, 3] = pose[:3, 3]
    return result


class ScanContext:
    """Database of the places passed so far.

    For each keyframe call `query` before `add`, with the same cloud and the travelled distance [m] since the start,
    which must not decrease.

    Example:
        >>> places = ScanContext()
        >>> wall = np.array([[10.0, 0.0, 1.0], [0.0, 20.0, 3.0]], np.float32)
        >>> places.query(wall, 0.0), places.add(wall, 0.0)
        ([], 0)
        >>> places.query(wall, 150.0)[0].index
        0
    """

    def __init__(self, settings: ScanContextSettings = DEFAULT) -> None:
        self.settings = settings
        self._count = 0
        self._travelled = np.zeros(64)
        self._keys = np.zeros((64, settings.rings * (1 + HARMONICS)), np.float32)
        self._spectra = np.zeros((64, settings.rings + 1, settings.sectors // 2 + 1), np.complex64)

    def __len__(self) -> int:
        return self._count

    def add(self, xyz: Array, travelled: float) -> int:
        """Add the place of a cloud (N, 3) and return its index, as `insert`."""
        return self.insert(descriptor(xyz, self.settings), travelled)

    def insert(self, context: Array, travelled: float) -> int:
        """Add a place by its descriptor (rings, sectors) and return its index.

        Raises:
            ValueError: `travelled` is smaller than that of the last place.
        """
        if self._count and travelled < self._travelled[self._count - 1]:
            raise ValueError(
                f"travelled: {travelled} m after {self._travelled[self._count - 1]} m; it must not decrease"
            )
        if self._count == len(self._travelled):
            for name in ("_travelled", "_keys", "_spectra"):
                values = getattr(self, name)
                setattr(self, name, np.concatenate([values, np.zeros_like(values)]))
        row = self._count
        self._travelled[row], self._keys[row] = travelled, ring_key(context)
        self._spectra[row] = _spectra(context[None])[0]
        self._count += 1
        return row

    def query(self, xyz: Array, travelled: float, exhaustive: bool = False) -> list[Candidate]:
        """Search places similar to that of a cloud, as `search`.

        Args:
            xyz: Points (N, 3) in the levelled frame of the query.
            travelled: Travelled distance [m] of the query.
            exhaustive: As in `search`.
        """
        return self.search(shifted_descriptors(xyz, self.settings), travelled, exhaustive)

    def search(self, contexts: Array, travelled: float, exhaustive: bool = False) -> list[Candidate]:
        """Search places similar to that of a query, passed at least `min_travelled_distance` before.

        Args:
            contexts: Descriptors (L, rings, sectors) of the query, one per lateral shift.
            travelled: Travelled distance [m] of the query.
            exhaustive: Compare all places at all shifts instead of those with the nearest ring keys, as a reference.

        Returns:
            Candidates, most similar first, each at its best shift; equal ones in the order of insertion.
        """
        end = self._end(travelled)
        if end == 0:
            return []
        rows = np.arange(end) if exhaustive else self._preselect(ring_key(contexts), end)
        distances, shifts = _aligned(_spectra(contexts), self._spectra[rows], self.settings.sectors)
        best = distances.argmin(axis=0)
        each = np.arange(len(rows))
        distances, yaws = distances[best, each], _yaw(shifts[best, each], self.settings.sectors)
        order = np.lexsort((rows, distances))
        order = order[distances[order] < 1.0]
        lateral = np.array(self.settings.lateral_shifts, float)[best]
        columns = (values[order].tolist() for values in (rows, distances, yaws, lateral))
        return [Candidate(*each) for each in zip(*columns, strict=True)]

    def restore(self, contexts: Array, travelled: Array) -> None:
        """Insert the places of an earlier session: descriptors (K, rings, sectors), travelled distances (K,) [m]."""
        for context, distance in zip(contexts, travelled.tolist(), strict=True):
            self.insert(context, distance)

    def _end(self, travelled: float) -> int:
        """The number of places that a query at a travelled distance [m] may find."""
        limit = travelled - self.settings.min_travelled_distance
        return int(np.searchsorted(self._travelled[: self._count], limit, "right"))

    def _preselect(self, keys: Array, end: int) -> Array:
        """Rows of the places before `end` with the ring keys nearest to any of `keys` (L, K), nearest first."""
        unlike = kernels.key_distances(keys, self._keys, end)
        most = min(self.settings.max_preselected, end)
        near = np.flatnonzero(unlike <= np.partition(unlike, most - 1)[most - 1])
        return np.asarray(near[np.argsort(unlike[near], kind="stable")[:most]])


def shifted_descriptors(xyz: Array, settings: ScanContextSettings = DEFAULT) -> Array:
    """Compute the descriptors (L, rings, sectors) of points (N, 3), as seen by each of the virtual sensors."""
    return _descriptors(xyz, settings.lateral_shifts, settings)


def _descriptors(xyz: Array, lateral_shifts: Sequence[float], settings: ScanContextSettings) -> Array:
    """Descriptors (L, rings, sectors), one per virtual sensor, `lateral_shifts` [m] to the left."""
    size = (settings.rings, settings.sectors, settings.max_range, settings.sensor_height)
    xyz = np.ascontiguousarray(xyz, np.float32)
    return np.asarray(kernels.describe(xyz, np.array(lateral_shifts, np.float64), *size))


def _spectra(contexts: Array) -> Array:
    """Spectra over azimuth (L, 1 + rings, frequencies) of descriptors (L, rings, sectors).

    The first row is the spectrum of the columns that are filled, the others are those of the unit columns.
    """
    norms = np.linalg.norm(contexts, axis=1, keepdims=True)
    units = contexts / np.where(norms > 0, norms, 1)
    return np.asarray(np.fft.rfft(np.concatenate([norms > 0, units], axis=1, dtype=np.float32)))


def _aligned(queries: Array, stored: Array, sectors: int) -> tuple[Array, Array]:
    """Compute the scan context distance of each query to stored descriptors at the best column shift.

    The sum of the cosines of all columns, at all shifts at once, is a circular cross-correlation, and so is the number
    of columns that are filled in both: products of spectra.

    Args:
        queries: Spectra (L, 1 + rings, frequencies) of the queries.
        stored: Spectra (M, 1 + rings, frequencies) of the stored descriptors.
        sectors: Number of columns.

    Returns:
        Distances (L, M), 1 if no pair of columns is filled at any shift, and shifts (L, M): column j of the stored
        descriptor matches column j + shift of the query; the first of equal shifts.
    """
    here, there = np.moveaxis(queries, 2, 0), np.moveaxis(stored.conj(), 0, 2).swapaxes(0, 1)
    pairs = np.rint(np.fft.irfft(here[:, :, :1] * there[:, :1], sectors, axis=0))
    cosines = np.fft.irfft(here[:, :, 1:] @ there[:, 1:], sectors, axis=0)
    # rounded: shifts that are equal but for the rounding of the transform remain equal
    distances = np.abs(np.round(1 - np.where(pairs > 0, cosines / np.maximum(pairs, 1), 0), DECIMALS))
    return distances.min(axis=0), distances.argmin(axis=0)


def _yaw(shift: Array, sectors: int) -> Array:
    """Yaw [rad], -pi to pi, of a column shift, 0 to sectors - 1: a turn to the left decreases the column index."""
    return np.asarray((-shift * 2 * np.pi / sectors + np.pi) % (2 * np.pi) - np.pi)
