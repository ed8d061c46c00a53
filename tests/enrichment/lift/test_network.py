"""Lift: between its candidates, the same wherever the columns begin, and the same in both of its files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from onnxruntime import InferenceSession
from torch import Tensor

from enrichment.lift.channels import CANDIDATES, RAYS, RINGS, Candidate, Ray
from enrichment.lift.loss import lift_loss, teaching_loss
from enrichment.lift.network import LARGE, RESIDUAL, SMALL, Lift, Sizes
from enrichment.networks.export import export_lift, load_lift
from slam.data.errors import InputError


def made(sizes: Sizes = LARGE) -> Lift:
    torch.manual_seed(0)
    network = Lift(sizes).eval()
    with torch.no_grad():
        for parameter in network.parameters():
            parameter += 0.02 * torch.randn(parameter.shape)
    return network


def example(rings: int = 4, rows: int = 6, columns: int = 96) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Rings, upper, rays and candidates; a ray in five has none."""
    generator = torch.Generator().manual_seed(1)
    rays = torch.rand(1, RAYS, rows, columns, generator=generator)
    candidates = 5 + 40 * torch.rand(1, CANDIDATES, rows, columns, generator=generator)
    known = (torch.rand(1, 1, rows, columns, generator=generator) > 0.2).float()
    rays, candidates = rays * known, candidates * known
    rays[:, Ray.KNOWN], candidates[:, Candidate.EDGE :] = known[:, 0], 0
    return (
        torch.rand(1, RINGS, rings, columns, generator=generator), torch.arange(rows) % (rings - 1), rays,
        candidates,
    )  # fmt: skip


def test_lift_is_small() -> None:
    assert sum(p.numel() for p in Lift().parameters()) < 3_000_000


def test_ranges_are_between_the_candidates() -> None:
    given = example()
    with torch.no_grad():
        answer = made()(*given)
    known = given[2][:, Ray.KNOWN] > 0
    some = given[3][:, :5]
    low, high = some.amin(dim=1), some.amax(dim=1)
    assert (answer.ranges[known] >= (1 - RESIDUAL) * low[known]).all()
    assert (answer.ranges[known] <= (1 + RESIDUAL) * high[known]).all()
    assert (answer.scale[known] > 0).all()


@pytest.mark.parametrize("sizes", [SMALL, LARGE])
@pytest.mark.parametrize("turn", [8, 16, 24])
def test_predictions_rotate_with_the_lidar(turn: int, sizes: Sizes) -> None:
    rings, upper, rays, candidates = example()
    network = made(sizes)
    with torch.no_grad():
        one = network(rings, upper, rays, candidates)
        other = network(rings.roll(turn, -1), upper, rays.roll(turn, -1), candidates.roll(turn, -1))
    known = rays[:, Ray.KNOWN] > 0
    torch.testing.assert_close(one.ranges[known], other.ranges.roll(-turn, -1)[known], rtol=1e-3, atol=0)
    torch.testing.assert_close(one.scale[known], other.scale.roll(-turn, -1)[known], rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("sizes", [SMALL, LARGE])
def test_onnx_agrees_with_torch_for_any_lidar(sizes: Sizes, tmp_path: Path) -> None:
    network = made(sizes)
    export_lift(network, tmp_path)
    over_rings, along_rays = (InferenceSession(tmp_path / f"{name}.onnx") for name in ("lift", "lift_rays"))
    again = load_lift(tmp_path / "lift.safetensors")
    assert again.sizes == sizes
    for shape in ((4, 6, 96), (16, 45, 128), (3, 1, 104)):
        given = example(*shape)
        with torch.no_grad():
            expected, same = network(*given), again(*given)
        torch.testing.assert_close(expected.ranges, same.ranges)
        rings, *rest = (one.numpy() for one in given)
        (between,) = over_rings.run(None, {"rings": rings})
        names = [entry.name for entry in along_rays.get_inputs()]
        ranges, scale, valid = along_rays.run(None, dict(zip(names, (between, *rest), strict=True)))
        for found, wanted in ((ranges, expected.ranges), (scale, expected.scale), (valid, expected.valid)):
            np.testing.assert_allclose(found, wanted.numpy(), rtol=1e-4, atol=1e-3)


def test_training_reduces_the_loss() -> None:
    rings, upper, rays, candidates = example()
    truth = candidates[:, Candidate.BELOW] * 1.01
    network = Lift().train()
    optimizer, losses = torch.optim.Adam(network.parameters(), 3e-3), []
    for _ in range(30):
        answer = network(rings, upper, rays, candidates)
        loss = lift_loss(answer, rays, candidates, truth)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < losses[0] - 0.3
    weights = torch.softmax(answer.logits, dim=1)
    assert weights[:, Candidate.BELOW][truth > 0].mean() > 0.5  # the right candidate


def test_without_targets_the_loss_is_zero() -> None:
    rings, upper, rays, candidates = example()
    answer = Lift()(rings, upper, rays, candidates)
    assert lift_loss(answer, rays, candidates, torch.zeros_like(rays[:, Ray.KNOWN])) == 0


def test_a_small_network_learns_the_answers_of_a_large_one() -> None:
    """Without any target: also where the reference has no return."""
    given = example()
    teacher = made(LARGE)
    with torch.no_grad():
        taught = teacher(*given)
    least = teaching_loss(taught, taught, *given[2:]).item()
    network = Lift(SMALL).train()
    optimizer, losses = torch.optim.Adam(network.parameters(), 3e-3), []
    for _ in range(30):
        loss = teaching_loss(network(*given), taught, *given[2:])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] - least < 0.5 * (losses[0] - least)


def test_an_answer_like_the_teachers_costs_least() -> None:
    given = example()
    with torch.no_grad():
        taught, other = made(LARGE)(*given), made(SMALL)(*given)
    likeness = teaching_loss(taught, taught, *given[2:])
    assert likeness < teaching_loss(other, taught, *given[2:])
    entropy = torch.nn.functional.binary_cross_entropy_with_logits(taught.valid, taught.valid.sigmoid())
    assert 0 < likeness < 2 * entropy  # what is left is the teacher's own doubt whether there is a return


def test_other_weights_are_an_error(tmp_path: Path) -> None:
    torch.save({}, tmp_path / "lift.safetensors")
    with pytest.raises(InputError, match="not the weights of Lift"):
        load_lift(tmp_path / "lift.safetensors")
