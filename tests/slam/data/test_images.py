"""Images: grey, 16 bits, orientation tags, damage."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from slam.data.cloud import Array
from slam.data.images import ImageFile, bits_in_use, nearest_images

JPEG = (".jpg", [cv2.IMWRITE_JPEG_PROGRESSIVE, 0])
PROGRESSIVE = (".jpg", [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])
RESTARTS = (".jpg", [cv2.IMWRITE_JPEG_RST_INTERVAL, 4])
PNG = (".png", [])


def textured(rows: int = 120, columns: int = 160) -> Array:
    return np.random.default_rng(0).integers(0, 255, (rows, columns, 3), np.uint8)


def encoded(kind: tuple[str, list[int]], image: Array) -> bytes:
    return bytes(cv2.imencode(kind[0], image, kind[1])[1].tobytes())


def read(path: Path, content: bytes) -> ImageFile:
    path.write_bytes(content)
    return ImageFile(path)


@pytest.mark.parametrize("kind", [PNG, JPEG, PROGRESSIVE, RESTARTS])
@pytest.mark.parametrize("image", [textured(), np.zeros((64, 64, 3), np.uint8), np.full((480, 640, 3), 255, np.uint8)])
def test_sound_images_are_read(kind: tuple[str, list[int]], image: Array, tmp_path: Path) -> None:
    reader = read(tmp_path / f"image{kind[0]}", encoded(kind, image))
    assert reader() is not None
    assert reader.problem is None


@pytest.mark.parametrize("kind", [PNG, JPEG, RESTARTS])
def test_a_sector_of_zeros_is_damage(kind: tuple[str, list[int]], tmp_path: Path) -> None:
    whole = encoded(kind, textured())
    middle = len(whole) // 2
    reader = read(tmp_path / f"image{kind[0]}", whole[:middle] + bytes(512) + whole[middle + 512 :])
    assert reader.check() is None  # not seen at the ends
    assert reader() is None
    assert reader.problem is not None
    assert reader.problem.kind == "damaged image"


def test_one_wrong_bit_in_a_png_is_damage(tmp_path: Path) -> None:
    whole = bytearray(encoded(PNG, textured()))
    whole[len(whole) // 2] ^= 1
    reader = read(tmp_path / "image.png", bytes(whole))
    assert reader() is None
    assert "wrong checksum" in str(reader.problem)


def test_a_foreign_mark_in_a_jpeg_is_damage(tmp_path: Path) -> None:
    whole = bytearray(encoded(JPEG, textured()))
    middle = len(whole) // 2
    whole[middle : middle + 4] = b"\xff\x12\x34\x56"
    reader = read(tmp_path / "image.jpg", bytes(whole))
    assert reader() is None
    assert "damaged inside" in str(reader.problem)


def test_a_comment_full_of_zeros_in_a_jpeg_is_no_damage(tmp_path: Path) -> None:
    whole = encoded(JPEG, textured())
    comment = b"\xff\xfe" + (2 + 2000).to_bytes(2, "big") + bytes(2000)
    assert read(tmp_path / "image.jpg", whole[:2] + comment + whole[2:])() is not None


def test_data_behind_the_end_of_a_jpeg_are_no_damage(tmp_path: Path) -> None:
    assert read(tmp_path / "image.jpg", encoded(JPEG, textured()) + bytes(600))() is not None


def test_grey_images_have_three_equal_channels(tmp_path: Path) -> None:
    grey = textured()[:, :, 0]
    image = read(tmp_path / "image.png", encoded(PNG, grey))()
    assert image is not None
    np.testing.assert_array_equal(image, np.repeat(grey[:, :, None], 3, axis=2))


def test_bits_in_use_are_those_of_the_sequence(tmp_path: Path) -> None:
    files = [tmp_path / f"{number}.png" for number in range(3)]
    for file, brightest in zip(files, (100, 4000, 300), strict=True):
        file.write_bytes(encoded(PNG, np.full((4, 4), brightest, np.uint16)))
    assert bits_in_use(files) == 12
    image = ImageFile(files[1], 12)()
    assert image is not None
    assert image[0, 0, 0] == 4000 >> 4


def test_the_nearest_image_within_half_a_period() -> None:
    files = [Path(f"{number}.png") for number in range(3)]
    taken, stamps = np.array([0.01, 0.10, 0.24]), np.array([0.0, 0.1, 0.2, 0.3])
    assert nearest_images(files, taken, stamps) == [files[0], files[1], files[2], None]
