"""`lidarlift train`: drives are packed once, a training goes on where it was, weights come with a card."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from safetensors.numpy import load_file

pytest.importorskip("lightning")

import torch

from enrichment.lift.network import LARGE, SMALL, Lift
from enrichment.networks.export import export_lift, load_lift

Command = Callable[..., Any]
SHORT = ("--steps", 2, "--crop", "48x64", "--device", "cpu")


@pytest.fixture
def seen(street_drive: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> Path:
    """The street drive with images of its right side."""
    monkeypatch.setattr("lidarlift.training.usable_cores", lambda: 1)  # processes would take seconds to start
    sequence = street_drive()
    (sequence / "image_2").mkdir()
    for number in range(8):
        image = np.random.default_rng(number).integers(0, 256, (240, 320, 3)).astype(np.uint8)
        cv2.imwrite(str(sequence / "image_2" / f"{number:06d}.png"), image)
    calibration = (sequence / "calib.txt").read_text().replace("700 0 600 0 0 700 180", "200 0 160 0 0 200 100")
    (sequence / "calib.txt").write_text(calibration)
    return sequence


def test_an_interrupted_training_is_resumed(lidarlift: Command, seen: Path) -> None:
    first = lidarlift("train", "depth", "l2l", seen, "--validate", seen, "--pack", "street.npz", "--out", "t", *SHORT)
    assert first.code == 0, first.err
    assert "l2l: 2 steps, best validation after 2: MAE" in first.out
    assert "Written to t: l2l.onnx, l2l.safetensors, l2l.md" in first.out
    assert {path.name for path in Path("t").iterdir()} >= {"l2l.onnx", "l2l.safetensors", "l2l.md", "logs"}
    card = Path("t/l2l.md").read_text()
    assert "returns of the scan and 5 before and after, placed by ground truth" in card
    assert "lidarlift train depth l2l" in card
    lidarlift("train", "depth", "l2l", "street.npz", "--out", "t", *SHORT).refused("contains a training", "--resume")
    more = ("--validate", seen, "--out", "t", "--resume", *SHORT, "--steps", 3)
    again = lidarlift("train", "depth", "l2l", "street.npz", *more)
    assert again.code == 0, again.err
    assert "l2l: 3 steps" in again.out
    assert "Packing" not in again.err


def test_training_starts_from_weights_and_the_card_names_no_folder(lidarlift: Command, seen: Path) -> None:
    pack, weights = Path.cwd() / "street.npz", Path("first/l2l.safetensors")
    first = lidarlift("train", "depth", "l2l", seen, "--pack", pack, "--out", "first", *SHORT)
    assert first.code == 0, first.err
    second = lidarlift("train", "depth", "l2l", pack, "--start", weights, "--rate", 1e-9, "--out", "second", *SHORT)
    assert second.code == 0, second.err
    learned, kept = (load_file(f"{folder}/l2l.safetensors") for folder in ("first", "second"))
    for name, values in learned.items():
        np.testing.assert_allclose(values, kept[name], atol=1e-6)
    card = Path("second/l2l.md").read_text()
    assert "learning rate up to 1e-09" in card
    assert "street.npz" in card
    assert str(Path.cwd()) not in card
    other = lidarlift("train", "depth", "f2l", pack, "--start", weights, *SHORT)
    assert other.code == 1
    assert "Error: first/l2l.safetensors: not the weights of F2L" in other.err
    both = ("--start", weights, "--resume", "--out", "second")
    lidarlift("train", "depth", "l2l", pack, *both, *SHORT).refused("leave out --start or --resume")


def test_lift_is_trained_and_fine_tuned_on_the_rings_of_a_lidar(lidarlift: Command, seen: Path) -> None:
    first = lidarlift("train", "lift", seen, "--validate", seen, "--out", "t", "--steps", 2, "--batch", 1)
    assert first.code == 0, first.err
    assert "lift: 2 steps, best validation after 2: MAE" in first.out
    assert {path.name for path in Path("t").iterdir()} >= {
        "lift.onnx", "lift_rays.onnx", "lift.safetensors", "lift.md", "logs"
    }  # fmt: skip
    card = Path("t/lift.md").read_text()
    assert "| training | 8 |" in card
    assert "most often every 4th of 64" in card
    own = ("--self-supervised", "--start", "t/lift.safetensors", "--out", "own")
    second = lidarlift("train", "lift", seen, *own, "--steps", 1, "--batch", 1)
    assert second.code == 0, second.err
    card = Path("own/lift.md").read_text()
    assert "no ground truth was used" in card
    assert "learning rate up to 0.0003" in card


def test_lift_learns_from_a_teacher_of_other_sizes(lidarlift: Command, seen: Path) -> None:
    torch.manual_seed(0)
    export_lift(Lift(LARGE), Path(), "teacher")
    command = "train", "lift", seen, "--small", "--teacher", "teacher.safetensors", "--out", "t", "--batch", 1
    first = lidarlift(*command, "--steps", 1)
    assert first.code == 0, first.err
    assert load_lift(Path("t/lift.safetensors")).sizes == SMALL
    assert "the answers of a teacher in addition: `teacher.safetensors`" in Path("t/lift.md").read_text()
    without = lidarlift("train", "lift", seen, "--out", "t", "--batch", 1, "--steps", 2, "--resume")
    assert without.code == 1
    assert "of a training on other data" in without.err
    again = lidarlift(*command, "--steps", 2, "--resume")
    assert again.code == 0, again.err


def test_a_training_has_the_sizes_of_the_weights_it_starts_from(lidarlift: Command, seen: Path) -> None:
    export_lift(Lift(SMALL), Path(), "small")
    started = "train", "lift", seen, "--out", "t", "--batch", 1
    assert lidarlift(*started, "--start", "small.safetensors", "--steps", 1).code == 0
    assert lidarlift(*started, "--resume", "--steps", 2).code == 0
    assert load_lift(Path("t/lift.safetensors")).sizes == SMALL
    export_lift(Lift(LARGE), Path(), "large")
    other = "train", "lift", seen, "--out", "u", "--small", "--start", "large.safetensors"
    lidarlift(*other).refused("--small: large.safetensors has the weights of a larger network")


@pytest.mark.parametrize(
    "arguments",
    [("lift", "d", "--pack", "p.npz"), ("lift", "d", "--crop", "48x64"), ("depth", "l2l", "d", "--self-supervised")],
)
def test_options_of_the_other_network_are_usage_errors(lidarlift: Command, arguments: tuple[str, ...]) -> None:
    result = lidarlift("train", *arguments)
    assert result.code == 2
    assert "No such option" in result.err


def test_epochs_and_steps_exclude_each_other(lidarlift: Command) -> None:
    for command in (("lift", "d"), ("depth", "l2l", "d")):
        result = lidarlift("train", *command, "--epochs", 1, "--steps", 1)
        assert result.code == 2
        assert "replaces --epochs" in " ".join(result.err.replace("│", " ").split())


def test_lift_refuses_packs(lidarlift: Command, tmp_path: Path) -> None:
    (tmp_path / "some.npz").touch()
    lidarlift("train", "lift", "some.npz").refused("some.npz: is a file, not a folder with scans")


def test_errors_are_one_line(lidarlift: Command, seen: Path) -> None:
    lidarlift("train", "depth", "l3l", seen).refused("unknown network 'l3l'", "did you mean 'l2l'?")
    lidarlift("train", "depth", "l2l", seen, "--crop", "large").refused("--crop large", "HEIGHTxWIDTH")
    lidarlift("train", "depth", "l2l", seen, "--out", "new", "--resume").refused(
        "checkpoint.safetensors", "no training to resume"
    )
    lidarlift("train", "depth", "l2l", "none.npz").refused("none.npz: no such file")
    lidarlift("train", "depth", "l2l", seen.parent / "nowhere").refused("no such folder")
    lidarlift("train", "depth", "l2l", seen, "--poses", "a", "--poses", "b").refused("2 files for 1 sequences")
    (seen.parent / "78" / "velodyne").mkdir(parents=True)
    lidarlift("train", "depth", "l2l", seen.parent).refused("several sequences", "the folder of each")
    large = lidarlift("train", "depth", "l2l", seen, "--crop", "200x64", "--pack", "street.npz")
    assert large.code == 1
    assert large.err.endswith("images of 120x160 at scale 0.5; choose a --crop that is not larger\n")
    lidarlift("train", "depth", "l2l", "street.npz", "--scale", 1).refused("packed at scale 0.5", "--scale 0.5")


def test_a_missing_gpu_is_an_error(lidarlift: Command, seen: Path) -> None:
    import torch

    if torch.cuda.is_available() or torch.backends.mps.is_available():
        pytest.skip("there is one")
    result = lidarlift("train", "depth", "l2l", seen, "--crop", "48x64", "--device", "gpu")
    assert result.code == 1
    assert "Error: --device gpu: PyTorch finds no such device" in result.err.splitlines()[-1]
