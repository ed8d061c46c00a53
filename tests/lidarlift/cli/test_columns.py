"""`--columns`: scans whose files do not say what their numbers are."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Command = Callable[..., Any]


@pytest.fixture
def packed(tmp_path: Path, street_scans: list[np.ndarray]) -> Path:
    """Scans of x, y, z in float64 and an intensity of one byte."""
    folder = tmp_path / "packed"
    folder.mkdir()
    for number, scan in enumerate(street_scans[:3]):
        table = np.rec.fromarrays([*scan[:, :3].T.astype("f8"), (scan[:, 3] * 255).astype("u1")])
        (folder / f"{number}.bin").write_bytes(table.tobytes())
    (folder / "times.txt").write_text("0\n0.1\n0.2\n")
    return folder


def test_columns_are_named(lidarlift: Command, packed: Path) -> None:
    assert lidarlift("run", packed, "--columns", "x:f8,y:f8,z:f8,intensity:u1", "--out", "r").code == 0
    report = json.loads(Path("r/run.json").read_text())
    assert report["counts"]["frames"] == 3
    assert report["counts"]["failed"] == 0


def test_columns_that_are_none(lidarlift: Command, packed: Path) -> None:
    lidarlift("run", packed, "--columns", "x:f8,y:f8,intensity:u1", "--out", "r").refused(
        "x, y and z must be among them"
    )
    assert not Path("r").exists()


def test_columns_of_a_layout_that_has_its_own(lidarlift: Command, street_drive: Callable[..., Path]) -> None:
    lidarlift("run", street_drive(), "--columns", "x,y,z", "--out", "r").refused("name the folder of its scans")
