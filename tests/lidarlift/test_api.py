"""The Python API, `import lidarlift`."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import lidarlift
from slam.data.cloud import Array

Drive = Callable[..., Path]
HEAVY = "{'numpy', 'scipy', 'numba', 'cv2', 'open3d', 'gtsam', 'evo', 'matplotlib', 'onnxruntime', 'torch', 'pydantic'}"


def test_importing_lidarlift_imports_no_computing_modules() -> None:
    program = f"import sys, lidarlift; print(*{HEAVY} & set(sys.modules))"
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, check=True).stdout == b"\n"


def test_every_public_name_can_be_imported() -> None:
    for name in lidarlift.__all__:
        assert getattr(lidarlift, name) is not None
    assert set(lidarlift.__all__) <= set(dir(lidarlift))
    assert lidarlift.__version__[0].isdigit()


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="'lidarlift' has no attribute 'slam_dunk'"):
        _ = lidarlift.slam_dunk


def test_run_with_ray_segment(street_drive: Drive, street_poses: Array, tmp_path: Path) -> None:
    run = lidarlift.run(street_drive(), input="enriched", enricher="ray-segment", out=tmp_path / "run")
    assert np.linalg.norm(run.poses[:, :3, 3] - street_poses[:, :3, 3], axis=1).max() < 0.2
    assert run.records[0].points > 2 * 16 * 600
    assert len(run.map) > 10_000
    assert (tmp_path / "run" / "run.json").is_file()
    metrics = lidarlift.evaluate(tmp_path / "run")
    assert metrics.frames == 8
    assert metrics.ate.aligned.rmse < 0.05


def test_run_writes_nothing_without_out(street_drive: Drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, here = street_drive(), tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    run = lidarlift.run(lidarlift.open_dataset(path), frames=slice(3))
    assert len(run.poses) == 3
    assert list(here.iterdir()) == []


def test_complete_settings_exclude_other_settings(street_drive: Drive) -> None:
    path, config = street_drive(), lidarlift.load_config(input="16")
    assert lidarlift.run(path, config=config, frames=slice(2)).records[0].points == 16 * 600
    with pytest.raises(ValueError, match="config already contains all settings"):
        lidarlift.run(path, config=config, input="64")


def test_an_enricher_without_enriched_input_is_an_error(street_drive: Drive) -> None:
    with pytest.raises(lidarlift.InputError, match="not enriched without --input enriched"):
        lidarlift.run(street_drive(), enricher="ray-segment")


def test_enrich_yields_enriched_clouds(street_drive: Drive) -> None:
    pairs = list(lidarlift.enrich(street_drive(), enricher="ray-segment", frames=slice(2)))
    assert [frame.index for frame, _ in pairs] == [0, 1]
    for _, cloud in pairs:
        assert cloud.measured.sum() == 16 * 600
        predicted = cloud.select(~cloud.measured)
        assert len(predicted) > 16 * 600
        assert (predicted.sigma > 0).all()


def test_enrich_raises_at_once_if_no_frames_are_selected(street_drive: Drive) -> None:
    with pytest.raises(lidarlift.InputError, match="no frames in that range"):
        lidarlift.enrich(street_drive(), frames=slice(9, 20))


def test_three_inputs_are_compared(street_drive: Drive, tmp_path: Path) -> None:
    comparison = lidarlift.compare(street_drive(), tmp_path / "compared", enricher="ray-segment")
    assert list(comparison.inputs) == ["16", "enriched", "64"]
    assert (tmp_path / "compared" / "compare.json").is_file()
    assert (tmp_path / "compared" / "64" / "map.pcd").is_file()


def test_evaluating_a_folder_without_ground_truth_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(lidarlift.InputError, match="no ground truth found; give a reference file"):
        lidarlift.evaluate(tmp_path)


def test_ignored_arguments_are_value_errors(street_drive: Drive, tmp_path: Path) -> None:
    drive = lidarlift.open_dataset(street_drive())
    for function in (lidarlift.run, lidarlift.enrich):
        with pytest.raises(ValueError, match="pass sequence and sensor to open_dataset"):
            function(drive, sensor="vlp16")
    with pytest.raises(ValueError, match="give a reference or leave calib out"):
        lidarlift.evaluate(tmp_path, calib="calib.txt")


def test_settings_name_the_enricher_that_is_used(street_drive: Drive, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("enrichment.methods.onnx_network.has_weights", lambda _: False)
    run = lidarlift.run(street_drive(), config=lidarlift.load_config(input="enriched"), frames=slice(2))
    assert run.config.front_end.enricher == "ray-segment"
