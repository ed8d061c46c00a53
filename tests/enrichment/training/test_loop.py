"""Training: the same seed gives the same weights, whether it was broken off or not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from enrichment.training.checkpoint import BEST, CHECKPOINT, Checkpoint, Figures, read_checkpoint
from enrichment.training.image_examples import Example
from enrichment.training.image_task import ImageTask, errors
from enrichment.training.loop import Training, train
from enrichment.training.pack import Pack
from enrichment.training.plan import RATE, Plan
from enrichment.training.results import write_results
from slam.data.errors import InputError

PLAN = Plan("tiny", steps=5, crop=(16, 32), batch=2, validate_every=2)
Known = Callable[..., None]


def trained(plan: Plan, pack: Pack, out: Path, resume: bool = False, validate: bool = True) -> Checkpoint:
    training = Training(plan, ImageTask([pack], [pack] if validate else []), out)
    if resume:
        training.resume()
    train(training, "cpu")
    return read_checkpoint(out / CHECKPOINT)


def equal(one: Checkpoint, other: Checkpoint) -> bool:
    return one.tensors.keys() == other.tensors.keys() and all(
        torch.equal(tensor, other.tensors[name]) for name, tensor in one.tensors.items()
    )


def test_a_resumed_training_equals_an_uninterrupted_one(pack: Pack, tmp_path: Path, tiny: Known) -> None:
    tiny()
    whole = trained(PLAN, pack, tmp_path / "whole")
    tiny(4)
    with pytest.raises(RuntimeError, match="power failure"):
        trained(PLAN, pack, tmp_path / "broken")
    assert read_checkpoint(tmp_path / "broken" / CHECKPOINT).step == 2
    tiny()
    resumed = trained(PLAN, pack, tmp_path / "broken", resume=True)
    assert whole.step == resumed.step == 5
    assert whole.best == resumed.best
    assert equal(whole, resumed)


def test_weights_depend_on_the_seed(pack: Pack, tmp_path: Path, tiny: Known) -> None:
    tiny()
    plan = replace(PLAN, steps=2)
    first = trained(plan, pack, tmp_path / "a", validate=False)
    torch.rand(5)
    assert equal(first, trained(plan, pack, tmp_path / "b", validate=False))
    assert not equal(first, trained(replace(plan, seed=1), pack, tmp_path / "c", validate=False))


def test_bfloat16_is_close_to_single_precision(pack: Pack, tmp_path: Path, tiny: Known) -> None:
    tiny()
    plan = replace(PLAN, steps=2)
    whole = trained(plan, pack, tmp_path / "whole")
    half = trained(replace(plan, bf16=True), pack, tmp_path / "half")
    assert not equal(whole, half)
    for name, weights in half.weights.items():
        assert weights.dtype == whole.weights[name].dtype
        torch.testing.assert_close(weights, whole.weights[name], atol=0.02, rtol=0.05)
    with pytest.raises(InputError, match="another bf16"):
        trained(plan, pack, tmp_path / "half", resume=True)


def test_training_writes_weights_and_card(
    pack: Pack, tmp_path: Path, tiny: Known, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("enrichment.training.loop.LOG_EVERY", 1)
    tiny()
    losses: list[float] = []
    training = Training(PLAN, ImageTask([pack], [pack]), tmp_path / "out", on_step=losses.append)
    train(training, "cpu")
    best = write_results(training, "lidarlift train tiny street")
    assert len(losses) == 5
    assert best is not None
    assert 0 < best.mae <= best.rmse
    kept = read_checkpoint(tmp_path / "out" / BEST)
    assert kept.best == best
    assert kept.step == best.step
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {BEST, CHECKPOINT, "logs", "tiny.onnx", "tiny.safetensors", "tiny.md"}
    card = (tmp_path / "out" / "tiny.md").read_text()
    assert "| street | training | 3 | returns of the scan and 1 before and after, placed by ground truth |" in card
    assert "lidarlift train tiny street" in card
    assert f"MAE {1000 * best.mae:.0f} mm" in card
    assert "non-commercial" not in card
    table = next((tmp_path / "out" / "logs").glob("csv/*/metrics.csv")).read_text().splitlines()
    assert table[0] == "loss,mae,rmse,step"
    rows = [line.split(",") for line in table[1:]]
    assert [step for loss, _, _, step in rows if loss] == ["0", "1", "2", "3", "4"]
    assert [step for _, mae, rmse, step in rows if mae and rmse] == ["2", "4", "5"]
    assert list((tmp_path / "out" / "logs").glob("tensorboard/*/events.*"))


def test_weights_trained_on_kitti_are_non_commercial(pack: Pack, tmp_path: Path, tiny: Known) -> None:
    tiny()
    training = Training(replace(PLAN, steps=1), ImageTask([pack], []), tmp_path / "out")
    train(training, "cpu")
    pack.sequences = (replace(pack.sequences[0], licence="KITTI, CC BY-NC-SA 3.0"),)
    assert write_results(training, "") is None
    card = " ".join((tmp_path / "out" / "tiny.md").read_text().split())
    assert "CC BY-NC-SA 3.0: these weights are for non-commercial use only" in card
    assert "no validation" in card


def test_a_checkpoint_of_another_training_is_an_error(pack: Pack, tmp_path: Path, tiny: Known) -> None:
    tiny()
    trained(replace(PLAN, steps=1), pack, tmp_path)
    with pytest.raises(InputError, match=r"another seed; use the same"):
        trained(replace(PLAN, seed=1), pack, tmp_path, resume=True)
    with pytest.raises(InputError, match=r"on other data"):
        trained(PLAN, pack, tmp_path, resume=True, validate=False)
    (tmp_path / CHECKPOINT).write_bytes(b"else")
    with pytest.raises(InputError, match=r"not a checkpoint"):
        trained(PLAN, pack, tmp_path, resume=True)


def test_errors_exclude_cells_with_input() -> None:
    def image(*values: float) -> torch.Tensor:
        return torch.tensor(values, dtype=torch.float32)[None, None, None]

    batch = Example(torch.zeros(1, 3, 1, 4), image(0, 5, 0, 0), image(4, 5, 0, 6))
    mae, rmse = errors(image(5, 9, 9, 3), batch)
    assert (float(mae), float(rmse)) == pytest.approx((2, 5**0.5))


def test_the_learning_rate_warms_up_and_decays() -> None:
    plan = Plan("tiny", steps=1000)
    assert [plan.rate_at(step) / RATE for step in (0, 99, 100, 550)] == pytest.approx([0.01, 1, 1, 0.5])
    assert 0 < plan.rate_at(999) < 1e-5 * RATE
    assert Plan("tiny", steps=1).rate_at(0) == RATE


def test_figures_are_restored_from_a_checkpoint(tmp_path: Path) -> None:
    checkpoint = Checkpoint(PLAN, "data", 3, Figures(2, 0.5, 1.5), {"network.a": torch.ones(2)})
    checkpoint.write(tmp_path / "a.safetensors")
    again = read_checkpoint(tmp_path / "a.safetensors")
    assert (again.plan, again.data, again.step, again.best) == (PLAN, "data", 3, Figures(2, 0.5, 1.5))
    assert torch.equal(again.weights["a"], torch.ones(2))
