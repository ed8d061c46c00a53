"""Inputs that caused errors in similar tools or earlier versions: images and calibration.

Each case states the result of earlier versions and the result now, which `play` checks.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest

from slam.data.dataset import Dataset, open_dataset
from slam.data.errors import InputError
from slam.data.images import ImageFile
from slam.pipeline import Pipeline
from tests.inputs.bench import (
    CALIBRATION,
    STAMPS,
    START,
    Bench,
    Case,
)


def pictures(bench: Bench, names: Sequence[str], *, times: Sequence[float] = (), calibrated: bool = True) -> Path:
    folder = bench.folder / "images"
    folder.mkdir(exist_ok=True)
    for number, name in enumerate(names):
        cv2.imwrite(str(folder / name), np.full((4, 6, 3), number % 250, np.uint8))
    if times:
        (folder / "times.txt").write_text("".join(f"{stamp}\n" for stamp in times))
    if calibrated:
        (bench.folder / "calib.yaml").write_text(CALIBRATION)
    return folder


def shades(data: Dataset, positions: Sequence[int]) -> list[int | None]:
    images = [data[position].image for position in positions]
    return [None if image is None else int(image[0, 0, 0]) for image in images]


def image_kinds(data: Dataset, position: int) -> list[str]:
    return [problem.kind for problem in data[position].problems]


def fewer_images(bench: Bench) -> None:
    pictures(bench, [f"{number:06d}.png" for number in range(5)])
    data = open_dataset(bench.folder)
    assert shades(data, [0, 4, 5]) == [0, 4, None]
    assert image_kinds(data, 5) == ["missing image"]


def images_by_number(bench: Bench) -> None:
    pictures(bench, [f"frame{number}.png" for number in range(12)])
    assert shades(open_dataset(bench.folder), [0, 2, 11]) == [0, 2, 11]


def images_of_other_names(bench: Bench) -> None:
    pictures(bench, ["left.png", "right.png"])
    data = open_dataset(bench.folder)
    assert [problem.kind for problem in data.problems] == ["unmatched images"]
    assert image_kinds(data, 0) == []


def a_faster_camera(bench: Bench) -> None:
    """Thirty images per second, from one second before the scans, over half of the sequence."""
    times = START - 1 + np.arange(480) / 30
    pictures(bench, [f"{number}.png" for number in range(480)], times=times.tolist())
    data = open_dataset(bench.folder)
    assert shades(data, [0, 1, 10, 200]) == [30, 33, 60, None]


def images_named_by_stamps(bench: Bench) -> None:
    """Names in nanoseconds since 1970, 20 ms after every other scan."""
    pictures(bench, [f"{round((stamp + 0.02) * 1e3)}000000.png" for stamp in STAMPS[:20:2]])
    data = open_dataset(bench.folder)
    assert shades(data, [0, 2, 18]) == [0, 1, 9]
    assert image_kinds(data, 1) == ["missing image"]


def namesakes_first(bench: Bench) -> None:
    """Scans and images are named by the same stamps, and times.txt counts from 0."""
    folder = bench.folder / "named"
    (folder / "images").mkdir(parents=True)
    for number in range(5):
        name = f"{round(STAMPS[number] * 10)}00000000"
        (folder / f"{name}.bin").write_bytes((bench.folder / "000000.bin").read_bytes())
        cv2.imwrite(str(folder / "images" / f"{name}.png"), np.full((4, 6, 3), number, np.uint8))
    (folder / "times.txt").write_text("0\n0.1\n0.2\n0.3\n0.4\n")
    assert shades(open_dataset(folder), range(5)) == [0, 1, 2, 3, 4]


def many_images(_: Bench) -> None:
    from slam.data import images

    stamps = 0.1 * np.arange(36_000)
    files = [Path(f"{number}.png") for number in range(36_000)]
    tracemalloc.start()
    found = images.nearest_images(files, stamps + 0.01, stamps)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found == files
    assert peak < 20e6


def damaged_images(bench: Bench) -> None:
    folder = pictures(bench, [f"{number:06d}.png" for number in range(4)])
    rng = np.random.default_rng(0)
    cv2.imwrite(str(folder / "000001.png"), rng.integers(0, 255, (60, 80, 3), np.uint8))
    whole = (folder / "000001.png").read_bytes()
    (folder / "000000.png").write_bytes(b"no image at all")
    (folder / "000002.png").write_bytes(whole[: len(whole) // 2])
    (folder / "000003.png").write_bytes(whole[:200] + bytes(300) + whole[500:])
    data = open_dataset(bench.folder)
    frames = [data[position] for position in range(4)]
    kinds = [[problem.kind for problem in frame.problems] for frame in frames]
    assert kinds == [["damaged image"], [], ["damaged image"], []]
    assert [frame.image is None for frame in frames] == [True, False, True, True]
    inside = frames[3].read_image
    assert isinstance(inside, ImageFile)
    assert inside.problem is not None
    assert "000003.png: wrong checksum inside" in inside.problem.message


def damage_in_a_run(bench: Bench) -> None:
    """The first image is damaged in its pixels only, and is read to colour the map."""
    path = bench.street()
    (path / "image_2").mkdir()
    rng = np.random.default_rng(0)
    for number in range(8):
        cv2.imwrite(str(path / "image_2" / f"{number:06d}.png"), rng.integers(0, 255, (60, 80, 3), np.uint8))
    first = path / "image_2" / "000000.png"
    whole = first.read_bytes()
    first.write_bytes(whole[:200] + bytes(300) + whole[500:])
    run = Pipeline().run(open_dataset(path), slice(3))
    assert run.counts()["damaged_image"] == 1
    first.write_bytes(whole[:5000])
    result = bench.lidarlift("run", path, "--frames", ":3", "--strict", "--out", "r")
    assert result.code == 1
    assert "000000.png: cut short" in result.err


def orientation_tag(bench: Bench) -> None:
    path = bench.folder / "turned.jpg"
    encoded = cv2.imencode(".jpg", np.zeros((20, 40, 3), np.uint8))[1].tobytes()
    exif = (
        b"Exif\x00\x00II*\x00\x08\x00\x00\x00\x01\x00\x12\x01\x03\x00\x01\x00\x00\x00\x06\x00\x00\x00\x00\x00\x00\x00"
    )
    path.write_bytes(encoded[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + encoded[2:])
    turned = cv2.imread(str(path))
    assert turned is not None
    assert turned.shape == (40, 20, 3)  # the tag is one that OpenCV would follow
    image = ImageFile(path)()
    assert image is not None
    assert image.shape == (20, 40, 3)


def sixteen_bits(bench: Bench) -> None:
    grey = np.arange(256, dtype=np.uint16).reshape(16, 16)
    for bits in (8, 12, 16):
        path = bench.folder / f"{bits}.png"
        cv2.imwrite(str(path), grey.astype(np.uint8) if bits == 8 else grey << (bits - 8))
        image = ImageFile(path)()
        assert image is not None
        np.testing.assert_array_equal(image[:, :, 1], grey)


def fisheye(bench: Bench) -> None:
    path = bench.folder / "calib.yaml"
    path.write_text(CALIBRATION + "distortion: [-0.03, 0.02, -0.05, 0.03]\n")
    with pytest.raises(InputError, match=r"may be k1 k2 k3 k4 of a fisheye lens.*say model: pinhole"):
        open_dataset(bench.folder)
    path.write_text(CALIBRATION + "distortion: [-0.03, 0.02, -0.05, 0.03]\nmodel: equidistant\n")
    calibration = open_dataset(bench.folder).calibration
    assert calibration is not None
    assert calibration.fisheye
    path.write_text(CALIBRATION + "distortion: [-0.03, 0.02, -0.05, 0.03]\nmodel: plumb_bob\n")
    calibration = open_dataset(bench.folder).calibration
    assert calibration is not None
    assert not calibration.fisheye
    path.write_text(CALIBRATION + "model: omnidirectional\n")
    with pytest.raises(InputError, match="unknown model 'omnidirectional'; known: pinhole"):
        open_dataset(bench.folder)


def odd_sizes(bench: Bench) -> None:
    path = bench.street()
    (path / "image_2").mkdir()
    for number in range(3):
        cv2.imwrite(str(path / "image_2" / f"{number:06d}.png"), np.full((369, 1225, 3), 90, np.uint8))
    methods = [word for name in ("ip-basic", "f2l", "joint") for word in ("--method", name)]
    result = bench.lidarlift("depth-benchmark", path, "--frames", "1:2", "--out", "d", *methods)
    assert result.code == 0, result.err


CASES = [
    Case("48", "images of 1225 x 369 pixels", "not tested", "every method completes their depth", odd_sizes),
    Case("49", "fewer images than scans", "not tested", "no image for the other scans, and reported", fewer_images),
    Case(
        "49b",
        "images with the numbers of the scans, but other names",
        "no image for any scan",
        "matched by number",
        images_by_number,
    ),
    Case(
        "49c",
        "images without any relation to the scans",
        "no image for any scan",
        "reported once per sequence",
        images_of_other_names,
    ),
    Case(
        "49d",
        "a camera at 30 Hz that starts and stops earlier",
        "right",
        "the nearest image within half a scan period",
        a_faster_camera,
    ),
    Case(
        "49e",
        "images named by stamps, scans named by numbers",
        "no image for any scan",
        "the nearest in time",
        images_named_by_stamps,
    ),
    Case(
        "49f",
        "scans and images named by the same stamps, times.txt from 0",
        "matched by name",
        "matched by name",
        namesakes_first,
    ),
    Case("R15", "an hour of images matched by time", "16 bytes per pair: 21 GB", "a few megabytes", many_images),
    Case(
        "R23a",
        "damaged images",
        "a line in the log, not counted",
        "reported; no partial image is used",
        damaged_images,
    ),
    Case(
        "R23b",
        "an image damaged in its pixels, in a run",
        "not counted; --strict did not stop",
        "counted; --strict stops",
        damage_in_a_run,
    ),
    Case(
        "R23c",
        "a JPEG with an orientation tag",
        "rotated, so that K did not match",
        "pixels as stored",
        orientation_tag,
    ),
    Case(
        "R23d", "16-bit images", "nearly black for a 12-bit camera", "scaled to 8 bits by the bits in use", sixteen_bits
    ),
    Case(
        "R23e",
        "coefficients of a fisheye lens",
        "read as k1 k2 p1 p2",
        "read as `model` states, else required",
        fisheye,
    ),
]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_images_and_calibration(case: Case, bench: Bench) -> None:
    case.play(bench)
