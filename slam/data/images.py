"""Images of cameras: matching with scans, and reading."""

from __future__ import annotations

import contextlib
import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from slam.data.cloud import Array, Frame
from slam.data.files import SCAN_PERIOD
from slam.data.image_damage import PNG, TAIL, fault_inside, fault_of
from slam.data.problem import Problem
from slam.data.scan_names import in_order
from slam.data.stamps import usual_step
from slam.data.time_files import TIME_FILES, read_stamps

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")
IMAGE_FOLDERS = ("images", "image_2")
DEPTHS = (10, 12, 14, 16)  # bits in use of 16
DEPTH_AT = 24  # offset of the byte of a PNG with its bits per value
SAMPLES = 5  # images of a sequence in which the bits in use are determined


class ReportingReader(ABC):
    """Reader of an image that may be damaged.

    Attributes:
        problem: What is wrong with the image, once that is known.
    """

    problem: Problem | None = None

    @abstractmethod
    def __call__(self) -> Array | None:
        """Read the image, (H, W, 3) uint8 RGB; None for a damaged one."""


class ImageFile(ReportingReader):
    """Reads an image: (H, W, 3) uint8 RGB as its pixels are stored, ignoring an orientation tag.

    Attributes:
        path: The file, PNG or JPEG, in colour or grey, of 8 or 16 bits.
        bits: Bits in use of 16; 0: as many as the image itself needs.
        problem: Damage of the file, None if none is known so far.
    """

    def __init__(self, path: Path, bits: int = 0) -> None:
        self.path, self.bits = path, bits

    def __call__(self) -> Array | None:
        """Read the image; None if the file is damaged."""
        import cv2  # slow to import, and not needed without a camera

        image, fault = None, self._fault_at_ends()
        if fault is None:
            content = self.path.read_bytes()
            fault = fault_inside(content)
        if fault is None:
            flags = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
            image = cv2.imdecode(np.frombuffer(content, np.uint8), flags)
            fault = "its contents cannot be decoded"
        if image is None:
            self.problem = self.problem or _damaged(self.path, str(fault))
            return None
        return np.asarray(cv2.cvtColor(_eight_bits(image, self.bits), cv2.COLOR_BGR2RGB))

    def check(self) -> Problem | None:
        """Return the damage that the beginning and the end of the file show; the pixels are not read."""
        if self.problem is None and (fault := self._fault_at_ends()):
            self.problem = _damaged(self.path, fault)
        return self.problem

    def _fault_at_ends(self) -> str | None:
        try:
            with self.path.open("rb") as file:
                head = file.read(16)
                file.seek(0, 2)
                file.seek(max(file.tell() - TAIL, 0))
                return fault_of(head, file.read())
        except OSError as error:
            return f"cannot be read ({error.strerror or error})"


def no_image() -> Array | None:
    """Return None: the reader of a scan without an image."""
    return None


def image_problems(image: ImageFile | None, number: int, folder: Path) -> tuple[Problem, ...]:
    """Return a Problem if a data set with images has no image, an empty or a damaged file for this scan."""
    if image is None or (image.path.is_file() and image.path.stat().st_size == 0):
        return (Problem("missing image", f"{folder}: no image for scan {number}; its points stay without colour"),)
    problem = image.check()
    return () if problem is None else (problem,)


def found_in_reading(frame: Frame) -> tuple[Problem, ...]:
    """Return the damage found while reading a frame's images, without the frame's own problems."""
    readers = (reader for reader in frame.image_readers if isinstance(reader, ReportingReader))
    found = (reader.problem for reader in readers)
    return tuple(problem for problem in found if problem is not None and problem not in frame.problems)


def image_folder(path: Path) -> Path | None:
    """Return the folder with the images of a sequence, or None."""
    return next((path / name for name in IMAGE_FOLDERS if (path / name).is_dir()), None)


