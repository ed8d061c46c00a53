"""LiDAR edges of several scans with the images taken at the same time, and how well they agree by a transform."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slam.calibration.edges import MARK, SIDE, TOP, Edges, find_edges
from slam.calibration.fields import edge_fields
from slam.calibration.kernels import edge_sums
from slam.data import se3
from slam.data.camera import project, visible
from slam.data.cloud import Array, Calibration, PointCloud
from slam.data.distortion import deskew

#: Tops are less exact, since rings are far apart; marks are fewer on some roads than on others.
WEIGHTS = {SIDE: 1.0, TOP: 0.25, MARK: 0.5}
AROUND = 0.083  # rad, half the width of an edge's surroundings


@dataclass(frozen=True, eq=False)
class View:
    """A scan and its image.

    Attributes:
        xyz: (N, 3) [m], points deskewed to the stamp.
        velocity: (6,) of the LiDAR in its frame: rotation [rad/s], then translation [m/s].
        edges: Edges of the scan.
        grey: (H, W) uint8, the image of a pinhole camera.
    """

    xyz: Array
    velocity: Array
    edges: Edges
    grey: Array


def view_of(cloud: PointCloud, velocity: Array, grey: Array) -> View:
    """Return the view of a scan as recorded, with rings, at a velocity (6,) [rad/s, m/s]."""
    cloud = deskew(cloud, velocity)
    return View(cloud.xyz, velocity, find_edges(cloud), grey)


@dataclass(frozen=True)
class Parameters:
    """Parameters that explain where LiDAR edges are in the images.

    Attributes:
        T: (4, 4) T_camera_lidar.
        delay: Time of the images after the scans' stamps [s].
        side: Where sides are between the last ray on a surface and the next one, 0..1.
        top: Likewise of tops. Beams have a width, and sensors report the nearer surface differently.
    """

    T: Array
    delay: float = 0.0
    side: float = 0.5
    top: float = 0.5

    SIZE = 9

    def changed(self, change: Array) -> Parameters:
        """Change by (9,): rotation about the camera's axes [rad], its translation [m], delay [s], side, top."""
        T = np.eye(4)
        T[:3, :3] = se3.exp(np.concatenate([change[:3], np.zeros(3)]))[:3, :3] @ self.T[:3, :3]
        T[:3, 3] = self.T[:3, 3] + change[3:6]
        return Parameters(T, self.delay + change[6], self.side + change[7], self.top + change[8])

    def change_to(self, T: Array) -> Array:
        """Return the change (6,) of rotation [rad] and translation [m] that leads to `T`."""
        rotation = np.eye(4)
        rotation[:3, :3] = T[:3, :3] @ self.T[:3, :3].T
        return np.concatenate([se3.log(rotation)[:3], T[:3, 3] - self.T[:3, 3]])


class Observations:
    """The edges that the camera sees, and the edge fields of the images at one scale.

    Args:
        views: F views.
        K: (3, 3) camera matrix.
        T: (4, 4) T_camera_lidar by which the visible edges are selected.
        sigma: Blur of the fields [pixels].
        most: Number of edges of a view that are used, evenly thinned; None: all.
    """

    def __init__(self, views: Sequence[View], K: Array, T: Array, sigma: float, most: int | None = None) -> None:
        self._K = K
        height, width = (max(view.grey.shape[axis] for view in views) for axis in (0, 1))
        self._fields = np.zeros((len(views), 2, height, width), np.float32)
        columns: list[tuple[Array, ...]] = []
        for number, view in enumerate(views):
            rows, wide = view.grey.shape
            self._fields[number, :, :rows, :wide] = edge_fields(view.grey, sigma, AROUND * K[0, 0])
            pixels, depth = project(view.xyz, Calibration(K, T))
            edges = view.edges
            seen = np.flatnonzero(visible(pixels, depth, view.grey.shape)[edges.near])
            if most is not None and len(seen) > most:
                seen = seen[np.linspace(0, len(seen) - 1, most).astype(int)]
            xyz, step = edges.xyz[seen], edges.step[seen]
            motion = -(np.cross(view.velocity[:3], xyz) + view.velocity[3:])
            place = np.full(len(seen), number, np.int32)
            columns.append((xyz, step, motion, place, edges.kind[seen], _field(T, xyz, step)))
        stacked = (np.concatenate(column) for column in zip(*columns, strict=True))
        self._points, self._step, self._motion, self._view, self._kind, self._fields_of = stacked
        self._weight = np.array([WEIGHTS[kind] for kind in (SIDE, TOP, MARK)])[self._kind]

    def __len__(self) -> int:
        return len(self._points)

    def by_view(self, at: Parameters) -> Array:
        """Return the contributions (F,) of the views to the score."""
        share = np.array([at.side, at.top, 0.5])[self._kind]
        sums = np.zeros(len(self._fields))
        edges = (self._points, self._step, self._motion, self._view, self._fields_of, self._weight)
        edge_sums(*edges, self._fields, self._K, at.T, at.delay, share, sums)
        return sums / max(float(self._weight.sum()), 1e-9)

    def score(self, at: Parameters) -> float:
        """Return the mean strength of image edges at LiDAR edges: 0 as anywhere in the images, 1 twice as much."""
        return float(self.by_view(at).sum())

    def shifts(self, at: Parameters, other: Parameters) -> Array:
        """Return how far (E,) edges move across themselves [pixels] between two sets of parameters."""
        pixels = [project(self._places(each), Calibration(self._K, each.T))[0] for each in (at, other)]
        moved = np.nan_to_num(pixels[1] - pixels[0])
        return np.where(self._fields_of == 0, moved[:, 0], moved[:, 1])

    def _places(self, at: Parameters) -> Array:
        """The edges (E, 3) [m] at the time of the images."""
        share = np.array([at.side, at.top, 0.5])[self._kind]
        return self._points + share[:, None] * self._step + at.delay * self._motion


def _field(T: Array, xyz: Array, step: Array) -> Array:
    """(E,) uint8: 0 where a step goes along the rows of the image, which needs derivatives along x; 1: along y."""
    point, change = xyz @ T[:3, :3].T + T[:3, 3], step @ T[:3, :3].T
    moved = np.abs(change[:, :2] * point[:, 2:] - point[:, :2] * change[:, 2:])
    return (moved[:, 1] > moved[:, 0]).astype(np.uint8)
