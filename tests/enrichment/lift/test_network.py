"""Lift: between its candidates, the same wherever the columns begin, and the same in both of its files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from onnxruntime import InferenceSession
from torch import Tensor

from enrichment.lift.channels import CANDIDATES, RAYS, RINGS, Candidate, Ray
from enrichment.lift.loss import lift_loss
from enrichment.lift.network import RESIDUAL, Lift
from enrichment.networks.export import export_lift, load_weights


def made() -> Lift:
    torch.manual_seed(0)
    network = Lift().eval()
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


@pytest.mark.parametrize("turn", [8, 16, 24])
def test_predictions_rotate_with_the_lidar(turn: int) -> None:
    rings, upper, rays, candidates = example()
    network = made()
    with torch.no_grad():
        one = network(rings, upper, rays, candidates)
        other = network(rings.roll(turn, -1), upper, rays.roll(turn, -1), candidates.roll(turn, -1))
    known = rays[:, Ray.KNOWN] > 0
    torch.testing.assert_close(one.ranges[known], other.ranges.roll(-turn, -1)[known], rtol=1e-3, atol=0)
    torch.testing.assert_close(one.scale[known], other.scale.roll(-turn, -1)[known], rtol=1e-3, atol=1e-3)


def test_onnx_agrees_with_torch_for_any_lidar(tmp_path: Path) -> None:
    network = made()
    export_lift(network, tmp_path)
    session = InferenceSession(tmp_path / "lift.onnx")
    again = Lift().eval()
    load_weights(again, tmp_path / "lift.safetensors")
    for shape in ((4, 6, 96), (16, 45, 128), (3, 1, 104)):
        given = example(*shape)
        with torch.no_grad():
            expected, same = network(*given), again(*given)
        torch.testing.assert_close(expected.ranges, same.ranges)
        names = [entry.name for entry in session.get_inputs()]
        ranges, scale, valid = session.run(None, dict(zip(names, (one.numpy() for one in given), strict=True)))
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
