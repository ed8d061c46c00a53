"""Sparsity-invariant convolution: equation 1, and what follows from it."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from enrichment.networks.sparse_convolution import SCNN, SparseConvolution


def known_at(*at: tuple[int, int], shape: tuple[int, int] = (41, 61)) -> Tensor:
    mask = torch.zeros(1, 1, *shape)
    for v, u in at:
        mask[0, 0, v, u] = 1
    return mask


def test_sparse_convolution_of_a_small_example() -> None:
    layer = SparseConvolution(1, 1, 3)
    with torch.no_grad():
        layer.weight.copy_(torch.arange(1.0, 10).reshape(1, 1, 3, 3))
        layer.bias.fill_(0.5)
    mask = known_at((2, 1), (3, 3), shape=(5, 5))
    x = torch.full((1, 1, 5, 5), 100.0)  # what is not known must not count
    x[0, 0, 2, 1], x[0, 0, 3, 3] = 2.0, 4.0
    y, grown = layer(x, mask)
    assert y[0, 0, 2, 2].item() == pytest.approx((4 * 2 + 9 * 4) / 2 + 0.5, abs=1e-4)
    assert y[0, 0, 1, 0].item() == pytest.approx(9 * 2 + 0.5, abs=1e-4)
    assert y[0, 0, 0, 4].item() == pytest.approx(0.5)  # an empty window
    assert grown[0, 0].tolist() == [
        [0, 0, 0, 0, 0],
        [1, 1, 1, 0, 0],
        [1, 1, 1, 1, 1],
        [1, 1, 1, 1, 1],
        [0, 0, 1, 1, 1],
    ]


@given(seed=st.integers(0, 1000), share=st.floats(0.02, 1.0), size=st.sampled_from([3, 5, 11]))
@settings(max_examples=25, deadline=None)
def test_a_uniform_kernel_on_a_constant_field_is_density_invariant(seed: int, share: float, size: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    mask = (torch.rand(1, 1, 30, 40, generator=generator) < share).float()
    layer = SparseConvolution(1, 1, size)
    with torch.no_grad():
        layer.weight.fill_(0.7)
        layer.bias.fill_(-0.2)
        y, reached = layer(torch.full((1, 1, 30, 40), 3.0), mask)
    torch.testing.assert_close(y[reached > 0], torch.full_like(y[reached > 0], 0.7 * 3 - 0.2), rtol=1e-4, atol=0)
    torch.testing.assert_close(y[reached == 0], torch.full_like(y[reached == 0], -0.2), rtol=1e-4, atol=0)


def test_the_receptive_field_is_twelve_pixels() -> None:
    network, mask = SCNN(), known_at((20, 30), (3, 50))
    x = 5 * mask
    dilated = torch.nn.functional.max_pool2d(mask, 25, stride=1, padding=12)
    for layer in network.layers:
        x, mask = layer(x, mask)
    assert torch.equal(mask, dilated)


def test_scnn_has_the_published_number_of_parameters() -> None:
    assert sum(p.numel() for p in SCNN().parameters()) == 25_585


def test_the_initial_scale_does_not_depend_on_the_density() -> None:
    torch.manual_seed(0)
    depth, network = torch.full((1, 1, 60, 60), 0.3), SCNN()
    sparse = depth * (torch.rand_like(depth) < 0.05)
    with torch.no_grad():
        of_all, of_few = (network(x)[..., 20:40, 20:40].abs().mean().item() for x in (depth, sparse))
    assert 0.01 < of_all < 10
    assert of_few == pytest.approx(of_all, rel=1.0)
