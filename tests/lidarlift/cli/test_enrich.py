"""`lidarlift enrich`: clouds on disk."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
import pytest

Command = Callable[..., Any]
QUICK = ("--enricher", "ray-segment")


@pytest.mark.parametrize("suffix", ["pcd", "ply"])
def test_every_point_with_ring_sigma_and_whether_it_was_measured(
    lidarlift: Command, street_drive: Callable[..., Path], suffix: str
) -> None:
    result = lidarlift("enrich", street_drive(), "--out", "e", "--frames", "0:2", "--format", suffix, *QUICK)
    assert result.code == 0, result.err
    assert sorted(path.name for path in Path("e").iterdir()) == [f"000000.{suffix}", f"000001.{suffix}"]
    points = o3d.t.io.read_point_cloud(f"e/000000.{suffix}").point
    measured = points["measured"].numpy()[:, 0].astype(bool)
    assert 0 < measured.sum() < len(measured) / 2
    assert (points["sigma"].numpy()[measured] == np.float32(0.02)).all()
    assert np.median(points["sigma"].numpy()[~measured]) > 0.02
    assert (points["ring"].numpy()[measured] % 4 == 0).all()
    assert "2 scans" in result.out


def test_bin_as_kitti_has_it(lidarlift: Command, street_drive: Callable[..., Path]) -> None:
    assert lidarlift("enrich", street_drive(), "--out", "e", "--frames", "0:1", "--format", "bin", *QUICK).code == 0
    table = np.fromfile("e/000000.bin", "<f4").reshape(-1, 4)
    assert len(table) > 10_000
    assert np.isfinite(table).all()


def test_coverage(lidarlift: Command, street_drive: Callable[..., Path]) -> None:
    sizes, path = [], street_drive()
    for share in ("1.0", "0.5"):
        lidarlift("enrich", path, "--out", share, "--frames", "0:1", "--set", f"front_end.coverage={share}", *QUICK)
        sizes.append(len(o3d.t.io.read_point_cloud(f"{share}/000000.pcd").point["positions"]))
    assert sizes[1] < 0.75 * sizes[0]


def test_no_frames(lidarlift: Command, street_drive: Callable[..., Path]) -> None:
    lidarlift("enrich", street_drive(), "--out", "e", "--frames", "50:60").refused("no frames in that range")


def test_a_network_without_an_image_gives_way_and_says_so(
    lidarlift: Command, street_drive: Callable[..., Path], caplog: pytest.LogCaptureFixture
) -> None:
    path = street_drive()
    result = lidarlift("enrich", path, "--out", "f", "--frames", "0:2", "--enricher", "f2l")
    assert result.code == 0, result.err
    assert caplog.text.count("ray-segment interpolation is used instead") == 1
    lidarlift("enrich", path, "--out", "r", "--frames", "0:2", *QUICK)
    assert Path("f/000001.pcd").read_bytes() == Path("r/000001.pcd").read_bytes()


@pytest.mark.parametrize("command", [("run", "--input", "enriched"), ("enrich",), ("compare",)])
def test_a_wrong_enricher_is_refused_before_any_work(
    lidarlift: Command, street_drive: Callable[..., Path], command: tuple[str, ...]
) -> None:
    name, *options = command
    result = lidarlift(name, street_drive(), *options, "--enricher", "ray-segments", "--out", "o")
    result.refused("unknown enrichment method 'ray-segments'", "did you mean 'ray-segment'?")
    assert not result.out
    assert not Path("o").exists()


def test_a_broken_package_is_named(
    lidarlift: Command, street_drive: Callable[..., Path], installed: Callable[[str, str, dict[str, str]], object]
) -> None:
    installed("my-enricher", "[lidarlift.methods]\nmine = my_enricher:Mine\n", {"my_enricher.py": "import no_such"})
    result = lidarlift("compare", street_drive(), "--enricher", "mine", "--out", "o")
    result.refused("'mine' of the package my-enricher cannot be loaded", "No module named 'no_such'")
    assert not Path("o").exists()


def test_help_lists_the_enrichers(lidarlift: Command) -> None:
    words = " ".join(lidarlift("enrich", "--help").out.replace("│", " ").split())
    for name in ("lift", "ray-segment", "joint", "ip-basic", "f2l"):
        assert name in words
