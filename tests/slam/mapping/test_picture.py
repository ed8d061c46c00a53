"""The map from above."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from slam.data.cloud import Array, PointCloud
from slam.mapping.picture import map_png

WAY = np.column_stack([np.linspace(0, 40, 5), np.zeros(5), np.zeros(5)])


def drawn(tmp_path: Path, cloud: PointCloud) -> Array:
    """The picture (H, W, 3) RGB."""
    map_png(cloud, WAY, tmp_path / "map.png")
    picture = cv2.imread(str(tmp_path / "map.png"))
    assert picture is not None
    return np.asarray(picture[..., ::-1])


def patch(colour: tuple[int, int, int], z: float) -> PointCloud:
    """10 x 10 m next to the path."""
    xy = np.stack(np.meshgrid(np.arange(10, 20, 0.1), np.arange(10, 20, 0.1)), axis=-1).reshape(-1, 2)
    xyz = np.column_stack([xy, np.full(len(xy), z)])
    return PointCloud(xyz, np.ones(len(xyz)), colour=np.tile(colour, (len(xyz), 1)))


def share(picture: Array, colour: tuple[int, int, int]) -> float:
    return float((np.abs(picture.astype(int) - colour) < 12).all(axis=2).mean())


def test_pixels_show_the_highest_point(tmp_path: Path) -> None:
    low, high = patch((200, 40, 240), -1.7), patch((60, 220, 40), 3.0)
    both = PointCloud(
        np.concatenate([high.xyz, low.xyz]), np.ones(2 * len(low)), colour=np.concatenate([high.colour, low.colour])
    )
    picture = drawn(tmp_path, both)
    assert share(picture, (60, 220, 40)) > 0.005
    assert share(picture, (200, 40, 240)) == 0
    assert share(drawn(tmp_path, low), (200, 40, 240)) > 0.005


def test_points_without_colour_are_coloured_by_height(tmp_path: Path) -> None:
    low, high = (drawn(tmp_path, patch((0, 0, 0), z)) for z in (-1.7, 6.0))
    yellow = (253, 231, 36)
    assert share(high, yellow) > 0.005
    assert share(low, yellow) == 0


def test_an_empty_map_shows_the_trajectory(tmp_path: Path) -> None:
    assert share(drawn(tmp_path, PointCloud(np.zeros((0, 3)), np.zeros(0))), (255, 59, 48)) > 0.0005


def test_the_same_map_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        map_png(patch((9, 99, 199), 0.0), WAY, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
