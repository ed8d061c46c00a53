"""A walk in a courtyard: a scene that is there at once, and whose walls are known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from slam.simulation.camera import Look
from slam.simulation.drives import Drive
from slam.simulation.mesh import Mesh, box

SIZE = np.array([40.0, 24.0, 30.0])


def _path(stamps: np.ndarray) -> np.ndarray:
    """T_world_sensor (K, 4, 4): in a circle at 4 m/s, nodding five times a second as in a hand."""
    at = np.asarray(stamps, float)
    yaw, pitch = 0.8 * at, 0.03 * np.sin(10 * np.pi * at)
    poses = np.tile(np.eye(4), (len(at), 1, 1))
    cosine, sine = np.cos(yaw), np.sin(yaw)
    turned = np.array([[cosine, -sine, 0 * at], [sine, cosine, 0 * at], [0 * at, 0 * at, 0 * at + 1]])
    nodded = np.array([[np.cos(pitch), 0 * at, np.sin(pitch)], [0 * at, 0 * at + 1, 0 * at]])
    nodded = np.concatenate([nodded, [[-np.sin(pitch), 0 * at, np.cos(pitch)]]])
    poses[:, :3, :3] = np.einsum("ijn,jkn->nik", turned, nodded)
    poses[:, :3, 3] = np.column_stack([5 * sine, -5 * cosine, 1.3 + 0.02 * np.sin(10 * np.pi * at)])
    return poses


class _Scene:
    """See `Scene`."""

    def __init__(self, drive: Drive, seed: int, rng: np.random.Generator) -> None:
        self.drive = drive

    def poses(self, height: float) -> np.ndarray:
        if self.drive.path is not None:
            poses = self.drive.path(self.drive.stamps)
            poses[:, 2, 3] += height - 1.3
            return poses
        poses = np.tile(np.eye(4), (len(self.drive), 1, 1))
        poses[:, :3, 3] = self.drive.position + np.array([0, 0, height])
        cosine, sine = np.cos(self.drive.yaw), np.sin(self.drive.yaw)
        poses[:, :2, :2] = np.moveaxis(np.array([[cosine, -sine], [sine, cosine]]), -1, 0)
        return poses

    def look(self, rng: np.random.Generator) -> Look:
        return Look.of(rng)

    def around(self, place: np.ndarray, radius: float) -> Mesh:
        return Courtyard.mesh

    def moving(self, index: int) -> list[Mesh]:
        return []


class Courtyard:
    """Every built-in drive leads through it, once `drive` has said which."""

    path = staticmethod(_path)
    mesh = box(tuple(SIZE), "plaster").placed(0, 0, 0)

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        scenes = SimpleNamespace(load={"town": _Scene}.get, own={"town": "slam.simulation.scene:Scene"})
        monkeypatch.setattr("slam.simulation.rig.SCENES", scenes)
        monkeypatch.setattr("slam.simulation.simulation.SCENES", scenes)
        self._monkeypatch = monkeypatch

    def drive(self, **fields: Any) -> None:
        """Six frames on a bend, or along its `path`."""
        stamps = np.arange(6) / 10
        position = np.column_stack([2.0 * stamps, -3 + 8 * stamps, 0 * stamps])
        drive = Drive("walk", stamps, position, 0.9 * stamps, **fields)
        self._monkeypatch.setattr("slam.simulation.simulation.built_in", lambda *_: drive)

    @staticmethod
    def placed(xyz: np.ndarray, poses: np.ndarray) -> np.ndarray:
        """Each point (N, 3) by the pose of its own instant (N, 4, 4)."""
        return np.einsum("nij,nj->ni", poses[:, :3, :3], xyz) + poses[:, :3, 3]

    @staticmethod
    def off_the_walls(xyz: np.ndarray) -> np.ndarray:
        """Metres from points (N, 3) of the world to the nearest wall, ground or ceiling."""
        sides = np.abs(np.abs(xyz[:, :2]) - SIZE[:2] / 2)
        return np.min([*sides.T, np.abs(xyz[:, 2]), np.abs(xyz[:, 2] - SIZE[2])], axis=0)


@pytest.fixture
def courtyard(monkeypatch: pytest.MonkeyPatch) -> Courtyard:
    return Courtyard(monkeypatch)
