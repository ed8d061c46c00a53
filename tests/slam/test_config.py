"""Presets, files and overrides, and the errors of invalid ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from slam.config import RENAMED_SETTINGS, load_config
from slam.data.errors import InputError
from slam.preset_files import preset_names
from slam.settings import Config


def written(folder: Path, text: str) -> Path:
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def refusal(source: str | Path | None = None, *overrides: str, **front_end: object) -> str:
    with pytest.raises(InputError) as error:
        load_config(source, overrides, **front_end)
    return str(error.value)


def test_without_arguments_settings_are_the_defaults() -> None:
    assert load_config() == Config()
    assert load_config().front_end.input == "64"


def test_all_presets_load() -> None:
    assert {"icp", "paper", "scan-to-scan"} <= set(preset_names())
    for name in preset_names():
        assert isinstance(load_config(name), Config)


def test_presets_begin_with_a_comment() -> None:
    icp, scan = load_config("icp").odometry, load_config("scan-to-scan").odometry
    assert (icp.registration, icp.target) == ("icp-point-to-plane", "scan")
    assert (scan.registration, scan.target, scan.neighbours) == ("ndt", "scan", 7)
    paper = load_config("paper")
    assert paper.front_end.input == "16"
    assert paper.front_end.ring_selection == "average-pool"
    sparse = {"min_points": 3, "regularisation": 0.01}  # sixteen rings fill cells slowly
    assert paper.odometry == scan.model_copy(update=sparse)  # else NDT is the paper's in both


@pytest.mark.parametrize("name", ["64", "16", "enriched"])
def test_the_input_changes_no_other_settings(tmp_path: Path, name: str) -> None:
    config = load_config(input=name)
    assert config.front_end.input == name
    assert config.odometry == Config().odometry
    assert config == load_config(written(tmp_path, f"front_end: {{input: '{name}'}}\n"))


@pytest.mark.parametrize("name", ["16", "enriched"])
def test_a_removed_preset_names_its_replacement(name: str) -> None:
    assert f"--input {name}" in refusal(f"channels-{name}")


@pytest.mark.parametrize("key", ["odometry.unseen_tilt_deg", "pose_graph.held_back"])
def test_a_removed_setting_is_an_error(tmp_path: Path, key: str) -> None:
    section, name = key.split(".")
    for message in (refusal(None, f"{key}=1"), refusal(written(tmp_path, f"{section}: {{{name}: 1}}\n"))):
        assert f"'{key}' was removed; leave it out" in message
        assert "\n" not in message


@pytest.mark.parametrize(("old", "new"), RENAMED_SETTINGS.items())
def test_a_renamed_setting_is_an_error_with_the_new_name(tmp_path: Path, old: str, new: str) -> None:
    value: object = 1
    for name in reversed(old.split(".")):
        value = {name: value}
    for message in (refusal(None, f"{old}=1"), refusal(written(tmp_path, yaml.safe_dump(value)))):
        assert f"'{old}' was renamed; use '{new}'" in message
    default: Any = load_config()
    for name in new.split("."):
        default = getattr(default, name)
    load_config(None, [f"{new}={default}"])


def test_keywords_override_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, "front_end: {input: '16', phase: 2}\n")
    assert load_config(path, input="64").front_end.input == "64"
    assert load_config(path, input=None).front_end.input == "16"
    assert load_config(path, input="64").front_end.phase == 2


def test_overrides_override_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, "odometry: {voxel_size: 0.7, kernel_scale: 2.0}\nmap: {max_range: 50}\n")
    config = load_config(path, ["odometry.voxel_size=0.9", "odometry.cell_sizes=[4, 2, 1]", "map.voxel_size=0.3"])
    assert config.odometry.voxel_size == 0.9
    assert config.odometry.kernel_scale == 2.0
    assert config.odometry.cell_sizes == (4.0, 2.0, 1.0)
    assert config.map.voxel_size == 0.3
    assert config.map.max_range == 50


def test_an_empty_file_gives_the_defaults(tmp_path: Path) -> None:
    assert load_config(written(tmp_path, "# nothing yet\n")) == Config()


def test_settings_are_immutable() -> None:
    with pytest.raises(ValueError):
        load_config().odometry.voxel_size = 3.0  # type: ignore[misc]


@pytest.mark.parametrize(
    ("text", "right"),
    [
        ("odometry: {voxelsize: 1}", "'odometry.voxel_size'"),
        ("odometry: {neighbors: 7}", "'odometry.neighbours'"),
        ("odometri: {voxel_size: 1}", "'odometry'"),
        ("front_end: {fase: 1}", "'front_end.phase'"),
        ("map: {max_rnage: 1}", "'map.max_range'"),
        ("mapp: {max_range: 1}", "'map'"),
        ("max_position_sigma: 1", "'odometry.max_position_sigma'"),
    ],
)
def test_an_unknown_key_names_the_most_similar_one(tmp_path: Path, text: str, right: str) -> None:
    message = refusal(written(tmp_path, text))
    assert message.endswith(f"did you mean {right}?")
    assert "mine.yaml" in message


def test_an_unknown_key_in_an_override_names_the_most_similar_one() -> None:
    assert "'odometry.kernel_scale'" in refusal(None, "odometry.kernel_scal=2")


@pytest.mark.parametrize(
    ("override", "key"),
    [
        ("odometry.voxel_size=-1", "odometry.voxel_size"),
        ("odometry.voxel_size=wide", "odometry.voxel_size"),
        ("odometry.neighbours=6", "odometry.neighbours"),
        ("odometry.registration=gicp", "odometry.registration"),
        ("odometry.min_points=2", "odometry.min_points"),
        ("odometry.min_inlier_ratio=1.5", "odometry.min_inlier_ratio"),
        ("odometry.cell_sizes=[1.0, 2.0]", "odometry.cell_sizes"),
        ("odometry.cell_sizes=[]", "odometry.cell_sizes"),
        ("odometry.cell_sizes=[1.0, 0]", "odometry.cell_sizes"),
        ("odometry.min_range=90", "odometry.min_range"),
        ("front_end.phase=4", "front_end.phase"),
        ("front_end.ring_selection=every-3rd", "front_end.ring_selection"),
    ],
)
def test_an_invalid_value_is_an_error(override: str, key: str) -> None:
    assert key in refusal(None, override)


def test_an_unknown_input_is_an_error() -> None:
    for wrong in ("sparse", "1", "-16", "1.5", ""):
        assert "front_end.input" in refusal(input=wrong)


def test_icp_requires_scan_to_scan() -> None:
    override = "odometry.registration=icp-point-to-plane"
    assert "odometry.target=scan" in refusal(None, override)
    assert load_config(None, [override, "odometry.target=scan"]).odometry.registration == "icp-point-to-plane"


@pytest.mark.parametrize("override", ["odometry.voxel_size", "odometry.voxel_size=", "=", ""])
def test_a_malformed_override_is_an_error(override: str) -> None:
    assert "section.key=value" in refusal(None, override)


@pytest.mark.parametrize("text", ["odometry: [1", "odometry: {a: b", "\tseed: 1"])
def test_invalid_yaml_is_an_error(tmp_path: Path, text: str) -> None:
    message = refusal(written(tmp_path, text))
    assert "not YAML" in message
    assert "\n" not in message


def test_binary_files_are_an_error(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_bytes(b"\xff\xfe\x00\x80")
    assert "not YAML" in refusal(path)


def test_yaml_without_sections_is_an_error(tmp_path: Path) -> None:
    assert "sections" in refusal(written(tmp_path, "- 1\n- 2\n"))
    assert "is a section" in refusal(written(tmp_path, "odometry: 1\n"))


def test_a_missing_file_lists_the_presets(tmp_path: Path) -> None:
    message = refusal(tmp_path / "missing.yaml")
    assert "missing.yaml" in message
    assert "scan-to-scan" in message


@pytest.mark.parametrize("text", ["odometry:\n", "odometry: 1\n"])
def test_an_override_of_an_unknown_section_is_an_error(tmp_path: Path, text: str) -> None:
    assert "odometry" in refusal(written(tmp_path, text), "odometry.kernel_scale=2")


def test_an_override_below_a_value_is_an_error() -> None:
    assert "kernel" in refusal(None, "odometry.kernel_scale=1", "odometry.kernel_scale.x=2")


def test_an_override_with_invalid_yaml_is_an_error() -> None:
    assert "odometry.kernel_scale" in refusal(None, "odometry.kernel_scale=[1")


def test_input_16_may_be_unquoted(tmp_path: Path) -> None:
    assert load_config(written(tmp_path, "front_end: {input: 16}\n")).front_end.input == "16"
    assert load_config(None, ["front_end.input=16"]).front_end.input == "16"
