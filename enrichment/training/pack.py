"""Packs: samples in one file, small enough to keep and to share; 300 frames of KITTI at half resolution take 60 MB.

A pack is an .npz without pickle: `about` (JSON), and for frame k `k/image` (WebP), `k/returns` (RETURN) and `k/target`
(16-bit PNG, 256 steps per metre, 0 = none). Only the colours are compressed with loss.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from enrichment.geometry.held_out import ring_step
from enrichment.training.licence import licence_of
from enrichment.training.samples import RETURN, Sample, Source
from slam.data.atomic import written_beside
from slam.data.cloud import Array
from slam.data.depth_map import DEPTH_SCALE
from slam.data.errors import InputError

VERSION = 2  # increased when the same sequence would give another pack
WEBP = [cv2.IMWRITE_WEBP_QUALITY, 85]
REMEDY = "delete it, and it is packed again from its sequences"


@dataclass(frozen=True)
class PackedSequence:
    """Description of a packed sequence.

    Attributes:
        name: Name of the sequence.
        frames: Numbers of the packed frames, in order.
        ring_step: As in `Sample`.
        target: Source of the target depths.
        licence: Licence of the recordings.
    """

    name: str
    frames: tuple[int, ...]
    ring_step: int
    target: str
    licence: str


class Pack:
    """N encoded samples in memory; `pack[i]` decodes one.

    Args:
        path: The .npz file.

    Attributes:
        scale: Cells per pixel.
        digest: Digest of the packed data.
        sequences: The packed sequences.

    Raises:
        InputError: The file is not a pack.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with path.open("rb") as content, np.load(content, allow_pickle=False) as file:
                about = _about(file)
                self.scale, self.digest = float(about["scale"]), str(about["digest"])
                self.sequences = tuple(_sequence(entry) for entry in about["drives"])
                self._steps = [sequence.ring_step for sequence in self.sequences for _ in sequence.frames]
                self._frames = [_frame(file, k) for k in range(len(self._steps))]
        except FileNotFoundError as error:
            raise InputError(f"{path}: no such file; expected a pack or the folder of a sequence") from error
        except (OSError, ValueError, TypeError, KeyError, AttributeError, EOFError, zipfile.BadZipFile) as error:
            fault = " ".join(str(error).split())
            raise InputError(f"{path}: not a pack of version {VERSION}, or damaged ({fault}); {REMEDY}") from error

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, index: int) -> Sample:
        image, returns, target = self._frames[index]
        colours, depth = cv2.imdecode(image, cv2.IMREAD_COLOR), cv2.imdecode(target, cv2.IMREAD_UNCHANGED)
        if colours is None or depth is None or colours.shape[:2] != depth.shape:
            raise InputError(f"{self.path}: frame {index} is damaged; {REMEDY}")
        colours = np.ascontiguousarray(colours[..., ::-1])
        return Sample(colours, returns, depth / np.float32(DEPTH_SCALE), self._steps[index], self.scale)


def packed(path: Path, sources: Sequence[Source], on_frame: Callable[[], None] = lambda: None) -> Pack:
    """Open the pack of these sequences, and write it first unless the file exists.

    Args:
        path: The .npz file.
        sources: The sequences.
        on_frame: Called for each frame that is read.

    Raises:
        InputError: The file has other content, or a sequence has no frame with image and ring indices.
    """
    digest = _digest(sources)
    if path.exists():
        pack = Pack(path)
        if pack.digest != digest:
            raise InputError(f"{path}: packed from other sequences or settings; delete it, or choose another file")
        return pack
    arrays: dict[str, Array] = {}
    sequences = []
    for source in sources:
        sequence = _encode(source, arrays, on_frame)
        if not sequence.frames:
            raise InputError(f"{source.data.path}: no frame has both an image and ring indices; training needs both")
        sequences.append(asdict(sequence))
    about = {"version": VERSION, "scale": sources[0].scale, "digest": digest, "drives": sequences}
    arrays["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
    with written_beside(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]  # numpy's stub has no place for names
    return Pack(path)


def _encode(source: Source, arrays: dict[str, Array], on_frame: Callable[[], None]) -> PackedSequence:
    """Add the samples of a sequence to `arrays`."""
    data, frames, first = source.data, list[int](), len(arrays) // 3
    for number, sample in zip(data.numbers, source, strict=True):
        if sample is not None:
            name = f"{first + len(frames)}"
            frames.append(int(number))
            arrays[f"{name}/image"] = cv2.imencode(".webp", sample.image[..., ::-1], WEBP)[1]
            arrays[f"{name}/returns"] = sample.returns
            arrays[f"{name}/target"] = cv2.imencode(".png", np.round(sample.target * DEPTH_SCALE).astype(np.uint16))[1]
        on_frame()
    assert data.sensor is not None
    return PackedSequence(data.name, tuple(frames), ring_step(data.sensor), source.target, licence_of(data))


def _digest(sources: Sequence[Source]) -> str:
    """Digest of everything that a pack of these sequences depends on, except for the content of scans and images."""
    digest = hashlib.sha256(str(VERSION).encode())
    for source in sources:
        digest.update(repr((source.data.name, source.scale, source.target)).encode())
        digest.update(source.data.numbers.tobytes())
        digest.update(b"" if source.poses is None else source.poses.tobytes())
    return digest.hexdigest()[:16]


def _about(file: Any) -> dict[str, Any]:
    about = json.loads(file["about"].tobytes())
    if about["version"] != VERSION:
        raise ValueError(f"version {about['version']}")
    return dict(about)


def _sequence(entry: dict[str, Any]) -> PackedSequence:
    return PackedSequence(**{**entry, "frames": tuple(entry["frames"])})


def _frame(file: Any, k: int) -> tuple[Array, Array, Array]:
    """Encoded image, returns, encoded target."""
    returns = file[f"{k}/returns"]
    if returns.dtype != RETURN:
        raise ValueError(f"the returns of frame {k} are of another type")
    return file[f"{k}/image"], returns, file[f"{k}/target"]
