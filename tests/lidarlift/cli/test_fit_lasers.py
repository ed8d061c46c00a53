"""`lidarlift fit-lasers`: a table for people, a sensor.yaml for the next run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slam.data.sensor import load_sensor

Drive = Callable[..., Path]
Command = Callable[..., Any]


@pytest.fixture
def raw(street_drive: Drive) -> Path:
    """The street drive with a word that its scans are raw."""
    folder = street_drive({3: b""})
    (folder / "sensor.yaml").write_text("model: hdl64\nvertical_correction_deg: 0.1\n")
    return folder


def test_laser_lines_are_printed_and_written(lidarlift: Command, raw: Path) -> None:
    result = lidarlift("fit-lasers", raw, "--frames", "0:4", "--out", "new/sensor.yaml")
    assert result.code == 0, result.err
    sensor, true = load_sensor("new/sensor.yaml"), load_sensor("hdl64")
    assert sensor.name == "hdl64"
    assert sensor.vertical_correction == pytest.approx(np.deg2rad(0.1))
    assert sensor.elevation == pytest.approx(true.elevation, abs=1e-5)
    assert sensor.offset == pytest.approx(true.offset, abs=1e-4)
    heading, *rows, written = result.out.splitlines()
    assert heading.split()[:2] == ["ring", "elevation"]
    table = np.array([row.split() for row in rows], float)
    assert table[:, 0].tolist() == list(range(64))
    assert table[:, 1] == pytest.approx(np.rad2deg(sensor.elevation), abs=1e-4)
    assert table[:, 3] == pytest.approx(1e3 * sensor.offset, abs=0.02)
    assert table[:, 6].tolist() == [1800] * 64
    assert written == "Written to new/sensor.yaml"
    assert "left out (number of rings): 3 (0)" in result.err
    assert "off their lines" not in result.err


def test_large_residuals_are_noted(lidarlift: Command, tmp_path: Path, street_scans: list[np.ndarray]) -> None:
    scan = street_scans[0].copy()
    scan[:, 2] += np.random.default_rng(1234).normal(0, 0.01, len(scan))
    (tmp_path / "scans").mkdir()
    scan.tofile(tmp_path / "scans" / "0.bin")
    result = lidarlift("fit-lasers", "scans")
    assert result.code == 0, result.err
    assert "deg; expected are raw scans" in result.err
    assert load_sensor("sensor.yaml").ring_count == 64


def test_an_existing_file_is_not_overwritten(lidarlift: Command, raw: Path) -> None:
    before = (raw / "sensor.yaml").read_text()
    lidarlift("fit-lasers", raw, "--out", raw / "sensor.yaml").refused("sensor.yaml: already exists", "--out")
    assert (raw / "sensor.yaml").read_text() == before


def test_motion_compensated_scans_are_an_error(lidarlift: Command, street_drive: Drive) -> None:
    result = lidarlift("fit-lasers", street_drive())
    assert result.code == 1
    assert "Error: " in result.err
    assert "motion-compensated scans" in result.err
    assert not Path("sensor.yaml").exists()


def test_an_empty_frame_range_is_an_error(lidarlift: Command, raw: Path) -> None:
    lidarlift("fit-lasers", raw, "--frames", "20:").refused("no frames in that range", "the sequence has 8")


def test_help_has_an_example(lidarlift: Command) -> None:
    assert "Example: lidarlift fit-lasers" in " ".join(lidarlift("fit-lasers", "--help").out.split())
    assert lidarlift("fit-lasers", "x", "--rings", "1").code == 2
