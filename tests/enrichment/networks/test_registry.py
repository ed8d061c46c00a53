"""Contract of all networks: shape, size, units, seeds, and gradients for all parameters."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from enrichment.networks.depth_network import DepthNetwork
from enrichment.networks.erfnet import ERFNet
from enrichment.networks.l2l import L2L
from enrichment.networks.loss import depth_loss
from enrichment.networks.registry import NETWORKS

FUSION_NET, ENCODERS_CLASSIFIER = 2_545_140, 128 * 3 + 3
ERFNET, SCNN = 2_064_336, 25_585
TABLE_1 = 21 * 32 * 11**2 + 32 * 32 * (7**2 + 5**2 + 1) + 4 * 32
PROJECTION = 32 + 1
LARGE = (21 * 32 * 11**2 + 32) + (32 * 32 * 7**2 + 32)
SEPARATED = (21 * 11**2 + 21) + (21 * 32 + 32) + (32 * 7**2 + 32) + (32 * 32 + 32)


def made(name: str, seed: int = 0) -> DepthNetwork:
    torch.manual_seed(seed)
    return NETWORKS.load(name)()


def example(height: int = 16, width: int = 24) -> tuple[Tensor, Tensor]:
    """An image, and a depth image with one pixel in ten."""
    generator = torch.Generator().manual_seed(1)
    image, depth = (torch.rand(2, channels, height, width, generator=generator) for channels in (3, 1))
    return image, torch.where(depth < 0.1, 500 * depth, 0)


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("l2l", SCNN),
        ("li2l", FUSION_NET - ENCODERS_CLASSIFIER),
        ("f2l", ERFNET + SCNN + TABLE_1 + PROJECTION),
        ("f2l-light", ERFNET + SCNN + TABLE_1 + PROJECTION - LARGE + SEPARATED),
    ],
)
def test_networks_have_the_published_number_of_parameters(name: str, parameters: int) -> None:
    assert sum(p.numel() for p in made(name).parameters()) == parameters


def test_erfnet_has_the_published_number_of_parameters() -> None:
    assert sum(p.numel() for p in ERFNet(4, 20).parameters()) == ERFNET


@pytest.mark.parametrize("name", NETWORKS.names())
def test_every_parameter_learns_and_the_loss_falls(name: str) -> None:
    """Ten steps on one example; behind zeros that a network starts with nothing learns in the first."""
    network, (image, depth) = made(name).train(), example()
    truth = torch.full_like(depth, 12.0)
    optimizer, losses = torch.optim.Adam(network.parameters(), 1e-3), []
    for _ in range(10):
        loss = depth_loss(network(image, depth), truth)
        optimizer.zero_grad()
        loss.backward()
        idle = [name for name, p in network.named_parameters() if p.grad is None or not p.grad.any()]
        assert not idle or not losses
        optimizer.step()
        losses.append(loss.item())
    assert losses[-1] < 0.9 * losses[0]


@pytest.mark.parametrize("name", ["l2l", "f2l", "f2l-light"])
def test_a_new_network_predicts_surrounding_depths(name: str) -> None:
    image, depth = example()
    with torch.no_grad():
        dense = made(name)(image, torch.where(depth > 0, 20.0, 0.0))
    torch.testing.assert_close(dense[dense > 0], torch.full_like(dense[dense > 0], 20.0), rtol=1e-4, atol=0)
    assert (dense[depth > 0] > 0).all()


@pytest.mark.parametrize("name", NETWORKS.names())
@pytest.mark.parametrize("shape", [(24, 40), (21, 37)])
def test_the_output_has_the_size_of_the_input(name: str, shape: tuple[int, int]) -> None:
    with torch.no_grad():
        dense = made(name).eval()(*example(*shape))
    assert dense.shape == (2, 1, *shape)
    assert dense.isfinite().all()


@pytest.mark.parametrize("name", NETWORKS.names())
def test_initial_weights_depend_on_the_seed(name: str) -> None:
    one, same, other = ([p.detach() for p in made(name, seed).parameters()] for seed in (0, 0, 1))
    assert all(torch.equal(a, b) for a, b in zip(one, same, strict=True))
    assert not all(torch.equal(a, b) for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize(("name", "used"), [("l2l", False), ("li2l", True), ("f2l", True), ("f2l-light", True)])
def test_networks_that_use_the_image(name: str, used: bool) -> None:
    network, (image, depth) = made(name).eval(), example()
    with torch.no_grad():
        for parameter in network.parameters():  # some start at 0
            parameter += 0.01 * torch.randn(parameter.shape)
        difference = (network(image, depth) - network(1 - image, depth)).abs().max()
    assert (difference > 0.01) == used  # m


def test_depths_are_metres() -> None:
    """SCNN as a mean of depths near by is exact on a wall."""
    network = L2L()
    with torch.no_grad():
        for name, parameter in network.named_parameters():
            parameter.fill_(1 / parameter.shape[1] if name.endswith("weight") else 0)
        dense = network(torch.zeros(1, 3, 16, 16), torch.full((1, 1, 16, 16), 37.0))
    torch.testing.assert_close(dense, torch.full_like(dense, 37.0), rtol=1e-4, atol=0)
