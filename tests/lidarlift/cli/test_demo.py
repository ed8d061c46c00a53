"""`lidarlift demo`: runs over one simulated drive, and their comparison."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from slam.session import read_report
from slam.simulation.simulation import SimulationConfig

Command = Callable[..., Any]


@pytest.fixture(autouse=True)
def cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Where the demo's drive is kept."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "lidarlift" / "demo"


def test_the_demo_compares_all_inputs(lidarlift: Command, simulated: list[SimulationConfig]) -> None:
    result = lidarlift("demo", "--out", "d")
    assert result.code == 0, result.err
    assert simulated == [SimulationConfig(drive="loop", every=2)]
    inputs = json.loads(Path("d/compare.json").read_text())["inputs"]
    assert {path.name for path in Path("d").iterdir()} == {*inputs, "compare.json", "compare.md"}
    for channels in ("16", "enriched", "64"):
        folder = Path("d") / channels
        protocol = read_report(folder)["protocol"]
        assert (protocol["input"], protocol["frames"]) == (channels, [0, 8, 1])
        assert (folder / "map.pcd").exists()
        assert (folder / "trajectory.png").exists()
        ate = json.loads((folder / "metrics.json").read_text())["slam"]["ate"]["aligned"]["rmse"]
        assert inputs[channels]["ate_m"] == ate < 0.1
        assert re.search(rf"^{channels} +{ate:.3f} ", result.out, re.MULTILINE)
        assert f"{folder}: map.pcd" in result.out
    assert inputs["16"]["points_per_scan"] * 4 == inputs["64"]["points_per_scan"]
    assert inputs["16"]["points_per_scan"] < inputs["enriched"]["points_per_scan"] < inputs["64"]["points_per_scan"]
    assert inputs["64"]["to_full_m"] is None
    assert 0 < inputs["enriched"]["to_full_m"] < 0.1
    assert "| enriched |" in Path("d/compare.md").read_text()
    assert "d/compare.json" in result.out
    assert "simulated town" in result.err
    assert_time_and_rows_are_told(result.err)


def assert_time_and_rows_are_told(err: str) -> None:
    """Check the forecast at the start, and the line of each finished row."""
    lines = [line for line in err.splitlines() if any(word in line for word in ("The demo takes", " left", "ATE"))]
    told = r"about [\d.]+ (seconds|minutes)"
    assert re.fullmatch(rf"The demo takes {told} on this machine\.", lines[0])
    assert re.search(rf"; {told} left$", lines[1])
    for row, line in zip(("16", "enriched"), lines[2:4], strict=True):
        assert re.fullmatch(rf"{row}: ATE 0\.0\d\d m, 0 loops; {told} left", line)
    assert re.fullmatch(r"64: ATE 0\.0\d\d m, 0 loops", lines[4])


@pytest.fixture
def two_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only 16 channels, and these enriched by ray-segment: the others take longer and change nothing here."""
    monkeypatch.setattr("lidarlift.cli.demo.INPUTS", ("16", "enriched"))
    monkeypatch.setattr("enrichment.methods.onnx_network.has_weights", lambda _: False)


@pytest.mark.usefixtures("two_rows")
def test_full_uses_another_simulation(lidarlift: Command, simulated: list[SimulationConfig], cache: Path) -> None:
    assert lidarlift("demo", "--full").code == 0
    assert simulated == [SimulationConfig(drive="loop")]
    assert not cache.exists()
    assert (cache.parent / "demo-full" / "sequences").is_dir()


def test_quick_and_full_exclude_each_other(lidarlift: Command, simulated: list[SimulationConfig]) -> None:
    result = lidarlift("demo", "--quick", "--full")
    assert result.code == 2
    assert "--full" in result.err
    assert not simulated


@pytest.mark.usefixtures("simulated", "two_rows")
def test_quick_uses_the_start_of_the_same_simulation(
    lidarlift: Command, monkeypatch: pytest.MonkeyPatch, cache: Path
) -> None:
    monkeypatch.setattr("lidarlift.cli.demo.QUICK", 5)
    assert "5 frames" in lidarlift("demo", "--quick").out
    assert len(list(cache.rglob("*.bin"))) == 5
    assert "8 frames" in lidarlift("demo", "--out", "whole").out
    assert len(list(cache.rglob("*.bin"))) == 8
    assert "5 frames" in lidarlift("demo", "--quick").out
    assert read_report(Path("runs/demo/16"))["protocol"]["frames"] == [0, 5, 1]


@pytest.mark.usefixtures("simulated", "two_rows")
def test_an_outdated_simulation_is_replaced(lidarlift: Command, cache: Path) -> None:
    cache.mkdir(parents=True)
    (cache / "simulation.json").write_text("of another version")
    result = lidarlift("demo")
    assert result.code == 0, result.err
    assert not (cache / "simulation.json").exists()


@pytest.mark.usefixtures("simulated")
def test_a_cache_that_cannot_be_replaced_is_an_error(lidarlift: Command, cache: Path) -> None:
    cache.parent.mkdir(parents=True)
    cache.write_text("no folder")
    result = lidarlift("demo")
    assert result.code == 1
    assert f"Error: {cache}: " in result.err


def test_an_unwritable_folder_is_an_error_before_the_simulation(
    lidarlift: Command, simulated: list[SimulationConfig]
) -> None:
    Path("d").write_text("mine")
    lidarlift("demo", "--out", "d").refused("d")
    assert not simulated
