"""A study as a function: which frames it is of, and which were left out."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

from enrichment.studies.depth_image import DepthImage
from enrichment.studies.figures import Figures
from lidarlift.studies import EXACT, SCAN, study_sequence
from slam.data.dataset import open_dataset
from slam.data.errors import InputError


@dataclass(frozen=True)
class Number:
    """Return the number of the frame as its figure."""

    number: float


def number(image: DepthImage) -> Figures[Number]:
    return {"number": {0.5: Number(image.number)}}


def test_means_are_over_frames_with_an_image(street_drive: Callable[..., Path]) -> None:
    sequence = street_drive()
    (sequence / "image_2").mkdir()
    for frame in (0, 2):
        cv2.imwrite(str(sequence / "image_2" / f"{frame:06d}.png"), np.zeros((360, 500, 3), np.uint8))
    data, seen = open_dataset(sequence), list[None]()
    report = study_sequence(data, number, {"number": "of the frame"}, slice(0, 3), lambda: seen.append(None))
    assert len(seen) == 3
    assert report.frames == (0, 2)
    assert report.sources[SCAN]["number"][0.5].number == 1
    assert EXACT not in report.sources
    assert [fault.partition(":")[0] for fault in report.left_out] == ["scan 1"]
    content = json.loads(json.dumps(report.as_dict()))
    assert list(content) == ["about", SCAN]
    assert content["about"] == {
        "title": f"{data.name}, 2 frames", "frames": [0, 2], "shown": 0, "protocol": {"number": "of the frame"},
    }  # fmt: skip
    assert content[SCAN] == {"number": {"0.5": {"number": 1.0}}}


def test_a_sequence_without_images_raises_an_error(street_drive: Callable[..., Path]) -> None:
    data = open_dataset(street_drive())
    with pytest.raises(InputError, match="no image"):
        study_sequence(data, number, {}, slice(0, 1))
    with pytest.raises(InputError, match="the sequence has 8"):
        study_sequence(data, number, {}, slice(8, None))
