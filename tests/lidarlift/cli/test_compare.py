"""`lidarlift compare`: comparison of run folders; and `run --input enriched`."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lidarlift.comparing import INPUTS, rows_for
from slam.data.point_files import read_points
from slam.session import read_report

Command = Callable[..., Any]


QUICK = ("--enricher", "ray-segment")


def test_three_inputs_are_compared(lidarlift: Command, street_drive: Callable[..., Path]) -> None:
    result = lidarlift("compare", street_drive(), "--out", "c", "--frames", "0:5", *QUICK)
    assert result.code == 0, result.err
    assert sorted(path.name for path in Path("c").iterdir()) == ["16", "64", "compare.json", "compare.md", "enriched"]
    inputs = json.loads(Path("c/compare.json").read_text())["inputs"]
    assert list(inputs) == ["16", "enriched", "64"]
    for channels, figures in inputs.items():
        assert read_report(Path("c") / channels)["protocol"]["input"] == channels
        assert figures["frames"] == 5
        assert figures["ate_m"] < 0.1
    assert "Table III" in result.out
    assert "5 frames, enriched by ray-segment" in result.out


def test_ray_segment_gets_a_row_next_to_another_enricher(lidarlift: Command, street_drive: Callable[..., Path]) -> None:
    result = lidarlift("compare", street_drive(), "--out", "c", "--frames", "0:3", "--enricher", "joint")
    assert result.code == 0, result.err
    assert list(json.loads(Path("c/compare.json").read_text())["inputs"]) == ["16", "ray-segment", "enriched", "64"]
    for row, enricher in (("ray-segment", "ray-segment"), ("enriched", "joint")):
        assert enricher_of(Path("c") / row) == enricher
    assert "3 frames, enriched by joint" in result.out


def test_ray_segment_is_the_default_enricher(lidarlift: Command, street_drive: Callable[..., Path]) -> None:
    sequence = street_drive()
    for name, words in {"ray-segment": "", "lift": "--enricher lift"}.items():
        result = lidarlift("run", sequence, "--input", "enriched", *words.split(), "--out", name, "--frames", "0:2")
        assert result.code == 0
        assert enricher_of(Path(name)) == name


@pytest.mark.parametrize("there", [True, False])
def test_a_network_without_weights_is_replaced_by_ray_segment(there: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("enrichment.methods.onnx_network.has_weights", lambda _: there)
    assert list(rows_for(INPUTS, "lift")) == ["16", *(["ray-segment"] if there else []), "enriched", "64"]


def test_run_json_names_the_enricher_that_was_used(
    lidarlift: Command,
    street_drive: Callable[..., Path],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Without the weights ray-segment does, and nothing is called Lift's."""
    monkeypatch.setattr("enrichment.methods.onnx_network.has_weights", lambda _: False)
    options = "--input", "enriched", "--enricher", "lift", "--out", "r", "--frames", "0:2"
    assert lidarlift("run", street_drive(), *options).code == 0
    assert enricher_of(Path("r")) == "ray-segment"
    assert [record.getMessage() for record in caplog.records] == [
        "lift: the weights are not installed; ray-segment is used instead"
    ]


def test_a_16_ring_sensor_has_no_row_64(lidarlift: Command, street_drive: Callable[..., Path]) -> None:
    folder = own_folder(street_drive())
    result = lidarlift("compare", folder, "--out", "c", "--frames", "0:3", *QUICK)
    assert result.code == 0, result.err
    assert sorted(path.name for path in Path("c").iterdir()) == ["16", "compare.json", "compare.md", "enriched"]
    points = {name: read_points(Path("c") / name / "map.pcd").xyz for name in ("16", "enriched")}
    assert len(points["enriched"]) > 1.5 * len(points["16"])


def test_enrichment_without_laser_lines_is_an_error(lidarlift: Command, street_drive: Callable[..., Path]) -> None:
    folder = own_folder(street_drive())
    (folder / "sensor.yaml").unlink()
    lidarlift("run", folder, "--input", "enriched").refused("laser lines", "--sensor")


def test_an_unwritable_folder_is_an_error(lidarlift: Command, street_drive: Callable[..., Path]) -> None:
    Path("file").write_text("")
    lidarlift("compare", street_drive(), "--out", "file").refused("file")


def enricher_of(run: Path) -> str:
    return str(read_report(run)["protocol"]["config"]["front_end"]["enricher"])


def own_folder(sequence: Path) -> Path:
    """Sixteen rings of the drive's scans, as a folder of one's own."""
    from slam.data.dataset import open_dataset
    from slam.data.point_writer import write_points
    from slam.data.ring_patterns import drop_rings

    folder, data = Path("own"), open_dataset(sequence)
    assert data.sensor is not None
    for position in range(3):
        cloud = drop_rings(data[position].cloud)
        assert cloud.ring is not None
        write_points(folder / f"{position:03d}.ply", cloud, {"ring": (cloud.ring // 4).astype(np.int32)})
    beams = np.column_stack([np.rad2deg(data.sensor.elevation), data.sensor.offset])[::4]
    (folder / "sensor.yaml").write_text(f"model: mine\nbeams: {beams.round(5).tolist()}\n")
    return folder
