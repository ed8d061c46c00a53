"""The folder of scans that inputs are put into."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slam.data.cloud import Array
from tests.inputs.bench import (
    SCANS,
    STAMPS,
    Bench,
)


@pytest.fixture
def bench(
    tmp_path: Path,
    lidarlift: Callable[..., Any],
    street_drive: Callable[..., Path],
    street_poses: Array,
    street_scans: list[Array],
) -> Bench:
    folder = tmp_path / "drive"
    folder.mkdir()
    scan = np.array([[10, 0, 1, 0.5], [0, 10, 0, 0.25], [-10, 0, -1, 1]], np.float32).tobytes()
    for number in range(SCANS):
        (folder / f"{number:06d}.bin").write_bytes(scan)
    (folder / "times.txt").write_text("".join(f"{stamp:.6f}\n" for stamp in STAMPS))
    return Bench(folder, lidarlift, street_drive, street_poses, street_scans)