def matched_images(
    folder: Path, scans: Sequence[Path], stamps: Array, known_times: bool, unit: str | None = None
) -> tuple[Path | None, list[ImageFile | None], tuple[Problem, ...]]:
    """Match images with scans.

    With a times.txt of the images, the image of a scan is the nearest in time, within half a scan period; else the one
    with the scan's name, or with its number; else the nearest by the stamps in the images' names.

    Args:
        folder: Folder of the images.
        scans: Files of the N scans.
        stamps: (N,) stamps of the scans [s].
        known_times: Whether the stamps were recorded, not assumed.
        unit: Unit of stamps in the names of the images, if known (see `in_order`).

    Returns:
        The folder of the images, None if no image is used; the image of each scan, or None; and problems of the images
        as a whole.
    """
    files = (file for file in folder.iterdir() if file.suffix.lower() in IMAGE_SUFFIXES and file.name[0] != ".")
    names = in_order(list(files), unit)
    images = names.files
    problems: tuple[Problem, ...] = ()
    times = next((folder / name for name in TIME_FILES if (folder / name).is_file()), None)
    read = read_stamps(times, images, names.numbers) if images and times is not None and known_times else None
    if read is not None:
        found, problems = nearest_images(images, read.seconds, stamps), read.problems
    else:
        found = _by_name(images, scans)
        if not any(found) and names.stamps is not None and known_times:
            found = nearest_images(images, names.stamps, stamps)
    if any(found):
        bits = bits_in_use(images)
        return folder, [None if image is None else ImageFile(image, bits) for image in found], problems
    fault = f"none of {len(images)} images has a scan's name, number or time" if images else "no images in it"
    text = f"{folder}: {fault}; the camera is not used. Name them like the scans, or give {folder.name}/times.txt"
    return None, [None] * len(scans), (Problem("unmatched images", text),)


def nearest_images(images: Sequence[Path], taken: Array, stamps: Array) -> list[Path | None]:
    """Return the image nearest to each stamp (N,), None beyond half a scan period; `taken` (M,) are rising times."""
    after = np.searchsorted(taken, stamps).clip(max=len(taken) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(taken[before] - stamps) <= np.abs(taken[after] - stamps), before, after)
    near = np.abs(taken[nearest] - stamps) <= (usual_step(stamps) or SCAN_PERIOD) / 2
    return [images[at] if close else None for at, close in zip(nearest, near, strict=True)]


def _by_name(images: Sequence[Path], scans: Sequence[Path]) -> list[Path | None]:
    """The image with the name of each scan; if no name agrees, the one with the same single number in its name."""
    names = {image.stem: image for image in images}
    found = [names.get(scan.stem) for scan in scans]
    if any(found):
        return found
    numbered = {_number(image): image for image in images if _number(image) is not None}
    return [numbered.get(_number(scan)) for scan in scans]


def _number(file: Path) -> int | None:
    """The number in a name; None if there is none, more than one, or a stamp."""
    digits = re.fullmatch(r"[^0-9]*([0-9]{1,9})[^0-9]*", file.stem)
    return int(digits[1]) if digits else None


def _damaged(path: Path, fault: str) -> Problem:
    return Problem("damaged image", f"{path}: {fault}; this scan's points stay without colour")


def bits_in_use(images: Sequence[Path]) -> int:
    """Return how many of 16 bits are in use, one of `DEPTHS`, by the brightest pixel of some images; 0 for 8 bits."""
    brightest = 0
    for at in np.unique(np.linspace(0, len(images) - 1, SAMPLES).astype(int)):
        with contextlib.suppress(OSError), images[at].open("rb") as file:
            head = file.read(DEPTH_AT + 1)
            if head.startswith(PNG) and head[DEPTH_AT:] == b"\x10":
                import cv2

                image = cv2.imread(str(images[at]), cv2.IMREAD_UNCHANGED)
                brightest = max(brightest, 0 if image is None else int(image.max()))
    return _bits(brightest) if brightest else 0


def _bits(brightest: int) -> int:
    return next(bits for bits in DEPTHS if brightest < 1 << bits)


def _eight_bits(image: Array, bits: int) -> Array:
    """An image of 16 bits as one of 8, by the bits in use in the sequence, or in this image if it has more."""
    if image.dtype == np.uint8:
        return image
    return (image >> (max(bits, _bits(int(image.max()))) - 8)).astype(np.uint8)
